"""Go or no-go: a vehicle on which all is right, and every single thing that may be wrong with it."""

from __future__ import annotations

import dataclasses
import os
from pathlib import Path
from typing import Any

import pytest

from fake_autopilot import FakeAutopilot
from wakewise.core.errors import EnvironmentFailure, InputError
from wakewise.robot.vehicles import load_vehicle
from wakewise_ardusub.link import protocol
from wakewise_ardusub.link.checks import (
    Answer,
    CheckInputs,
    CheckResult,
    MotorObservation,
    MotorResults,
    ReceivedTelemetry,
    check,
    read_results,
    verdict,
    write_results,
)
from wakewise_ardusub.link.parameters import read_parameter_file
from wakewise_ardusub.link.vehicle_survey import await_autopilot, survey

HEAVY = load_vehicle("bluerov2-heavy")
DIRECTIONS = (1, 1, -1, -1, 1, -1, -1, 1)
PARAMETERS = {
    "SYSID_THISMAV": 1.0, "SYSID_MYGCS": 255.0, "FRAME_CONFIG": 2.0, "SCR_ENABLE": 1.0, "WKW_ENABLE": 0.0,
    "WKW_MODES": float(protocol.DEFAULT_MODES), "FS_GCS_ENABLE": 2.0, "FS_PILOT_INPUT": 2.0, "ARMING_CHECK": 448.0,
    "MOT_PWM_TYPE": 0.0,
    **{f"MOT_{i}_DIRECTION": float(d) for i, d in enumerate(DIRECTIONS, 1)},
    **{f"SERVO{i}_FUNCTION": 32.0 + i for i in range(1, 9)},
}  # fmt: skip
HEARD = ReceivedTelemetry(
    seconds=2.0,
    firmware=(4, 5, 3),
    script=float(protocol.SCRIPT_VERSION),
    sticks={255: 40},
    poses={"LOCAL_POSITION_NED": 20},
)
RIGHT = CheckInputs(vehicle=HEAVY, parameters=PARAMETERS, system=1, heard=HEARD)
DATA = Path(os.environ.get("WAKEWISE_DATA", "")) / "ardusub"


def _seen(**answers: Answer) -> MotorResults:
    seen = {
        int(key[1:]): MotorObservation(
            motor=int(key[1:]),
            pulse_us=1560,
            direction=float(DIRECTIONS[int(key[1:]) - 1]),
            expected="ahead",
            answer=answer,
        )
        for key, answer in answers.items()
    }
    return MotorResults(vehicle=HEAVY.name, time="2026-11-23T03:00:00Z", seen=seen)


def _with(**parameters: float | None) -> CheckInputs:
    changed = {name: value for name, value in {**PARAMETERS, **parameters}.items() if value is not None}
    return dataclasses.replace(RIGHT, parameters=changed)


def _heard(**fields: Any) -> CheckInputs:
    return dataclasses.replace(RIGHT, heard=dataclasses.replace(HEARD, **fields))


def _unheard(facts: CheckInputs) -> CheckInputs:
    """A parameter file alone, without a connection."""
    return dataclasses.replace(facts, heard=None)


def _bad(facts: CheckInputs) -> list[CheckResult]:
    return [row for row in check(facts) if row.verdict == "no-go" or (row.verdict == "unknown" and row.needed)]


def test_a_vehicle_on_which_all_is_right_goes() -> None:
    """Every row is go, but for motors that nobody has looked at, which is advice."""
    rows = check(RIGHT)
    assert verdict(rows) == "unseen"
    assert verdict(rows, motors_seen=False) == "go"
    assert [row.what for row in rows if row.verdict != "go"] == ["motors seen"]
    assert sum(row.what.endswith("pushes") for row in rows) == 8


@pytest.mark.parametrize(
    ("facts", "what", "do"),
    [
        (_with(SCR_ENABLE=0.0), "SCR_ENABLE", "reboot"),
        (_with(FS_GCS_ENABLE=1.0), "FS_GCS_ENABLE", "set FS_GCS_ENABLE to 2"),
        (_with(FS_PILOT_INPUT=0.0), "FS_PILOT_INPUT", "set FS_PILOT_INPUT to 2"),
        (_with(ARMING_CHECK=0.0), "arming checks (ARMING_CHECK)", "ARMING_CHECK"),
        (_with(ARMING_CHECK=None, ARMING_SKIPCHK=-1.0), "arming checks (ARMING_SKIPCHK)", "ARMING_SKIPCHK"),
        (_with(SYSID_THISMAV=2.0), "system id (SYSID_THISMAV)", "--system 2"),
        (_with(MAV_SYSID=3.0), "system id (MAV_SYSID)", "--system 3"),
        (_unheard(_with(SYSID_THISMAV=None)), "system id", ""),
        (_unheard(_with(ARMING_CHECK=None)), "arming checks", ""),
        (_with(SERVO8_FUNCTION=59.0), "motors (SERVOn_FUNCTION)", "8 thrusters"),
        (_with(SERVO9_FUNCTION=33.0), "motors (SERVOn_FUNCTION)", "motor 1 is on channels [1, 9]"),
        (_unheard(_with(**{f"SERVO{i}_FUNCTION": None for i in range(1, 9)})), "motors", ""),
        (_with(MOT_3_DIRECTION=0.0), "directions (MOT_n_DIRECTION)", "--motor-test"),
        (_with(MOT_3_DIRECTION=None), "directions (MOT_n_DIRECTION)", ""),
        (_with(MOT_PWM_TYPE=5.0), "pulses (MOT_PWM_TYPE)", "plain pulses"),
        (_with(FRAME_CONFIG=1.0), "frame (FRAME_CONFIG)", "not what is flown"),
        (_with(FRAME_CONFIG=7.0), "frame (FRAME_CONFIG)", "--motor-test"),
        (_with(FRAME_CONFIG=None), "frame (FRAME_CONFIG)", ""),
        (_with(WKW_MODES=0.0), "modes (WKW_MODES)", str(protocol.DEFAULT_MODES)),
        (_heard(kind="PX4"), "autopilot", "vehicle's autopilot"),
        (_heard(firmware=(4, 4, 9)), "firmware", "update ArduSub to 4.5.0"),
        (_heard(firmware=None), "firmware", ""),
        (_heard(script=None), "script", "wakewise link install-script"),
        (_heard(script=99.0), "script", "wakewise link install-script"),
        (_heard(sticks={}), "pilot's sticks", "--relay"),
        (_heard(sticks={190: 5}), "pilot's sticks", "--relay"),
        (_heard(poses={}), "pose", "VISION_POSITION_ESTIMATE"),
        (_heard(mavlink_2=False), "MAVLink", "MAVLink 2"),
    ],
)
def test_each_thing_that_is_wrong_is_found_alone(facts: CheckInputs, what: str, do: str) -> None:
    """One row says it, with what to do, and the verdict is not go."""
    (row,) = _bad(facts)
    assert row.what == what
    assert do in row.do
    assert verdict(check(facts)) != "go"


def test_a_vehicle_file_of_another_vehicle_is_no_go() -> None:
    """Six thrusters on an eight-motor frame: motors and frame both say so."""
    wrong = {row.what for row in _bad(dataclasses.replace(RIGHT, vehicle=load_vehicle("bluerov2")))}
    assert wrong == {"motors (SERVOn_FUNCTION)", "frame (FRAME_CONFIG)"}


def test_modes_that_jump_are_said() -> None:
    """A pilot may allow POSHOLD; it stays go, with what may happen."""
    facts = _with(WKW_MODES=float(protocol.DEFAULT_MODES + (1 << protocol.POSHOLD)))
    (row,) = [row for row in check(facts) if row.what == "modes (WKW_MODES)"]
    assert row.verdict == "go"
    assert row.do == "POSHOLD: depth or place may jump when the sticks come back"


def test_what_somebody_saw_counts() -> None:
    """A motor that blew the other way names the parameter; once turned it is go; one that did nothing is not."""
    seen = _seen(m1="as expected", m3="the other way", m4="nothing", m5="not asked")
    rows = {row.what: row for row in check(dataclasses.replace(RIGHT, results=seen))}
    assert rows["motor 1 seen"].verdict == "go"
    assert (rows["motor 3 seen"].verdict, rows["motor 3 seen"].do) == ("no-go", "set MOT_3_DIRECTION to 1")
    assert rows["motor 4 seen"].verdict == "no-go"
    assert "SERVOn_FUNCTION 36" in rows["motor 4 seen"].do
    assert rows["motor 5 seen"].verdict == rows["motor 8 seen"].verdict == "unknown"
    turned = dataclasses.replace(_with(MOT_3_DIRECTION=1.0), results=_seen(m3="the other way"))
    rows = {row.what: row for row in check(turned)}
    assert (rows["motor 3 seen"].verdict, rows["motor 3 seen"].found) == ("go", "the other way, turned since")
    turned_wrong = dataclasses.replace(_with(MOT_1_DIRECTION=-1.0), results=_seen(m1="as expected"))
    rows = {row.what: row for row in check(turned_wrong)}
    assert (rows["motor 1 seen"].verdict, rows["motor 1 seen"].do) == ("no-go", "set MOT_1_DIRECTION to 1")
    other = dataclasses.replace(_seen(m1="nothing"), vehicle="orca")
    assert verdict(check(dataclasses.replace(RIGHT, results=other))) == "unseen"


def test_pauses_that_would_trip_a_session_are_said() -> None:
    """The longest of each; one over the limit is not go, and not no-go either: three seconds may have been unlucky."""
    rows = {row.what: row for row in check(_heard(gaps_s={"pose": 0.31, "sticks": 0.06, "attitude": 0.03}))}
    pose, sticks = rows["longest pause of the pose"], rows["longest pause of the sticks"]
    assert (pose.verdict, pose.needed, pose.found) == ("unknown", False, "310 ms in 2 s")
    assert "lets go after 200 ms" in pose.do
    assert (sticks.verdict, sticks.do) == ("go", "")


def test_results_survive_their_file(tmp_path: Path) -> None:
    """Written and read they are the same; what is no result is refused in one line."""
    path = tmp_path / "motors.json"
    seen = _seen(m1="as expected", m3="the other way")
    write_results(path, seen)
    assert read_results(path) == seen
    text = path.read_text()
    for content in ("", "[]", "{}", text.replace("as expected", "maybe"), text.replace('"motor": 1,', "")):
        path.write_text(content)
        with pytest.raises(InputError, match=str(path)):
            read_results(path)


@pytest.mark.skipif(not DATA.is_dir(), reason="WAKEWISE_DATA does not lead to ardusub/")
@pytest.mark.parametrize(("name", "vehicle"), [("bluerov2", "bluerov2"), ("bluerov2-heavy", "bluerov2-heavy")])
def test_real_parameters_say_what_is_wrong_with_them(name: str, vehicle: str) -> None:
    """Those that ship for the BlueROV2: mixer and geometry agree on all motors; scripting is off, directions unsaid."""
    parameters = read_parameter_file(DATA / f"{name}-4_0_0.params")
    rows = check(CheckInputs(vehicle=load_vehicle(vehicle), parameters=parameters, system=1))
    assert {row.what for row in rows if row.verdict == "no-go"} == {"SCR_ENABLE"}
    assert {row.what for row in rows if row.verdict == "unknown" and row.needed} == {"directions (MOT_n_DIRECTION)"}
    assert sum(row.what.endswith("pushes") for row in rows) == len(load_vehicle(vehicle).thrusters)
    assert verdict(rows) == "no-go"


def test_a_survey_finds_what_there_is() -> None:
    """Version, script, sticks, pose and parameters over MAVLink bytes are what the checks are given."""
    link = FakeAutopilot(parameters=dict(PARAMETERS))
    link.heartbeat()

    def answer_version(heard: object) -> None:
        link._command(heard)
        if heard.command != 512:  # the rates that a session asks for
            return
        link.say("named_value_float", time_boot_ms=1, name=b"WKW_VER", value=float(protocol.SCRIPT_VERSION))
        link.say("named_value_float", component=191, time_boot_ms=1, name=b"WW_D", value=7.0)
        link.say("manual_control", system=255, component=190, target=1, x=0, y=0, z=500, r=0, buttons=0)
        link.say("manual_control", system=255, component=190, target=9, x=0, y=0, z=500, r=0, buttons=0)
        link.say("local_position_ned", time_boot_ms=1, x=0, y=0, z=1, vx=0, vy=0, vz=0)

    link.on["COMMAND_LONG"] = answer_version
    facts = survey(link, HEAVY, seconds=0.05)
    assert facts.heard == ReceivedTelemetry(
        seconds=0.05,
        firmware=(4, 5, 3),
        script=float(protocol.SCRIPT_VERSION),
        sticks={255: 1},
        poses={"LOCAL_POSITION_NED": 1},
    )
    assert facts.parameters == PARAMETERS
    assert verdict(check(facts), motors_seen=False) == "go"


def test_nobody_or_another_vehicle_is_said() -> None:
    """The systems that were heard instead are named."""
    link = FakeAutopilot()
    link.say("heartbeat", system=42, type=12, autopilot=3, base_mode=0, custom_mode=19, system_status=4)
    with pytest.raises(EnvironmentFailure, match=r"no heartbeat of system 1 in 0\.05 s; heard were systems 42"):
        await_autopilot(link, 0.05)
    with pytest.raises(EnvironmentFailure, match="nobody was heard"):
        await_autopilot(FakeAutopilot(), 0.05)
