"""The network's training: weighted squares, their gradient by hand, and Adam; NumPy alone, some minutes of a core.

PyTorch stays out: 18,000 weights and 100,000 rows need none of it, and the network would have to be carried over.

The shipped network from nothing: truth, training, file. `wakewise wake learn` runs it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from wakewise.core.arrays import Array, IntArray
from wakewise.core.errors import InputError
from wakewise.core.interfaces import Progress, no_progress
from wakewise.wake.learned import CIRCULAR, Network, save_network
from wakewise_paper.learned_wake.truth import (
    SampledWater,
    TruthSamples,
    even_lattice_rows,
    even_parcel_rows,
    lattice_rows,
    parcel_rows,
)

SOFT = 0.3
"""Of f, whose greatest is about 7: errors of what is weaker count as they are, of what is stronger by their share."""
_BETAS, _EPSILON = (0.9, 0.999), 1e-8  # D. P. Kingma and J. Ba, Adam, arXiv 1412.6980


@dataclass(frozen=True, kw_only=True, eq=False)
class Batch:
    """Inputs, shape (n, INPUTS), wanted f, shape (n, 2), what scales its part across, (n,), and weights, (n,)."""

    inputs: Array
    f: Array
    across_share: Array
    weights: Array

    @classmethod
    def of(cls, parts: Sequence[TruthSamples], shares: Sequence[float]) -> Batch:
        """Rows of several truths, each of which has a share of all weight, spread over its rows.

        An error counts over SOFT and the true speed's size together: a mean of squares alone would fit the core only.
        """
        if len(parts) != len(shares) or not parts:
            raise InputError(f"training: {len(parts)} truths and {len(shares)} shares, allowed as many of both")
        weights = [
            share / len(rows) / (SOFT + np.linalg.norm(rows.f, axis=1))
            for rows, share in zip(parts, shares, strict=True)
        ]
        total = sum(float(w.sum()) for w in weights)
        return cls(
            inputs=np.concatenate([rows.points.inputs(rows.history) for rows in parts]),
            f=np.concatenate([rows.f for rows in parts]),
            across_share=np.concatenate([rows.points.across_share for rows in parts]),
            weights=np.concatenate(weights) / total,
        )

    def __len__(self) -> int:
        return len(self.f)

    def take(self, rows: IntArray) -> Batch:
        """Some of the rows, their weights to sum 1 again."""
        weights = self.weights[rows]
        return Batch(
            inputs=self.inputs[rows],
            f=self.f[rows],
            across_share=self.across_share[rows],
            weights=weights / weights.sum(),
        )

    def single(self) -> Batch:
        """The same in single precision, which is twice as fast and fine for a gradient."""
        names = ("inputs", "f", "across_share", "weights")
        return Batch(**{name: getattr(self, name).astype(np.float32) for name in names})


Layers = tuple[list[Array], list[Array]]


def loss_and_gradient(weights: list[Array], biases: list[Array], batch: Batch) -> tuple[float, Layers]:
    """Weighted sum of squared errors of f, and its gradient by weights and biases."""
    values = [batch.inputs]
    for w, b in zip(weights[:-1], biases[:-1], strict=True):
        values.append(np.tanh(values[-1] @ w + b))
    out = values[-1] @ weights[-1] + biases[-1]
    scale = np.stack([np.ones_like(batch.across_share), batch.across_share], axis=1)
    error = out * scale - batch.f
    loss = float(np.sum(batch.weights[:, None] * error**2))
    back = 2.0 * batch.weights[:, None] * error * scale
    by_weights: list[Array] = []
    by_biases: list[Array] = []
    for k in range(len(weights) - 1, -1, -1):
        by_weights.append(values[k].T @ back)
        by_biases.append(back.sum(axis=0))
        if k:
            back = (back @ weights[k].T) * (1.0 - values[k] ** 2)
    return loss, (by_weights[::-1], by_biases[::-1])


def train(
    start: Network,
    batch: Batch,
    rng: np.random.Generator,
    *,
    steps: int = 6000,
    rows: int = 4096,
    rate: float = 3e-3,
    progress: Progress = no_progress,
) -> tuple[Network, list[float]]:
    """Adam on drawn rows, its rate falling to a hundredth as a cosine; the network and the loss of every 100 steps."""
    single = batch.single()
    weights: list[Any] = [w.astype(np.float32) for w in start.weights]
    biases: list[Any] = [b.astype(np.float32) for b in start.biases]
    values = [*weights, *biases]
    means, squares = ([np.zeros_like(v) for v in values] for _ in range(2))
    losses: list[float] = []
    passed = 0.0
    for step in range(1, steps + 1):
        chosen = rng.choice(len(batch), rows) if rows < len(batch) else np.arange(len(batch))
        loss, (by_weights, by_biases) = loss_and_gradient(weights, biases, single.take(chosen))
        share = 0.01 + 0.99 * 0.5 * (1.0 + np.cos(np.pi * step / steps))
        bias = np.sqrt(1.0 - _BETAS[1] ** step) / (1.0 - _BETAS[0] ** step)
        for k, g in enumerate([*by_weights, *by_biases]):
            means[k] += np.float32(1.0 - _BETAS[0]) * (g - means[k])
            squares[k] += np.float32(1.0 - _BETAS[1]) * (g * g - squares[k])
            values[k] -= np.float32(rate * share * bias) * means[k] / (np.sqrt(squares[k]) + np.float32(_EPSILON))
        passed += loss
        if step % 100 == 0:
            losses.append(passed / 100.0)
            passed = 0.0
            progress(step, steps, f"loss {losses[-1]:.4f}")
    return Network(weights=tuple(weights), biases=tuple(biases)), losses


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
