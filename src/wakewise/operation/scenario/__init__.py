"""Scenario: all settings of a trial as one checked record, read from and written to YAML.

- `settings.py`: the fields of a scenario and of its target; the other groups are settings of their own packages
  (`wakewise.scene.missions`, `wakewise.control`, `wakewise.estimation`, `wakewise.simulation.tank`,
  `wakewise.vision.imaging`, `wakewise.vision.reconstruction`).
- `layers.py`: preset, named world, file and overrides merged into one tree of plain values.
- `randomization.py`: fields that the seed draws, and the random streams of a trial.
- `calibration_error.py`: errors of the surveyed target, camera calibration and current.
- `setting_checks.py`: settings that are set and have no effect.
"""

from typing import TYPE_CHECKING

from wakewise.core.lazy_imports import lazy_attributes

if TYPE_CHECKING:
    from wakewise.operation.scenario.layers import PRESETS, parse_overrides
    from wakewise.operation.scenario.settings import (
        Scenario,
        TargetSettings,
        check_scenario,
        describe_fault,
        differences,
        dump_scenario,
        load_scenario,
        read_scenario,
        write_scenario,
    )

__all__ = [
    "PRESETS",
    "Scenario",
    "TargetSettings",
    "check_scenario",
    "describe_fault",
    "differences",
    "dump_scenario",
    "load_scenario",
    "parse_overrides",
    "read_scenario",
    "write_scenario",
]

lazy_attributes(__name__)
