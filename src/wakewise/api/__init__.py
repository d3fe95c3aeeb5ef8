"""What `import wakewise` gives beside scenario, parts and flight: whole trials, single questions, things by name.

Thin: each function puts rooms together that do the work, and the command line calls the same ones.

Start reading in `trials.py` (`trial`, `compare`). `thrusts.py` is one wrench and what its thrusts do to the water
(`allocate`, `disturbance`, `velocity`), `models.py` what photographs and clouds are given to (`reconstruct`,
`evaluate`) and things by name.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from wakewise.core.lazy_imports import lazy_attributes

if TYPE_CHECKING:
    from wakewise.api.models import evaluate, load_target, methods, reconstruct
    from wakewise.api.thrusts import allocate, disturbance, velocity
    from wakewise.api.trials import Result, compare, trial

__all__ = [
    "Result",
    "allocate",
    "compare",
    "disturbance",
    "evaluate",
    "load_target",
    "methods",
    "reconstruct",
    "trial",
    "velocity",
]

lazy_attributes(__name__)
