"""A flight without an end, told from outside what to do."""

from pathlib import Path
from typing import Any

import polars as pl
import pytest

from wakewise.core.errors import InputError
from wakewise.core.interfaces import TruthProvider
from wakewise.operation import LiveFlight, load_scenario, read_exposures, read_scenario
from wakewise.operation.loop import Step

SCENARIO = load_scenario("quick", None, {"method": "dp"})


def flown(folder: Path | None, steps: int, captures: tuple[int, ...] = (), **more: Any) -> LiveFlight:
    """A flight of so many steps, with photographs asked for at some."""

    def watch(step: Step, truth_provider: TruthProvider | None) -> None:
        number = round(step.time_s * 50)
        if number in captures:
            flight.capture()
        if number == steps - 1:
            flight.stop()

    flight = LiveFlight(SCENARIO.parts(), folder=folder, paced=False, watch=watch, **more)
    flight.start()
    flight.join(120.0)
    assert not flight.running
    if flight.fault is not None:
        raise flight.fault
    return flight


def test_a_live_flight_leaves_the_folder_of_a_trial(tmp_path: Path) -> None:
    """It ends when told, with one row per step, a photograph where one was asked for, and a scenario to read."""
    flight = flown(tmp_path / "hand", 40, captures=(9, 20, 21))
    steps = pl.read_parquet(tmp_path / "hand/steps.parquet")
    assert steps.height == 40 and flight.time_s == pytest.approx(0.78)
    opened = [e.time_s for e in read_exposures(tmp_path / "hand/exposures.npz")]
    # Asked for after the tenth step, so taken in the eleventh; the third one waits for the shutter.
    assert opened == pytest.approx([0.2, 0.42, 0.62]) == [e.time_s for e in flight.exposures]
    assert read_scenario(tmp_path / "hand/scenario.yaml").seed == SCENARIO.seed
    assert pl.read_csv(tmp_path / "hand/planned.csv")["name"].to_list() == ["000.png", "001.png", "002.png"]


def test_a_folder_that_holds_a_flight_is_refused(tmp_path: Path) -> None:
    """A flight is not flown over another."""
    (tmp_path / "steps.parquet").touch()
    with pytest.raises(InputError, match="holds a flight already"):
        LiveFlight(SCENARIO.parts(), folder=tmp_path)


def test_it_can_be_stopped_while_it_prepares() -> None:
    """Stopped before its first step, it ends with none, and says so by having no latest one."""
    flight = LiveFlight(SCENARIO.parts(), folder=None)
    flight.stop()
    flight.start()
    flight.join(60.0)
    assert flight.latest is None and flight.fault is None
