"""`wakewise link install-script` and `wakewise link ardusub --check | --motor-test`: what people and machines are
told.
"""

from __future__ import annotations

import dataclasses
import io
import json
import signal
import socket
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip("pymavlink", reason="the extra `links` is not installed")
pytest.importorskip("lupa", reason="the extra `links` is not installed")

from wakewise.robot.vehicles import load_vehicle
from wakewise.ui.cli.main import run
from wakewise_ardusub.link.checks import MotorObservation, MotorResults, write_results
from wakewise_ardusub.link.parameters import read_parameter_file
from wakewise_ardusub.link.protocol import SCRIPT_VERSION
from wakewise_ardusub.link.script import parameters_text, script_text
from wakewise_ardusub.physics.datagrams import PhysicsState
from wakewise_ardusub.physics.physics import PulseTable
from wakewise_ardusub.physics.surface import FreeWater
from wakewise_ardusub.session.session import VehicleSession
from wakewise_ardusub.sitl.own_parameters import own_parameters
from wakewise_ardusub.sitl.simulated_autopilot import SimulatedAutopilot
from wakewise_ardusub.sitl.udp_endpoints import InProcessPhysics, UdpEndpoint
from wakewise_ardusub.sitl.udp_endpoints import run as run_stand_in

Capture = pytest.CaptureFixture[str]


@pytest.fixture
def autopilot() -> Iterator[tuple[SimulatedAutopilot, str]]:
    """A stand-in autopilot without any script, and where it is: it speaks to that port of this computer only."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    autopilot = SimulatedAutopilot({"SCR_ENABLE": 0.0}, loop_hz=50.0)
    vehicle = load_vehicle("bluerov2-heavy")
    behind = InProcessPhysics(body=FreeWater(vehicle), table=PulseTable.of(vehicle))
    link, ended = UdpEndpoint("127.0.0.1", port, out=True), threading.Event()
    runner = threading.Thread(target=run_stand_in, args=(autopilot, behind, [link], lambda: not ended.is_set()))
    runner.start()
    yield autopilot, f"udpin:127.0.0.1:{port}"
    ended.set()
    runner.join(10.0)
    link.close()


def test_the_script_goes_onto_an_autopilot_and_starts(
    autopilot: tuple[SimulatedAutopilot, str], capsys: Capture
) -> None:
    """Uploaded over UDP, read back, SCR_ENABLE set and rebooted: then the script runs there."""
    autopilot, where = autopilot
    assert run(["link", "install-script", "--upload", where, "--start", "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said == {"version": SCRIPT_VERSION, "uploaded": "/APM/scripts/wakewise.lua", "written": []}
    until = time.monotonic() + 10.0
    while autopilot.parameters.get("WKW_ENABLE") is None and time.monotonic() < until:
        time.sleep(0.05)
    assert autopilot.parameters.get("WKW_ENABLE") == 0.0
    assert autopilot.files.scripts() == {"wakewise.lua": script_text()}


def test_the_script_by_hand(capsys: Capture, tmp_path: Path) -> None:
    """Into a folder with the parameters it asks for; without options the steps are said."""
    assert run(["link", "install-script", "--out", str(tmp_path / "new")]) == 0
    assert "lua_scripts" in capsys.readouterr().out
    assert (tmp_path / "new" / "wakewise.lua").read_text() == script_text()
    assert (tmp_path / "new" / "wakewise.params").read_text() == parameters_text()
    assert run(["link", "install-script", "--params"]) == 0
    assert capsys.readouterr().out == parameters_text()
    assert run(["link", "install-script"]) == 0
    assert "SCR_ENABLE" in capsys.readouterr().out


def test_a_live_check_says_go_or_no_go(
    autopilot: tuple[SimulatedAutopilot, str], capsys: Capture, tmp_path: Path
) -> None:
    """A fresh autopilot without pilot or script is no-go with 1, row by row."""
    _, where = autopilot
    results = str(tmp_path / "none.json")
    assert run(["link", "ardusub", "--check", "--connection", where, "--motor-results", results, "--json"]) == 1
    said = json.loads(capsys.readouterr().out)
    rows = {row["what"]: row for row in said["rows"]}
    assert (said["verdict"], said["vehicle"], said["connection"]) == ("no-go", "bluerov2-heavy", where)
    assert {what for what, row in rows.items() if row["verdict"] == "no-go"} == {
        "SCR_ENABLE",
        "script",
        "pilot's sticks",
    }
    assert rows["firmware"]["found"] == "4.5.3"
    assert set(rows["firmware"]) == {"what", "asked", "found", "verdict", "do", "needed", "unseen"}


def test_a_motor_turns_only_by_consent(
    autopilot: tuple[SimulatedAutopilot, str], capsys: Capture, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Said no, a motor does not turn and the file says so; said yes, that one alone gets the pulse that was said.

    What is seen is kept and turned into advice, and the autopilot disarms itself.
    """
    autopilot, where = autopilot
    results, seen = tmp_path / "motors.json", set()
    turned = autopilot.step

    def watched(motion: PhysicsState) -> tuple[int, ...]:
        pulses = turned(motion)
        seen.add(pulses[:8])
        return pulses

    monkeypatch.setattr(autopilot, "step", watched)
    monkeypatch.setattr("wakewise_ardusub.link.motor_test.TURN_S", 0.5)
    for failsafe in ("FS_GCS_ENABLE", "FS_PILOT_INPUT"):
        autopilot.set_parameter(failsafe, 0.0)
    autopilot.armed = True
    asked = ["link", "ardusub", "--motor-test", "--connection", where, "--motor-results", str(results)]
    monkeypatch.setattr("sys.stdin", io.StringIO("n\ny\no\n"))
    assert run([*asked, "--motors", "5,2"]) == 0
    told = capsys.readouterr()
    assert "motor 2 (" in told.err
    assert "pushes the vehicle astern and left" in told.err
    assert "motor 2  the other way: set MOT_2_DIRECTION to -1" in told.out
    motors = {motor["motor"]: motor for motor in json.loads(results.read_text())["motors"]}
    assert [motors[number]["answer"] for number in (5, 2)] == ["not asked", "the other way"]
    pulse_us = motors[2]["pulse_us"]
    assert 1528 < pulse_us < 1650
    assert seen == {(1500,) * 8, (1500, pulse_us, *(1500,) * 6)}
    until = time.monotonic() + 3.0
    while autopilot.armed and time.monotonic() < until:
        time.sleep(0.02)
    assert not autopilot.armed


def test_a_refusal_is_the_autopilots_own_words(
    autopilot: tuple[SimulatedAutopilot, str], capsys: Capture, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Disarmed between question and turn: one line, and nothing turns."""
    autopilot, where = autopilot
    monkeypatch.setattr("wakewise_ardusub.link.motor_test._armed", lambda link: True)
    monkeypatch.setattr("sys.stdin", io.StringIO("y\n"))
    results = str(tmp_path / "motors.json")
    asked = ["link", "ardusub", "--motor-test", "--connection", where, "--motor-results", results, "--motors", "2"]
    assert run(asked) == 1
    assert "motor 2: the test is failed: motor test initialization failed!" in capsys.readouterr().err
    assert set(autopilot.pulses_us[:8]) == {1500}


def _file(tmp_path: Path, **changed: float) -> str:
    values = {
        "SYSID_THISMAV": 1, "FRAME_CONFIG": 2, "SCR_ENABLE": 1, "FS_GCS_ENABLE": 2, "FS_PILOT_INPUT": 2,
        "ARMING_CHECK": 1, **{f"MOT_{i}_DIRECTION": 1 for i in range(1, 9)},
        **{f"SERVO{i}_FUNCTION": 32 + i for i in range(1, 9)}, **changed,
    }  # fmt: skip
    path = tmp_path / "a.params"
    path.write_text("".join(f"{name},{value}\n" for name, value in values.items()))
    return str(path)


def test_a_parameter_file_is_checked_without_a_vehicle(capsys: Capture, tmp_path: Path) -> None:
    """A good one ends with 0 and says what stays open; a wrong value ends with 1 and says what to do."""
    none = ["--motor-results", str(tmp_path / "none.json"), "--without-motor-test"]
    assert run(["link", "ardusub", "--params", _file(tmp_path), *none]) == 0
    assert "go, as far as parameters say" in capsys.readouterr().out
    assert run(["link", "ardusub", "--params", _file(tmp_path, FS_GCS_ENABLE=0), *none]) == 1
    told = capsys.readouterr().out
    assert "set FS_GCS_ENABLE to 2" in " ".join(told.replace("│", " ").split())
    assert "no-go: 1 wrong, 0 not known" in told


def test_go_wants_motors_that_were_seen_to_turn(capsys: Capture, tmp_path: Path) -> None:
    """All else right it ends with 2 and names the motors, until each was seen or --without-motor-test accepts it."""
    results = tmp_path / "motors.json"
    asked = ["link", "ardusub", "--params", _file(tmp_path), "--motor-results", str(results)]
    assert run(asked) == 2
    assert "but nobody has seen the motors turn" in capsys.readouterr().out
    seen = {
        motor: MotorObservation(motor=motor, pulse_us=1560, direction=1.0, expected="ahead", answer="as expected")
        for motor in range(1, 8)
    }
    write_results(results, MotorResults(vehicle="bluerov2-heavy", time="2026-11-26T12:00:00Z", seen=seen))
    assert run(asked) == 2
    assert "but nobody has seen motor 8 turn" in capsys.readouterr().out
    assert run([*asked, "--json"]) == 2
    assert json.loads(capsys.readouterr().out)["verdict"] == "unseen"
    assert run([*asked, "--without-motor-test"]) == 0
    capsys.readouterr()
    eighth = dataclasses.replace(seen[1], motor=8)
    write_results(
        results, MotorResults(vehicle="bluerov2-heavy", time="2026-11-26T12:00:00Z", seen={**seen, 8: eighth})
    )
    assert run(asked) == 0


def test_buttons_are_checked_with_the_rest(capsys: Capture, tmp_path: Path) -> None:
    """Of a file with ArduSub's own table: 4 is refused with what is free, 0 and 15 are go."""
    known = _file(tmp_path, **{name: value for name, value in own_parameters().items() if name.startswith("BTN")})
    asked = ["link", "ardusub", "--params", known, "--motor-results", str(tmp_path / "none.json"), "--json"]
    assert run([*asked, "--without-motor-test", "--buttons", "engage=0,scan=15"]) == 0
    capsys.readouterr()
    assert run([*asked, "--buttons", "engage=4,scan=6"]) == 1
    rows = {row["what"]: row for row in json.loads(capsys.readouterr().out)["rows"]}
    assert rows["button 4 (engage)"]["found"] == "BTN4_FUNCTION is 4 (disarm)"
    assert rows["button 6 (scan)"]["do"] == "free are 0 and 15"


def test_the_simulators_parameters_are_written_beside_the_script(capsys: Capture, tmp_path: Path) -> None:
    """What a vehicle is asked to be set to, its frame, and a quiet depth sensor; every line is read."""
    assert run(["link", "install-script", "--out", str(tmp_path / "scripts"), "--sitl"]) == 0
    capsys.readouterr()
    found = read_parameter_file(tmp_path / "scripts" / "sitl.params")
    asked = read_parameter_file(tmp_path / "scripts" / "wakewise.params")
    assert found == {**asked, "FRAME_CONFIG": 2.0, "SIM_BARO_RND": 0.01, "SIM_BAR2_RND": 0.01}
    assert run(["link", "install-script", "--sitl"]) == 2
    assert "--out DIR" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["ardusub", "--check", "--connection", "upd:0.0.0.0:1"], "'upd' is not one of udpin"),
        (["ardusub", "--check", "--connection", "file:here.txt"], "here.txt is a file; --params"),
        (["ardusub", "--motor-test", "--motors", "1,x", "--connection", "udpin:127.0.0.1:14550"], "--motors '1,x'"),
        (["ardusub", "--params", "missing.params"], "missing.params"),
        (["ardusub", "--params", "here.txt"], "line 1"),
        (["ardusub", "--params", "good.params", "--vehicle", "no-such"], "no-such"),
        (["ardusub", "--params", "good.params", "--motor-results", "here.txt"], "no JSON"),
        (["install-script", "--out", "here.txt"], "a file is there"),
        (["install-script", "--upload", "udpin:0.0.0.0"], "a port is missing"),
        (["install-script", "--upload", "file:here.txt"], "a log is no vehicle"),
        (["install-script", "--start"], "--upload"),
        (["install-script", "--params", "--out", "new"], "goes with neither"),
        (["ardusub", "--motors", "1"], "goes with --motor-test"),
        (["ardusub", "--check", "--motor-test"], "one after the other"),
        (["ardusub", "--camera", "mavlnk"], "right is mavlink, digicam, or run:PROGRAM"),
        (["ardusub", "--box", "0.2,0.2,1.5,0.4"], "box 0.2,0.2,1.5,0.4: outside the picture, 0 to 1"),
        (["ardusub", "--box", "0.2,0.2,0.2,0.4"], "box 0.2,0.2,0.2,0.4: too small"),
        (["ardusub", "--video", "dive.mp4"], "--video 'dive.mp4': must be an address (rtsp, rtsps"),
        (["ardusub", "--video-delay", "9"], "'--video-delay': Input should be less than or equal to 1.5"),
        (["ardusub", "--target", "1e9,0,2"], "--target '1e9,0,2': is farther than 10000 m"),
        (["ardusub", "--relay", "udpin:127.0.0.1:14560"], "is the place of --connection, two are needed"),
        (["ardusub", "--motors", "9", "--motor-test"], "--motors: there is no motor 9"),
        (["ardusub", "--box", "0.2,0.2,nan,0.4"], "--box '0.2,0.2,nan,0.4': must be LEFT,TOP,RIGHT,BOTTOM"),
        (["ardusub", "--out", "here.txt"], "a file is there, a folder is needed"),
        (["ardusub", "--connection", "serial:/dev/ttyNONE:115200"], "/dev/ttyNONE: no such device"),
    ],
)
def test_what_cannot_be_is_one_line(
    arguments: list[str], said: str, capsys: Capture, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Exit code 2, what and where, and nothing written."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "here.txt").write_text("not a parameter\n")
    (tmp_path / "good.params").write_text("SCR_ENABLE,1\n")
    assert run(["link", *arguments]) == 2
    told = capsys.readouterr().err
    assert said in told
    assert told.strip().count("\n") == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["good.params", "here.txt"]


def test_nobody_there_is_one_line(capsys: Capture, monkeypatch: pytest.MonkeyPatch) -> None:
    """A connection on which no autopilot speaks, after a while."""
    monkeypatch.setattr("wakewise_ardusub.link.vehicle_survey.PATIENCE_S", 0.1)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        where = f"udpin:127.0.0.1:{probe.getsockname()[1]}"
    assert run(["link", "ardusub", "--motor-test", "--connection", where]) != 0
    assert "no heartbeat of system 1" in capsys.readouterr().err


@pytest.mark.parametrize("messages", [0, 1])
def test_ctrl_c_ends_a_session_in_its_own_words(
    messages: int, capsys: Capture, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is how a session ends: code 0, what was let go of and where it is kept, nothing of going on; twice is once.

    Of a vehicle that was never heard nothing is kept.
    """

    def interrupted(session: object, where: str) -> None:
        raise KeyboardInterrupt

    def stopped(session: VehicleSession, why: str) -> None:
        session.gate.known = dataclasses.replace(session.gate.known, messages=messages)
        signal.raise_signal(signal.SIGINT)  # an impatient second one
        assert why == "Ctrl-C"

    monkeypatch.setattr("wakewise_ardusub.cli.link_ardusub._watch", interrupted)
    monkeypatch.setattr("wakewise_ardusub.session.session.VehicleSession.start", lambda session: None)
    monkeypatch.setattr("wakewise_ardusub.session.session.VehicleSession.stop", stopped)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        where = f"udpin:127.0.0.1:{probe.getsockname()[1]}"
    assert run(["link", "ardusub", "--connection", where, "--out", str(tmp_path / "sea")]) == 0
    told = capsys.readouterr().err
    kept, nothing = f"let go of the vehicle (Ctrl-C); kept: {tmp_path / 'sea'}", "nothing was heard"
    assert (kept in told, nothing in told) == (bool(messages), not messages)
    assert (tmp_path / "sea").exists() == bool(messages)
    assert "again" not in told
