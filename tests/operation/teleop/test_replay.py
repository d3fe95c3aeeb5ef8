"""A flight by hand flown again."""

from pathlib import Path

import polars as pl
import pytest

from wakewise.core.errors import InputError
from wakewise.core.interfaces import TruthProvider
from wakewise.operation import LiveFlight, load_scenario, read_scenario
from wakewise.operation.loop import Step
from wakewise.operation.teleop.assisted import assisted
from wakewise.operation.teleop.input.script import script_of
from wakewise.operation.teleop.operator_state import OperatorSettings, OperatorState
from wakewise.operation.teleop.replay import replay_of

SCENARIO = load_scenario("quick", None, {"world": "tank", "method": "dp"})


def flown(flight: LiveFlight) -> None:
    flight.start()
    flight.join(300.0)
    if flight.fault is not None:
        raise flight.fault


@pytest.mark.slow
def test_the_same_hands_give_the_same_flight_to_the_byte(tmp_path: Path) -> None:
    """Sticks, buttons, settings, photographs that others asked for: all is where it was, in each row and exposure."""
    hands = script_of(
        [
            {"at_s": 0.1, "pressed": ["operator", "precise"], "right": 0.5},
            {"at_s": 0.6, "right": -0.7, "turn": 0.2, "pressed": ["capture"]},
            {"at_s": 1.1, "gone": True},
            {"at_s": 1.4, "pressed": ["stop"]},
        ]
    )
    operator = OperatorState(OperatorSettings(w_track=3.0))

    def watch(step: Step, truth_provider: TruthProvider | None) -> None:
        if step.time_s == pytest.approx(0.8):
            first.capture()
            operator.set(w_track=20.0, method="direct")

    first = LiveFlight(assisted(SCENARIO.parts(), hands, operator), folder=tmp_path / "a", paced=False, watch=watch)
    flown(first)
    assert [e.time_s for e in first.exposures] == pytest.approx([0.6, 0.82]) and first.time_s == pytest.approx(1.4)
    assert read_scenario(tmp_path / "a/scenario.yaml").pilot == "operator"
    assert set(pl.read_parquet(tmp_path / "a/steps.parquet")["leg"]) == {"hold", "by hand"}
    again = replay_of(tmp_path / "a", tmp_path / "b")
    flown(again)
    for name in ("steps.parquet", "exposures.npz", "planned.csv", "controls.parquet", "scenario.yaml"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes(), name


def test_what_nobody_flew_by_hand_is_not_flown_again(tmp_path: Path) -> None:
    """A folder without a record of hands is refused in one line."""
    with pytest.raises(InputError, match=r"has no scenario\.yaml, the folder of a flight by hand is needed"):
        replay_of(tmp_path, None)
