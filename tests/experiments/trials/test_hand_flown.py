"""What follows a flight by hand is what follows any other: no stage knows the difference."""

import json
from pathlib import Path

import polars as pl
import pytest

from wakewise.core.errors import InputError, StageError
from wakewise.experiments.trials import run_trial
from wakewise.operation import LiveFlight, load_scenario, read_scenario
from wakewise.operation.teleop.assisted import assisted
from wakewise.operation.teleop.input.script import script_of
from wakewise.operation.teleop.operator_state import OperatorState

SCENARIO = load_scenario("quick", None, {"method": "dp", "imaging.width": 320, "imaging.height": 240})


def flown(folder: Path, script: list[dict[str, object]]) -> Path:
    """The folder of a short flight by a script's hands."""
    flight = LiveFlight(assisted(SCENARIO.parts(), script_of(script), OperatorState()), folder=folder, paced=False)
    flight.start()
    flight.join(120.0)
    assert flight.fault is None
    return folder


@pytest.mark.slow
def test_photographs_figures_and_reasons_follow_a_flight_by_hand(tmp_path: Path) -> None:
    """From the folder alone: photographs by number, a reason where two of them make no model, figures of the flight."""
    script = [
        {"at_s": 0.0, "pressed": ["operator"], "right": 0.4},
        {"at_s": 0.2, "pressed": ["capture"], "right": 0.4},
        {"at_s": 0.6, "pressed": ["capture"]},
        {"at_s": 0.7, "pressed": ["stop"]},
    ]
    folder = flown(tmp_path / "hand", script)
    figures = run_trial(read_scenario(folder / "scenario.yaml"), folder)
    assert figures["images"] == 2 and figures["success"] is False and figures["energy_kJ"] > 0.0
    assert pl.read_csv(folder / "images.csv")["name"].to_list() == ["000.png", "001.png"]
    assert (folder / "images/001.png").exists() and figures["why"]["rmse_mm"].startswith("no model")
    before = (folder / "images.csv").stat().st_mtime_ns
    assert run_trial(read_scenario(folder / "scenario.yaml"), folder) == figures
    assert (folder / "images.csv").stat().st_mtime_ns == before
    assert "photograph" in json.loads((folder / "stages.json").read_text(encoding="utf-8"))


@pytest.mark.slow
def test_a_flight_without_photographs_has_no_model(tmp_path: Path) -> None:
    """Said in one line, and nothing of the flight is lost."""
    folder = flown(tmp_path / "hand", [{"at_s": 0.1, "pressed": ["stop"]}])
    with pytest.raises(StageError, match="no photograph was taken in its flight"):
        run_trial(read_scenario(folder / "scenario.yaml"), folder)
    assert (folder / "steps.parquet").exists()


def test_hands_are_not_flown_from_a_scenario(tmp_path: Path) -> None:
    """A scenario that names the operator, and no flight to go with it: refused, and no folder is begun."""
    with pytest.raises(InputError, match="pilot: operator, flies by hand"):
        run_trial(SCENARIO.replace(pilot="operator"), tmp_path / "none")
    assert not (tmp_path / "none").exists()


@pytest.mark.slow
def test_a_scenario_may_name_hands_and_their_record_flies_again(tmp_path: Path) -> None:
    """A script by `pilot: operator`, then its flight's record: the same steps and exposures, to the byte."""
    script = tmp_path / "hands.yaml"
    script.write_text(
        "- {at_s: 0, pressed: [operator], down: -0.5}\n- {at_s: 0.3, pressed: [capture]}\n"
        "- {at_s: 0.5, pressed: [stop]}\n",
        encoding="utf-8",
    )
    for folder, hands in (("a", script), ("b", tmp_path / "a" / "controls.parquet")):
        run_trial(SCENARIO.replace(pilot="operator", control_log=str(hands)), tmp_path / folder)
    for name in ("steps.parquet", "exposures.npz", "planned.csv", "images.csv"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes(), name
    assert pl.read_csv(tmp_path / "a/planned.csv").height == 1
