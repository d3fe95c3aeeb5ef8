"""Trials: a scenario flown, photographed, reconstructed and judged, stage by stage, in one folder.

Each stage reads files and leaves files, is skipped when done, and goes on where it was cut off.

- `trial.py`: the stages of a trial; several methods side by side.
- `stages.py`: reports of progress, what a stage cost. `surface.py`: mesh and colours in a process of their own.
- `metrics.py`: every figure with unit, definition and better side; reference values. `coverage.py`: the coverage guide
  against the model.
- `export.py`: a trial as files of other tools. `dataset/`: a data set of many trials.
- `timing.py`: options and timing of benches.
"""

from typing import TYPE_CHECKING

from wakewise.core.lazy_imports import lazy_attributes

if TYPE_CHECKING:
    from wakewise.experiments.trials.metrics import DEFINITIONS, UNITS
    from wakewise.experiments.trials.stages import ProgressListener, SilentProgress
    from wakewise.experiments.trials.timing import BenchOptions
    from wakewise.experiments.trials.trial import compare_methods, run_trial

__all__ = [
    "DEFINITIONS",
    "UNITS",
    "BenchOptions",
    "ProgressListener",
    "SilentProgress",
    "compare_methods",
    "run_trial",
]

lazy_attributes(__name__)
