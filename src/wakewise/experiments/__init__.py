"""Trials: a scenario flown, photographed, reconstructed and judged, stage by stage, in one folder."""

from wakewise.experiments.metrics import DEFINITIONS, UNITS, comparison
from wakewise.experiments.stages import Quiet, Watch
from wakewise.experiments.trial import compare_methods, run_trial

__all__ = ["DEFINITIONS", "UNITS", "Quiet", "Watch", "compare_methods", "comparison", "run_trial"]
