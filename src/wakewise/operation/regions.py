"""The region of a flight, kept: drawing its points takes seconds, and flights that are compared share them."""

from __future__ import annotations

from hashlib import blake2b
from threading import Lock

import numpy as np

from wakewise.operation.seeds import Seeds
from wakewise.scene.targets import Region, Target, find_fragility, sample_region

MOST_KEPT = 16
"""Regions that are kept, the last ones asked for: 300 points are 12 kB."""

_kept: dict[bytes, Region] = {}
_one_at_a_time = Lock()


def region_of(target: Target, points: int, seeds: Seeds, delicate_gain: float = 0.0) -> Region:
    """Points that stand for the water round a target; asking again for the same is answered from memory.

    Parameters
    ----------
    target : Target
        What counts is its shape and place, not which object it is.
    points : int
    seeds : Seeds
    delicate_gain : float
        Above 0 the target's delicate features are found and weighted, see `sample_region`.

    Raises
    ------
    InputError
        As `sample_region`.
    """
    key = _fingerprint(target, points, seeds, delicate_gain)
    with _one_at_a_time:
        found = _kept.pop(key, None)
        if found is None:
            marks = find_fragility(target.mesh) if delicate_gain > 0.0 else None
            found = sample_region(target, points, seeds.region(), marks, delicate_gain)
        _kept[key] = found  # the last one asked for is the last to go
        while len(_kept) > MOST_KEPT:
            del _kept[next(iter(_kept))]
        return found


def _fingerprint(target: Target, points: int, seeds: Seeds, delicate_gain: float) -> bytes:
    """Of all that the points follow from; the name stands in errors only, of which nothing is kept."""
    told = blake2b(repr((points, seeds.seed, float(delicate_gain), target.bed_z_m, target.radius_m)).encode())
    for values in (target.mesh.vertices_m, target.mesh.faces, target.centre_W_m):
        told.update(repr(values.shape).encode())
        told.update(np.ascontiguousarray(values).data)
    return told.digest()
