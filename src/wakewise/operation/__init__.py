"""Flights: from a scenario to the parts of a flight, the fixed-rate loop, its record, and photographs.

The same loop flies a simulated tank and a real vehicle. Start reading in `parts.py` and `loop.py`.

- `scenario/`: fields of a scenario, layers of YAML, randomization, errors of survey and calibration.
- `parts.py`: the parts of a flight, each made from the scenario at first use and replaceable.
- `worlds/`: named worlds, and the water models that a flight can take place in.
- `pilot_makers.py`: pilots by name, the sources of a flight's goals.
- `plugin_adapter.py`: parts from outside this project, and the failsafe around a controller.
- `preflight.py`: checks before a flight.
- `loop.py`: the fixed-rate loop of pilot, controller, plant and estimator.
- `flying.py`: one flight of the parts, and its figures.
- `recorder.py`, `flight_log.py`: rows per control step and exposures, in memory or in chunks on disk.
- `telemetry.py`: the record as MCAP.
- `trial_folder.py`: scenario.yaml, truth.ply and planned.csv of a trial.
- `flight_trim.py`: ballast from the hovers of a flight.
- `guide.py`: coverage before the first photograph.
- `photography.py`, `background_renderer.py`: photographs of the exposures, after or during the flight.
- `teleop/`: flight by hand, with assists, in real time.
"""

from typing import TYPE_CHECKING

from wakewise.core.lazy_imports import lazy_attributes

if TYPE_CHECKING:
    from wakewise.operation.background_renderer import BackgroundRenderer
    from wakewise.operation.flight_log import read_exposures
    from wakewise.operation.flying import Flight, fly, fly_trial
    from wakewise.operation.parts import PARTS, Parts
    from wakewise.operation.photography import photo_name, photograph_flight
    from wakewise.operation.recorder import FlightRecorder, step_columns
    from wakewise.operation.scenario import (
        PRESETS,
        Scenario,
        differences,
        load_scenario,
        parse_overrides,
        read_scenario,
        write_scenario,
    )
    from wakewise.operation.teleop.live import LiveFlight

__all__ = [
    "PARTS",
    "PRESETS",
    "BackgroundRenderer",
    "Flight",
    "FlightRecorder",
    "LiveFlight",
    "Parts",
    "Scenario",
    "differences",
    "fly",
    "fly_trial",
    "load_scenario",
    "parse_overrides",
    "photo_name",
    "photograph_flight",
    "read_exposures",
    "read_scenario",
    "step_columns",
    "write_scenario",
]

lazy_attributes(__name__)
