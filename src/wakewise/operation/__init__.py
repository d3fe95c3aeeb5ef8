"""One vehicle doing one mission: scenario, parts, the fixed-rate loop, the recorder; the same code for tank and sea.

Start reading in `parts.py` (what a flight is built from, and the one place where the controller's world and the true
one meet) and `loop.py` (the loop itself). `scenario.py` with `scenario.py` is a maker of parts, read from YAML
with `randomization.py` (what its seed draws), `randomization.py` its
random streams, `parts.py` keeps what takes long to draw; `worlds/` and `pilot_makers.py` are worlds and pilots by name,
`instant_water.py` and `lattice_water.py` worlds other than the tank, `calibration_error.py` what is known of target and
camera beforehand; `preflight.py` is what a planner is told to keep clear of, `preflight.py` refuses what does not fit,
`preflight.py` says what is set and cannot act, `plugin_adapter.py` guards what comes from outside; `flying.py` flies,
`recorder.py` and `telemetry.py` keep what was, `flight_trim.py` reads from it what ballast is lacking, `photography.py`
renders what the camera saw, `background_renderer.py` while the flight goes on, `guide.py` begins the guide of what
photographs have seen.

By hand (`teleop/`): what an operator asks for, and flights that go on until somebody ends them. What was lies in the
parts of `flight_log.py` until it is a trial's folder (`trial_folder.py`, `flight_log.py`). With a real vehicle
(`at_sea/`): who has the thrusters when. `behind_firmware.py` is the scenario's vehicle behind an autopilot's.
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
