"""Wake models and the disturbance D of a target: what the thrusters' jets do to the water, as a controller models it.

D is the weighted sum of squared water speeds at the points of a region. With actuator-disk jets it is the quadratic
form D = s' G s of the square roots s of the thrusts; G is the Gram (influence) matrix. The simulated tank does not use
this package.

- `disturbance.py`: D, its Gram matrix, its derivatives.
- `gram.py`: compiled Gram matrix and Gauss-Newton sums; `plan_disturbance.py`: the same, faster, for one MPC stage;
  `finite_difference.py`: the same by differences, for models without derivatives.
- `influence.py`: Gram matrix of a vehicle at a pose, with jets that cross and merge.
- `models.py`: models by name and their settings. `jets.py`: turbulent round jets, and the compiled speeds of all
  jets; `cones.py`: the paper's cone (cos^4 attenuation) and cones with free parameters.
- `wall_jet.py`: jets that strike the bed; `advected_jets.py`: jets and wall jets in a current.
- `learned.py`: a neural network as a wake model.
- `samples.py`: measured velocities and scores of a model; `point_files.py`: files of velocities at points;
  `calibration.py`: least-squares fit of a model and its file.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from wakewise.core.lazy_imports import lazy_attributes

if TYPE_CHECKING:
    from wakewise.wake.cones import PaperJet, PowerJet
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
    from wakewise.wake.jets import AxialJet, GaussianJet, RoundJet
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
