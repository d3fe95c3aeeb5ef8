"""What a wake model knows of a bed, and what it says without one."""

from __future__ import annotations

from wakewise.core.interfaces import WakeModel
from wakewise.wake.learned import LearnedWake
from wakewise.wake.wall_jet import ImpingingJet


def bed_of(wake: WakeModel) -> float | None:
    """Depth of the bed (m) that a model knows of; None for models of free jets."""
    return wake.bed_z_m if isinstance(wake, ImpingingJet | LearnedWake) else None


def free_jet(wake: WakeModel) -> WakeModel:
    """The free jet of a model, without its floor."""
    if isinstance(wake, ImpingingJet):
        return wake.jet
    return wake.free if isinstance(wake, LearnedWake) else wake
