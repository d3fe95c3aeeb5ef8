"""The shipped network from nothing: truth, training, file. `wakewise wake learn` runs it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wakewise.core.interfaces import Progress, no_progress
from wakewise.wake.learned import CIRCULAR, save_network
from wakewise.wake.network import Network
from wakewise_paper.learned_wake.training import Batch, train
from wakewise_paper.learned_wake.truth import (
    SampledWater,
    TruthSamples,
    even_lattice_rows,
    even_parcel_rows,
    lattice_rows,
    parcel_rows,
)

SHARES = {"parcels": 0.4, "parcels, even": 0.25, "lattice": 0.15, "lattice, even": 0.2}
"""Of all weight in the training. Two thirds the tank, a third the lattice, which has less to say of pushes."""


@dataclass(frozen=True, kw_only=True)
class TrainingRecipe:
    """How much is computed: draws of the tank's water, steps of Adam, and whether the lattice runs."""

    draws: int = 60
    steps: int = 8000
    lattice: bool = True
    seed: int = 0


def training_rows(recipe: TrainingRecipe, progress: Progress = no_progress) -> dict[str, list[TruthSamples]]:
    """Truth to train on, by the names of `SHARES`."""
    found: dict[str, list[TruthSamples]] = {name: [] for name in SHARES}
    for k in range(recipe.draws):
        progress(k, recipe.draws + 1, "parcels")
        rng = np.random.default_rng([recipe.seed, k])
        water = SampledWater.of(rng)
        found["parcels"].append(parcel_rows(water, rng, instants=40))
        found["parcels, even"].append(even_parcel_rows(water, rng))
    rng = np.random.default_rng([recipe.seed, recipe.draws])
    found["lattice, even"].append(even_lattice_rows("free", rng, 3000))
    if recipe.lattice:
        progress(recipe.draws, recipe.draws + 1, "lattice")
        found["lattice"].append(lattice_rows("train", rng))
    return found


def make(
    recipe: TrainingRecipe, out: Path | None = None, progress: Progress = no_progress
) -> tuple[Network, list[float]]:
    """Train a network, write it if told where, and return it with the losses of its training."""
    rows = training_rows(recipe, progress)
    parts, shares = [], []
    for name, truths in rows.items():
        parts += truths
        shares += [SHARES[name] / len(truths)] * len(truths)
    rng = np.random.default_rng([recipe.seed, 99_999])
    network, losses = train(Network.drawn(rng), Batch.of(parts, shares), rng, steps=recipe.steps, progress=progress)
    if out is not None:
        lattice = "lattice 'free' and one history" if recipe.lattice else "lattice 'free'"
        save_network(out, network, f"{recipe.draws} draws of the tank's parcels, {lattice}; {CIRCULAR}")
    return network, losses
