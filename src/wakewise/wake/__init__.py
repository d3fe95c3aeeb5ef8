"""What the thrusters do to the water, as a controller sees it: wake models and the disturbance D of a target.

D is here and nowhere else: the weighted mean square of the water's speed at the target's points. The simulated tank
never uses this room: a planner that knew the truth would prove nothing.

Start reading in `disturbance.py` (D, its Gram matrix, and D of jets that go astray) and `models.py` (models by name).
Models: `jets.py` (the paper's), `jets.py` (round turbulent jets), `wall_jet.py` (their wall jets; `models.py` tells
a bed of a model), `advected_jets.py` and `advected_jets.py` (both in a current), `calibration.py` (what can be
fitted), `learned.py` with `learned.py` (a trained rival that remembers). Sums: `gram.py` and `wall_jet.py` with
`kernels.py` (compiled), `disturbance.py` with `gram.py` (derivatives of D), `finite_difference.py`
(the same for models that bring none), `disturbance.py` (what is refused), `plan_disturbance.py` and
`plan_disturbance.py` (D and derivatives over a planner's stage), `influence.py` (D from a vehicle's pose).
`point_files.py` reads measured velocities, `calibration.py`, `samples.py`, `scores.py` and `fit_file.py` fit a model to
them, `calibration.py` holds them against the law that they must obey.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from wakewise.core.lazy_imports import lazy_attributes

if TYPE_CHECKING:
    from wakewise.wake.disturbance import (
        SUPERPOSITIONS,
        Superposition,
        disturbance,
        disturbance_slopes,
        gauss_newton,
        gram,
        gram_with_derivatives,
        incoherent,
        point_disturbance,
        smooth_roots,
        split_roots,
        velocity,
    )
    from wakewise.wake.influence import InfluenceModel
    from wakewise.wake.jets import AxialJet, GaussianJet, PaperJet, PowerJet, RoundJet
    from wakewise.wake.learned import bed_of, free_jet
    from wakewise.wake.models import WakeSettings, model_names, wake_model
    from wakewise.wake.wall_jet import ImpingingJet

__all__ = [
    "SUPERPOSITIONS",
    "AxialJet",
    "GaussianJet",
    "ImpingingJet",
    "InfluenceModel",
    "PaperJet",
    "PowerJet",
    "RoundJet",
    "Superposition",
    "WakeSettings",
    "bed_of",
    "disturbance",
    "disturbance_slopes",
    "free_jet",
    "gauss_newton",
    "gram",
    "gram_with_derivatives",
    "incoherent",
    "model_names",
    "point_disturbance",
    "smooth_roots",
    "split_roots",
    "velocity",
    "wake_model",
]

lazy_attributes(__name__)
