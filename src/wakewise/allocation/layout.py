"""Layout of thrusters: allocation matrix B, thrust limits, pseudo-inverse, null space and its independent blocks."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from wakewise.core.arrays import Array, BoolArray, freeze, frozen
from wakewise.core.errors import InputError

MAX_NULL_SPACE_DIM = 8
"""Largest dimension of a null space that is taken: boxes have 2^k corners."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Layout:
    """An allocation matrix with its limits, and what follows from them; make one with `compile_layout`.

    `inverse`, shape (n, 6), gives the least thrusts; `null`, shape (n, k), is an orthonormal basis of the thrusts
    without wrench, and `blocks` the same in parts that share no thruster, each an orthonormal basis of shape (n, k_b).
    `lines`, shape (k, n), holds the parts as rows if all of them are one-dimensional (else shape (0, n)). A thruster
    whose limits are both zero has failed: its row is zero in all of them.
    """

    B: Array
    lower_N: Array
    upper_N: Array
    inverse: Array
    null: Array
    blocks: tuple[Array, ...]
    lines: Array

    def __post_init__(self) -> None:
        n = self.B.shape[1]
        freeze(self, B=(6, n), lower_N=(n,), upper_N=(n,), inverse=(n, 6), null=(n, None), lines=(None, n))
        object.__setattr__(self, "blocks", tuple(frozen(block, (n, None), "null space") for block in self.blocks))

    @property
    def k(self) -> int:
        """Dimension of the null space."""
        return int(self.null.shape[1])

    @cached_property
    def owners(self) -> BoolArray:
        """Thrusters of each of the blocks, shape (b, n)."""
        return np.array([np.any(np.abs(block) > 1e-12, axis=1) for block in self.blocks]).reshape(-1, self.B.shape[1])

    @property
    def rank(self) -> int:
        """How many independent wrenches the thrusters that work can make."""
        return int(np.count_nonzero(self.upper_N > self.lower_N)) - self.k


def compile_layout(B: Array, lower_N: Array, upper_N: Array) -> Layout:
    """Check an allocation matrix, shape (6, n), and limits, shape (n,), and work out what each wrench needs of them.

    Where the thrusters cannot make every wrench, the nearest is taken, with moments measured against forces at the
    thrusters' own lever arm (root mean square), so that newtons and newton metres can be added.

    Raises InputError on a wrong shape, on numbers that are not finite, on a lower limit above the upper one, on limits
    that exclude zero thrust, or on more than 8 spare thrusters.
    """
    B = frozen(B, (6, None), "allocation matrix")
    n = B.shape[1]
    lower, upper = frozen(lower_N, (n,), "lower limits"), frozen(upper_N, (n,), "upper limits")
    if np.any(lower > upper):
        worst = int(np.argmax(lower - upper))
        raise InputError(f"thruster {worst + 1}: lower limit {lower[worst]:g} N above upper limit {upper[worst]:g} N")
    if np.any(lower > 0.0) or np.any(upper < 0.0):
        worst = int(np.argmax(np.maximum(lower, -upper)))
        raise InputError(
            f"thruster {worst + 1}: limits {lower[worst]:g} to {upper[worst]:g} N, zero thrust must lie between them"
        )
    alive = np.flatnonzero(upper - lower > 0.0)
    inverse, null = np.zeros((n, 6)), np.zeros((n, 0))
    if alive.size:
        scaling = axis_scaling(B[:, alive])
        scaled = B[:, alive] * scaling[:, None]
        inverse[alive] = np.linalg.pinv(scaled, rcond=1e-9) * scaling
        _, sizes, rows = np.linalg.svd(scaled)
        basis = rows[np.count_nonzero(sizes > 1e-9 * sizes[0]) :].T
        null = np.zeros((n, basis.shape[1]))
        null[alive] = basis
    if null.shape[1] > MAX_NULL_SPACE_DIM:
        raise InputError(
            f"allocation matrix: {null.shape[1]} spare thrusters, at most {MAX_NULL_SPACE_DIM} can be searched"
        )
    blocks = independent_blocks(null)
    alone = all(block.shape[1] == 1 for block in blocks)
    lines = np.array([block[:, 0] for block in blocks]).reshape(-1, n) if alone else np.zeros((0, n))
    return Layout(B=B, lower_N=lower, upper_N=upper, inverse=inverse, null=null, blocks=blocks, lines=lines)


def axis_scaling(B: Array) -> Array:
    """Factors, shape (6,), that measure moments against forces at the thrusters' lever arm (root mean square)."""
    force, moment = np.linalg.norm(B[:3]), np.linalg.norm(B[3:])
    arm = float(moment / force) if force > 0.0 and moment > 0.0 else 1.0
    return np.array([1.0, 1.0, 1.0, 1.0 / arm, 1.0 / arm, 1.0 / arm])


def independent_blocks(null: Array) -> tuple[Array, ...]:
    """Split the columns' span, shape (n, k), into parts that share no thruster, shape (n, k_b) each."""
    n, _ = null.shape
    projector = null @ null.T
    group = np.arange(n)
    for i in range(n):
        for j in range(i):
            if abs(projector[i, j]) > 1e-9:
                group[group == group[i]] = group[j]
    blocks = []
    for label in np.unique(group):
        members = group == label
        values, vectors = np.linalg.eigh(projector[np.ix_(members, members)])
        block = np.zeros((n, int(np.sum(values > 0.5))))
        block[members] = vectors[:, values > 0.5]
        if block.shape[1]:
            blocks.append(block)
    return tuple(blocks)
