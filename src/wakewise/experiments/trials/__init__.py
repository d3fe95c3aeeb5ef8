"""Trials: a scenario flown, photographed, reconstructed and judged, stage by stage, in one folder.

Each stage takes files and leaves files, is skipped when done, and goes on where it was cut off.

Start reading in `trial.py` (a trial is a page). `stages.py` is who watches and what it cost, `surface.py` makes mesh
and colours beside the report, `trial.py` how large the model came out, `metrics.py` every figure with its unit,
definition and better side, `coverage.py` holds the guide of photographs against the model, `metrics.py` what a
flight is held against, `timing.py` how benches and studies measure and what they are asked, `stages.py` what becomes
of a report that fails, `export.py` hands a trial on to other tools, `dataset/` makes a data set of many.
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
