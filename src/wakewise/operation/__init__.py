"""One vehicle doing one mission: scenario, the fixed-rate loop, the recorder; the same code for tank and sea."""

from typing import TYPE_CHECKING

from wakewise.doors import lazy_door

if TYPE_CHECKING:
    from wakewise.operation.build import Mission, build_camera, build_flight, build_mission, build_scene
    from wakewise.operation.flying import fly_mission
    from wakewise.operation.loop import Step, Truth, WaterTruth, Witness, fly
    from wakewise.operation.photography import photo_name, photograph_flight
    from wakewise.operation.recorder import FlightRecorder, read_exposures, step_columns
    from wakewise.operation.scenario import (
        PRESETS,
        Scenario,
        differences,
        load_scenario,
        parse_overrides,
        read_scenario,
        write_scenario,
    )

__all__ = [
    "PRESETS",
    "FlightRecorder",
    "Mission",
    "Scenario",
    "Step",
    "Truth",
    "WaterTruth",
    "Witness",
    "build_camera",
    "build_flight",
    "build_mission",
    "build_scene",
    "differences",
    "fly",
    "fly_mission",
    "load_scenario",
    "parse_overrides",
    "photo_name",
    "photograph_flight",
    "read_exposures",
    "read_scenario",
    "step_columns",
    "write_scenario",
]

lazy_door(__name__)
