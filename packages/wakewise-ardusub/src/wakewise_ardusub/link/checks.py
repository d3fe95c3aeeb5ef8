"""Checks before an ArduSub vehicle is driven motor by motor: one row for each condition, go or no-go.

`check` is a pure function of `CheckInputs`. `vehicle_survey.py` collects them over a connection; without a connection
the rows that need one are unknown. `MotorResults` are the results of the motor test, stored as a file.

`match_motors` compares ArduSub's mixer (FRAME_CONFIG) with the geometry of the vehicle file, motor by motor, by the
signs of the wrench. The name of a frame is not enough, because FRAME_CONFIG or the firmware's matrix may be wrong.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.core.files import write_json
from wakewise.robot.vehicles import ARDUSUB_VECTORED, ARDUSUB_VECTORED_6DOF, Vehicle
from wakewise.robot.vehicles.check import WRENCH_AXES
from wakewise.robot.vehicles.mixing import compare_signs, factors_as_wrench
from wakewise_ardusub.link.engagement_fsm import EngagementLimits
from wakewise_ardusub.link.parameters import (
    GROUND_NAMES,
    SYSTEM_NAMES,
    conflict,
    first_of,
    free_buttons,
    free_words,
    parameters_of,
)
from wakewise_ardusub.link.protocol import (
    ALLOWED_MODES,
    DEFAULT_MODES,
    ENABLE_PARAMETER,
    LEAST_FIRMWARE,
    MODES_PARAMETER,
    SCRIPT_VERSION,
    SLOTS,
    TRIED_FIRMWARE,
)
from wakewise_ardusub.logs.channels import MODES
from wakewise_ardusub.motors import channels_of_motors

_BLUEROV1 = np.array(
    [
        [0.0, 0.0, -1.0, 0.0, 1.0, 0.0],
        [0.0, 0.0, 1.0, 0.0, 1.0, 0.0],
        [-0.5, 0.5, 0.0, 0.45, 0.0, 0.0],
        [0.5, 0.5, 0.0, 0.45, 0.0, 0.0],
        [0.0, -1.0, 0.0, 1.0, 0.0, 0.0],
        [-0.25, 0.0, 0.0, 0.0, 0.0, 1.0],
    ]
)
_VECTORED_6DOF_90DEG = np.array(
    [
        [1.0, 1.0, 0.0, 1.0, 0.0, 0.0],
        [0.0, 0.0, 1.0, 0.0, 1.0, 0.0],
        [1.0, -1.0, 0.0, 1.0, 0.0, 0.0],
        [0.0, 0.0, 0.0, 0.0, 0.0, 1.0],
        [0.0, 0.0, 0.0, 0.0, 0.0, 1.0],
        [-1.0, 1.0, 0.0, 1.0, 0.0, 0.0],
        [0.0, 0.0, -1.0, 0.0, 1.0, 0.0],
        [-1.0, -1.0, 0.0, 1.0, 0.0, 0.0],
    ]
)
_SIMPLE = np.array(
    [
        [0.0, 0.0, -1.0, 0.0, 1.0, 0.0],
        [0.0, 0.0, 1.0, 0.0, 1.0, 0.0],
        [1.0, 0.0, 0.0, -1.0, 0.0, 0.0],
        [-1.0, 0.0, 0.0, -1.0, 0.0, 0.0],
        [0.0, 0.0, 0.0, 0.0, 0.0, 1.0],
    ]
)
_SIMPLE_3 = np.array([*_SIMPLE[:2], [0.0, 0.0, 0.0, -1.0, 0.0, 0.0]])

FRAMES: dict[int, tuple[str, Array]] = {
    0: ("bluerov1", _BLUEROV1),
    1: ("vectored", ARDUSUB_VECTORED),
    2: ("vectored_6dof", ARDUSUB_VECTORED_6DOF),
    3: ("vectored_6dof_90deg", _VECTORED_6DOF_90DEG),
    4: ("simplerov_3", _SIMPLE_3),
    5: ("simplerov_4", _SIMPLE[:4]),
    6: ("simplerov_5", _SIMPLE),
}
"""FRAME_CONFIG: its name and motor factors, a row per motor with columns roll, pitch, yaw, throttle (up), forward,
lateral (right); from ArduPilot, AP_Motors6DOF::setup_motors. 7, custom, is what somebody built in."""

_WORDS = (("ahead", "astern"), ("right", "left"), ("down", "up"))
_TURNS = (("rolls right", "rolls left"), ("pitches up", "pitches down"), ("yaws right", "yaws left"))


@dataclass(frozen=True, kw_only=True)
class MotorMatch:
    """What mixer and vehicle file say of one motor's positive demand, from 1, in words; `advice` if they differ."""

    motor: int
    by_mixer: str
    by_vehicle: str
    agree: bool
    advice: str = ""


def pushes(wrench: Array) -> str:
    """Which way a wrench, shape (6,), FRD, pushes and turns the vehicle, by the signs of its parts."""
    strong = np.where(np.abs(wrench) > 1e-9, np.sign(wrench), 0.0)
    ways = [_WORDS[i][0 if strong[i] > 0.0 else 1] for i in range(3) if strong[i]]
    turns = [_TURNS[i][0 if strong[i + 3] > 0.0 else 1] for i in range(3) if strong[i + 3]]
    return "; ".join(part for part in (" and ".join(ways), ", ".join(turns)) if part) or "nowhere"


def force_words(axis_B: Array) -> str:
    """Which way a force, shape (3,), FRD, pushes, its lesser parts left out."""
    axis = np.where(np.abs(axis_B) > 0.2 * np.abs(axis_B).max(), axis_B, 0.0)
    return pushes(np.concatenate([axis, np.zeros(3)]))


def match_motors(vehicle: Vehicle, frame: int) -> list[MotorMatch]:
    """Hold each motor of a frame of `FRAMES` against the vehicle's thruster of its number; both have as many."""
    name, factors = FRAMES[frame]
    mixer = np.sign(factors_as_wrench(factors))
    comparison = compare_signs(vehicle, mixer, f"ArduSub, frame {name} (signs)")
    # An entry that disagrees carries the geometry's sign; all others have the mixer's.
    geometry = mixer.copy()
    for wrong in comparison.disagreements:
        geometry[WRENCH_AXES.index(wrong.row), wrong.thruster - 1] = wrong.geometry
    return [
        MotorMatch(
            motor=i + 1,
            by_mixer=pushes(mixer[:, i]),
            by_vehicle=pushes(geometry[:, i]),
            agree=bool(np.array_equal(mixer[:, i], geometry[:, i])),
            advice=_advice(vehicle, mixer, geometry, i),
        )
        for i in range(mixer.shape[1])
    ]


def _advice(vehicle: Vehicle, mixer: Array, geometry: Array, i: int) -> str:
    own = geometry[:, i]
    if np.array_equal(mixer[:, i], own):
        return ""
    who = f"thruster {i + 1} ({vehicle.thrusters[i].name})"
    if np.array_equal(mixer[:, i], -own):
        return f"turn the axis of {who} in the vehicle file about; --motor-test shows which of the two is right"
    others = [j + 1 for j in range(mixer.shape[1]) if j != i and np.array_equal(mixer[:, j], own)]
    if others:
        return (
            f"{who} sits where the frame has motor {others[0]}: put the vehicle file's thrusters in the motors' order"
        )
    return f"{who} is none of this frame's motors: another FRAME_CONFIG, or another vehicle file"


Answer = Literal["as expected", "the other way", "another motor", "nothing", "not asked"]
ANSWERS: tuple[Answer, ...] = get_args(Answer)
DEFAULT_RESULTS = Path("runs/motor-test.json")
_KIND = "wakewise motor test 1"


@dataclass(frozen=True, kw_only=True)
class MotorObservation:
    """One motor, from 1: at a pulse above 1500 us, with MOT_n_DIRECTION as it was, what somebody saw.

    `expected` is the direction in words that was said before.
    """

    motor: int
    pulse_us: int
    direction: float
    expected: str
    answer: Answer

    @property
    def right_direction(self) -> float | None:
        """What MOT_n_DIRECTION must be by what was seen; None where it was not a matter of direction."""
        if self.answer == "as expected":
            return self.direction
        return -self.direction if self.answer == "the other way" else None


@dataclass(frozen=True, kw_only=True)
class MotorResults:
    """Of one vehicle, when it was tested (UTC) and motor by motor."""

    vehicle: str
    time: str
    seen: Mapping[int, MotorObservation]

    def of(self, motor: int) -> MotorObservation | None:
        """What was seen of a motor; None if it was not asked."""
        found = self.seen.get(motor)
        return found if found is not None and found.answer != "not asked" else None


def write_results(path: Path, results: MotorResults) -> None:
    """Write results, whole or not at all."""
    motors = [asdict(results.seen[motor]) for motor in sorted(results.seen)]
    write_json(path, {"kind": _KIND, "vehicle": results.vehicle, "time": results.time, "motors": motors})


def read_results(path: Path) -> MotorResults:
    """Read results.

    Raises
    ------
    InputError
        If the file is none, naming what is wrong with it.
    """
    try:
        said: Any = json.loads(path.read_text(encoding="utf-8"))
    except OSError as fault:
        raise InputError(f"{path}: {fault.strerror}") from None
    except (ValueError, RecursionError):
        raise InputError(f"{path}: no JSON; wakewise link ardusub --motor-test writes such files") from None
    if not isinstance(said, dict) or said.get("kind") != _KIND:
        raise InputError(f"{path}: no result of a motor test; wakewise link ardusub --motor-test writes such files")
    try:
        seen = [_seen(entry) for entry in said["motors"]]
        return MotorResults(
            vehicle=str(said["vehicle"]), time=str(said["time"]), seen={found.motor: found for found in seen}
        )
    except (KeyError, TypeError, ValueError, AttributeError) as fault:
        raise InputError(f"{path}: {fault!r} is missing or wrong; test the motors again") from None


def _seen(entry: Any) -> MotorObservation:
    answer, direction, motor = entry["answer"], float(entry["direction"]), int(entry["motor"])
    if answer not in ANSWERS:
        raise ValueError(f"answer {answer!r}")
    if direction not in {1.0, -1.0}:
        raise ValueError(f"direction {direction:g}")
    return MotorObservation(
        motor=motor,
        pulse_us=int(entry["pulse_us"]),
        direction=direction,
        expected=str(entry["expected"]),
        answer=answer,
    )


Verdict = Literal["go", "no-go", "unknown"]
Whole = Literal["go", "no-go", "unknown", "unseen"]
"""Of all rows; `unseen` is go but for motors that nobody has seen turn."""
GAP_S = EngagementLimits().pose_s
"""Longer than this nothing that a session needs may stay away."""


@dataclass(frozen=True, kw_only=True)
class ReceivedTelemetry:
    """What came over a connection in `seconds`: all of it is unknown without one.

    Parameters
    ----------
    seconds : float
    kind : str
        What the vehicle says it is, such as "ArduSub".
    firmware : tuple of int, or None
        Major, minor, patch of AUTOPILOT_VERSION.
    script : float or None
        Version that the script says; None if it says nothing.
    sticks : dict
        MANUAL_CONTROL for the vehicle by the system id that sent them, with their number.
    poses : dict
        Messages that hold a position by their type, with their number.
    mavlink_2 : bool
        Whether the autopilot speaks MAVLink 2 on this connection.
    gaps_s : dict
        The longest time between two of "pose", "sticks" and "attitude".
    """

    seconds: float
    kind: str = "ArduSub"
    firmware: tuple[int, int, int] | None = None
    script: float | None = None
    sticks: Mapping[int, int] = field(default_factory=dict)
    poses: Mapping[str, int] = field(default_factory=dict)
    mavlink_2: bool = True
    gaps_s: Mapping[str, float] = field(default_factory=dict, compare=False)


@dataclass(frozen=True, kw_only=True, eq=False)
class CheckInputs:
    """All that is looked at; `heard` is None without a connection, `results` where no motor was tested.

    `buttons` are those of the pilot's sticks that are to mean something here, as of `OutputGate`.
    """

    vehicle: Vehicle
    parameters: Mapping[str, float]
    system: int
    heard: ReceivedTelemetry | None = None
    results: MotorResults | None = None
    buttons: Mapping[str, int] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class CheckResult:
    """One thing: what was asked for, what was found, and what to do; `needed` rows must not be unknown.

    `unseen` rows are motors that nobody has seen turn.
    """

    what: str
    asked: str
    found: str
    verdict: Verdict
    do: str = ""
    needed: bool = True
    unseen: bool = False


def check(facts: CheckInputs) -> tuple[CheckResult, ...]:
    """All rows, in the order in which they are mended."""
    return tuple(row for part in _PARTS for row in part(facts))


def verdict(rows: tuple[CheckResult, ...], *, motors_seen: bool = True) -> Whole:
    """Go if nothing says no-go, nothing that is needed is unknown and, if asked for, every motor was seen to turn."""
    if any(row.verdict == "no-go" for row in rows):
        return "no-go"
    if any(row.verdict == "unknown" and row.needed for row in rows):
        return "unknown"
    return "unseen" if motors_seen and any(row.unseen for row in rows) else "go"


def _vehicle(facts: CheckInputs) -> Iterator[CheckResult]:
    if facts.heard is None:
        return
    asked = "ArduSub"
    yield _row("autopilot", asked, facts.heard.kind, facts.heard.kind == asked, "connect to the vehicle's autopilot")


def _firmware(facts: CheckInputs) -> Iterator[CheckResult]:
    least = ".".join(map(str, LEAST_FIRMWARE))
    tried = " and ".join(".".join(map(str, version)) for version in TRIED_FIRMWARE)
    asked = f"ArduSub {least} or later"
    if facts.heard is None or facts.heard.firmware is None:
        yield _unknown("firmware", asked, facts, "not said by the autopilot" if facts.heard is not None else "")
        return
    found = ".".join(map(str, facts.heard.firmware))
    if facts.heard.firmware >= LEAST_FIRMWARE:
        also = "" if facts.heard.firmware[:2] in TRIED_FIRMWARE else f"tried on {tried} only: run --motor-test"
        yield CheckResult(what="firmware", asked=asked, found=found, verdict="go", do=also)
    else:
        yield _row("firmware", asked, found, False, f"update ArduSub to {least} or later: its Lua lacks what is called")


def _system(facts: CheckInputs) -> Iterator[CheckResult]:
    found = first_of(facts.parameters, SYSTEM_NAMES)
    if found is None:
        nothing = f"neither {' nor '.join(SYSTEM_NAMES)} is known"
        yield _unknown("system id", f"{facts.system}", facts, nothing, needed=True)
    else:
        yield _is(f"system id ({found[0]})", found[1], facts.system, f"say --system {found[1]:g}")


def _script(facts: CheckInputs) -> Iterator[CheckResult]:
    yield _parameter(facts, "SCR_ENABLE", {1.0}, "set SCR_ENABLE to 1 and reboot the autopilot")
    asked = f"version {SCRIPT_VERSION}, heard"
    if facts.heard is None:
        yield _unknown("script", asked, facts)
    elif facts.heard.script is None:
        do = "wakewise link install-script --upload ..., then reboot the autopilot"
        yield _row("script", asked, "not heard", False, do)
    else:
        do = "wakewise link install-script --upload ... puts the right one there; then reboot the autopilot"
        yield _row("script", asked, f"version {facts.heard.script:g}", facts.heard.script == SCRIPT_VERSION, do)
    value = facts.parameters.get(MODES_PARAMETER)
    if value is not None:
        allowed = [mode for mode in range(24) if int(value) >> mode & 1]
        names = ", ".join(MODES.get(mode, str(mode)) for mode in allowed) or "none"
        more = [MODES.get(mode, str(mode)) for mode in allowed if mode not in ALLOWED_MODES]
        do = f"{', '.join(more)}: depth or place may jump when the sticks come back" if more else ""
        do = do or ("" if allowed else f"set {MODES_PARAMETER} to {DEFAULT_MODES}")
        asked = " or ".join(MODES[mode] for mode in sorted(ALLOWED_MODES, reverse=True))
        good: Verdict = "go" if allowed else "no-go"
        yield CheckResult(what=f"modes ({MODES_PARAMETER})", asked=asked, found=names, verdict=good, do=do)
    switch = facts.parameters.get(ENABLE_PARAMETER)
    if switch is not None:
        do = "" if switch == 1.0 else f"set {ENABLE_PARAMETER} to 1 when the companion is to drive; off after a reboot"
        found = "on" if switch == 1.0 else "off"
        yield CheckResult(what=f"switch ({ENABLE_PARAMETER})", asked="on or off", found=found, verdict="go", do=do)


def _motors(facts: CheckInputs) -> Iterator[CheckResult]:
    count = len(facts.vehicle.thrusters)
    asked = f"motors 1 to {count}, each on one channel"
    if count > SLOTS:
        yield _row("motors", f"at most {SLOTS}", f"{count} thrusters", False, f"one message holds {SLOTS} motors")
        return
    channels = channels_of_motors(facts.parameters)
    if not any(name.startswith("SERVO") for name in facts.parameters):
        yield _unknown("motors", asked, facts, "no SERVOn_FUNCTION is known", needed=True)
        return
    found = ", ".join(f"{motor} on {'+'.join(map(str, at))}" for motor, at in channels.items()) or "none"
    if channels == {motor: [motor] for motor in range(1, len(channels) + 1)} and channels:
        found = f"motors 1 to {len(channels)}, on channels of the same numbers"
    twice = [motor for motor, at in channels.items() if len(at) > 1]
    do = f"vehicle {facts.vehicle.name} has {count} thrusters: name the right --vehicle, or mend SERVOn_FUNCTION"
    if twice:
        do = f"motor {twice[0]} is on channels {channels[twice[0]]}: an override reaches only the first of them"
    good = list(channels) == list(range(1, count + 1)) and not twice
    yield _row("motors (SERVOn_FUNCTION)", asked, found, good, do)
    directions = {i: facts.parameters.get(f"MOT_{i}_DIRECTION") for i in range(1, count + 1)}
    missing = [i for i, value in directions.items() if value is None]
    if missing:
        found = f"not said for motor {', '.join(map(str, missing))}"
        yield _unknown("directions (MOT_n_DIRECTION)", "1 or -1 each", facts, found, needed=True)
        return
    found = " ".join(f"{value:+g}" for value in directions.values() if value is not None)
    good = all(value in {1.0, -1.0} for value in directions.values())
    yield _row("directions (MOT_n_DIRECTION)", "1 or -1 each", found, good, "set each to 1 or -1: --motor-test")
    pwm = facts.parameters.get("MOT_PWM_TYPE")
    if pwm is not None:
        do = "set MOT_PWM_TYPE to 0: the vehicle's thrust table is of plain pulses"
        yield _row("pulses (MOT_PWM_TYPE)", "0", f"{pwm:g}", pwm == 0.0, do)


def _mixing(facts: CheckInputs) -> Iterator[CheckResult]:
    value = facts.parameters.get("FRAME_CONFIG")
    count = len(facts.vehicle.thrusters)
    asked = f"a frame with {count} motors"
    if value is None:
        yield _unknown("frame (FRAME_CONFIG)", asked, facts, "FRAME_CONFIG is not known", needed=True)
        return
    if int(value) not in FRAMES:
        do = "its matrix is built into the firmware: check every motor with --motor-test"
        yield CheckResult(
            what="frame (FRAME_CONFIG)", asked=asked, found=f"{value:g}, custom", verdict="unknown", do=do, needed=True
        )
        return
    name, factors = FRAMES[int(value)]
    found = f"{value:g}, {name}: {len(factors)} motors"
    good = len(factors) == count
    yield _row("frame (FRAME_CONFIG)", asked, found, good, f"vehicle {facts.vehicle.name} is not what is flown here")
    if good:
        for match in match_motors(facts.vehicle, int(value)):
            what = f"motor {match.motor} pushes"
            yield _row(what, f"mixer: {match.by_mixer}", f"vehicle file: {match.by_vehicle}", match.agree, match.advice)


def _tested(facts: CheckInputs) -> Iterator[CheckResult]:
    look = "wakewise link ardusub --motor-test has somebody look at each"
    if facts.results is None or facts.results.vehicle != facts.vehicle.name:
        found = "none was tested" if facts.results is None else f"tested were those of {facts.results.vehicle}"
        asked = "each pushes as expected"
        row = CheckResult(
            what="motors seen", asked=asked, found=found, verdict="unknown", do=look, needed=False, unseen=True
        )
        yield row
        return
    for motor in range(1, min(len(facts.vehicle.thrusters), SLOTS) + 1):
        what, asked = f"motor {motor} seen", "pushes as expected"
        seen = facts.results.of(motor)
        direction = facts.parameters.get(f"MOT_{motor}_DIRECTION")
        if seen is None or direction is None:
            found = "not tested"
            yield CheckResult(
                what=what, asked=asked, found=found, verdict="unknown", do=look, needed=False, unseen=True
            )
        elif seen.right_direction is None:
            do = f"find what turns: SERVOn_FUNCTION {32 + motor}, the cable of motor {motor}, its speed controller"
            yield _row(what, asked, seen.answer, False, do)
        else:
            right = seen.right_direction
            found = seen.answer + (", turned since" if seen.direction != direction else "")
            yield _row(what, asked, found, direction == right, f"set MOT_{motor}_DIRECTION to {right:g}")


def _buttons(facts: CheckInputs) -> Iterator[CheckResult]:
    free = free_buttons(facts.parameters)
    if not facts.buttons:
        if free:
            found = ", ".join(map(str, free))
            yield CheckResult(
                what="buttons without a function", asked="any of them for --buttons", found=found, verdict="go"
            )
        return
    for what, button in facts.buttons.items():
        row, asked = f"button {button} ({what})", "no function of the autopilot"
        missing = next((name for name in parameters_of(button) if name not in facts.parameters), None)
        if missing:
            yield _unknown(row, asked, facts, f"{missing} is not known", needed=True)
            continue
        words = conflict(button, what, facts.parameters)
        yield _row(row, asked, words or "none", not words, free_words(facts.parameters, facts.buttons))


def _failsafes(facts: CheckInputs) -> Iterator[CheckResult]:
    yield _parameter(
        facts, "FS_GCS_ENABLE", {2.0, 3.0, 4.0}, "set FS_GCS_ENABLE to 2: a lost ground station disarms, and ends it"
    )
    yield _parameter(facts, "FS_PILOT_INPUT", {2.0}, "set FS_PILOT_INPUT to 2: a silent stick disarms, and ends it")
    skipped = facts.parameters.get("ARMING_SKIPCHK")
    if skipped is not None:
        do = "set ARMING_SKIPCHK to 0, or to the few checks that this vehicle cannot pass"
        yield _row("arming checks (ARMING_SKIPCHK)", "not all skipped", f"{skipped:g}", skipped != -1.0, do)
        return
    checks = facts.parameters.get("ARMING_CHECK")
    if checks is None:
        nothing = "neither ARMING_CHECK nor ARMING_SKIPCHK is known"
        yield _unknown("arming checks", "some", facts, nothing, needed=True)
    else:
        yield _row("arming checks (ARMING_CHECK)", "not 0", f"{checks:g}", checks != 0.0, "set ARMING_CHECK to 1: all")


def _hearing(facts: CheckInputs) -> Iterator[CheckResult]:
    heard = facts.heard
    ground = first_of(facts.parameters, GROUND_NAMES)
    asked = f"MANUAL_CONTROL of system {ground[1]:g}" if ground else "MANUAL_CONTROL of the ground station"
    if heard is None:
        for what, expected in (("pilot's sticks", asked), ("pose", "a position"), ("MAVLink", "version 2")):
            yield _unknown(what, expected, facts)
        return
    found = ", ".join(f"{n / heard.seconds:.1f} a second of system {who}" for who, n in sorted(heard.sticks.items()))
    good = any(ground is None or who == round(ground[1]) for who in heard.sticks)
    do = (
        "move a stick; if it stays so, the router does not pass them on: give the companion a UDP endpoint of its own, "
        "or use --relay"
    )
    yield _row("pilot's sticks", asked, found or "none", good, do)
    found = ", ".join(f"{name} {n / heard.seconds:.1f} a second" for name, n in sorted(heard.poses.items()))
    do = "no sensor gives a position: a DVL, a positioning system or VISION_POSITION_ESTIMATE is needed to engage"
    yield _row("pose", "a position", found or "none", bool(heard.poses), do)
    for what, gap_s in heard.gaps_s.items():
        even = gap_s <= GAP_S
        do = f"a session lets go after {1e3 * GAP_S:.0f} ms without: look for what pauses it (Wi-Fi, a busy computer)"
        yield CheckResult(
            what=f"longest pause of the {what}",
            asked=f"at most {1e3 * GAP_S:.0f} ms, better half of it",
            found=f"{1e3 * gap_s:.0f} ms in {heard.seconds:g} s",
            verdict="go" if even else "unknown",
            do="" if even else do,
            needed=False,
        )
    do = "set SERIALn_PROTOCOL of this port, or the endpoint in BlueOS, to MAVLink 2"
    yield _row("MAVLink", "version 2", "version 2" if heard.mavlink_2 else "version 1", heard.mavlink_2, do)


_PARTS: tuple[Callable[[CheckInputs], Iterator[CheckResult]], ...] = (
    _vehicle,
    _firmware,
    _system,
    _script,
    _motors,
    _mixing,
    _tested,
    _buttons,
    _failsafes,
    _hearing,
)


def _row(what: str, asked: str, found: str, good: bool, do: str) -> CheckResult:
    return CheckResult(what=what, asked=asked, found=found, verdict="go" if good else "no-go", do="" if good else do)


def _is(what: str, found: float, asked: float, do: str) -> CheckResult:
    return _row(what, f"{asked:g}", f"{found:g}", found == asked, do)


def _parameter(facts: CheckInputs, name: str, allowed: set[float], do: str) -> CheckResult:
    asked = " or ".join(f"{value:g}" for value in sorted(allowed))
    if name not in facts.parameters:
        return _unknown(name, asked, facts, "not known", needed=True)
    found = facts.parameters[name]
    return _row(name, asked, f"{found:g}", found in allowed, do)


def _unknown(what: str, asked: str, facts: CheckInputs, found: str = "", *, needed: bool | None = None) -> CheckResult:
    """Without a connection nothing can be heard, and only parameters must be known."""
    offline = facts.heard is None
    return CheckResult(
        what=what,
        asked=asked,
        found=found or "needs a connection",
        verdict="unknown",
        needed=not offline if needed is None else needed,
    )
