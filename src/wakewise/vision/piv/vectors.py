"""What PIV gives: displacements on a grid of windows, and which of them can be trusted."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wakewise.core.arrays import Array, BoolArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Displacements:
    """Displacement between two frames in pixels, at window centres in pixels (pixel centres at +0.5).

    `columns_px`, shape (m,), and `rows_px`, shape (n,), hold the grid; `right_px` and `down_px`, shape (n, m), the
    displacement; `valid`, shape (n, m), is False where a vector failed a test and was replaced by its neighbours'.
    `engine` says what computed them.
    """

    columns_px: Array
    rows_px: Array
    right_px: Array
    down_px: Array
    valid: BoolArray
    engine: str

    @property
    def valid_pct(self) -> float:
        """Share of vectors that passed the tests, in per cent."""
        return 100.0 * float(np.mean(self.valid))


def averaged(fields: list[Displacements]) -> Displacements:
    """Mean over pairs of the same view, of each window's trusted vectors; trusted where at least half of them were."""
    trust = np.stack([field.valid for field in fields])
    n = np.maximum(trust.sum(axis=0), 1)
    first = fields[0]
    return Displacements(
        columns_px=first.columns_px,
        rows_px=first.rows_px,
        right_px=np.sum([np.where(f.valid, f.right_px, 0.0) for f in fields], axis=0) / n,
        down_px=np.sum([np.where(f.valid, f.down_px, 0.0) for f in fields], axis=0) / n,
        valid=np.asarray(trust.mean(axis=0) >= 0.5),
        engine=first.engine,
    )
