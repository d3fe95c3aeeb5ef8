"""What was seen of each motor when it was tested alone, as a file that is kept beside the vehicle."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal, get_args

from wakewise.core.errors import InputError
from wakewise.core.files import write_json

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
