"""Trials: every figure of a model that is handed on is defined."""

from wakewise.experiments.trials import DEFINITIONS, UNITS
from wakewise.experiments.trials.trial import _SURFACE_FIGURES
from wakewise.vision.evaluation import SURFACE_DEFINITIONS, SurfaceScore


def test_every_figure_of_the_surface_is_one_and_is_defined() -> None:
    """What a trial takes over from the score is a field of it, and has a unit and a definition in both places."""
    fields = set(SurfaceScore.__dataclass_fields__)
    assert fields == set(SURFACE_DEFINITIONS)
    assert set(_SURFACE_FIGURES) <= fields
    assert set(_SURFACE_FIGURES) <= set(DEFINITIONS) == set(UNITS)
