"""Multiresolution hash encoding: positions in a cube to features that are learnt.

T. Mueller et al., ACM TOG 41(4), 2022, doi 10.1145/3528223.3530127, section 3; the equations cited below are its.
"""

from __future__ import annotations

from typing import Any

import torch

# Eq. 4. As signed 32-bit numbers: multiplication wraps around, and only the low bits are used.
PRIMES = (1, 2654435761 - 2**32, 805459861)


class HashGrid(torch.nn.Module):
    """Features at `levels` resolutions, each interpolated trilinearly between the 8 corners of a cell.

    A level with no more corners than `2 ** table_log2` has an entry for each; a finer one shares entries by a hash.

    Parameters
    ----------
    coarsest, finest : int
        Cells along the cube at the first and the last level; between them they grow geometrically (eqs. 2, 3).
    generator : torch.Generator
        Draws the first values, even in +-1e-4 as in the paper.
    """

    def __init__(
        self, *, levels: int, table_log2: int, features: int, coarsest: int, finest: int, generator: Any
    ) -> None:
        super().__init__()
        growth = (finest / coarsest) ** (1.0 / max(levels - 1, 1))
        self.resolutions = tuple(int(coarsest * growth**level + 1e-9) for level in range(levels))
        self.mask = 2**table_log2 - 1
        self.dense = sum((n + 1) ** 3 <= 2**table_log2 for n in self.resolutions)
        sizes = [(n + 1) ** 3 if k < self.dense else 2**table_log2 for k, n in enumerate(self.resolutions)]
        strides = [(1, n + 1, (n + 1) ** 2) if k < self.dense else PRIMES for k, n in enumerate(self.resolutions)]
        firsts = [sum(sizes[:level]) for level in range(levels)]
        self.width = levels * features
        self.table = torch.nn.Parameter(torch.empty(sum(sizes), features).uniform_(-1e-4, 1e-4, generator=generator))
        self.register_buffer("cells", torch.tensor(self.resolutions, dtype=torch.float32)[:, None], persistent=False)
        self.register_buffer("strides", torch.tensor(strides, dtype=torch.int32), persistent=False)
        self.register_buffer("firsts", torch.tensor(firsts, dtype=torch.int32)[:, None, None, None], persistent=False)

    def corners(self, positions: Any) -> tuple[Any, Any]:
        """Rows of the table and trilinear weights of the corners about positions, both of shape (n, levels, 8).

        Parameters
        ----------
        positions : tensor, shape (n, 3)
            In the unit cube; what lies outside is taken on by the cells at its faces.
        """
        scaled = positions[:, None, :] * self.cells  # (n, levels, 3)
        low = torch.minimum(scaled.detach().floor().clamp(min=0.0), self.cells - 1.0)
        share = scaled - low
        start = low.int() * self.strides
        edge = torch.stack([start, start + self.strides], dim=-1)  # (n, levels, axis, side)
        x, y, z = (edge[:, :, axis] for axis in range(3))
        x, y, z = x[..., :, None, None], y[..., None, :, None], z[..., None, None, :]
        few = slice(0, self.dense)
        many = slice(self.dense, None)
        plain = x[:, few] + y[:, few] + z[:, few]
        hashed = (x[:, many] ^ y[:, many] ^ z[:, many]) & self.mask
        rows = torch.cat([plain, hashed], dim=1) + self.firsts
        side = torch.stack([1.0 - share, share], dim=-1)
        wx, wy, wz = (side[:, :, axis] for axis in range(3))
        weights = wx[..., :, None, None] * wy[..., None, :, None] * wz[..., None, None, :]
        return rows.flatten(2), weights.flatten(2)

    def forward(self, positions: Any) -> Any:
        """Features of positions in the unit cube, shape (n, 3), all levels side by side: (n, levels * features)."""
        rows, weights = self.corners(positions)
        mixed = _Mix.apply(self.table, rows.reshape(-1, 8), weights.reshape(-1, 8))
        return mixed.reshape(len(positions), self.width)


class _Mix(torch.autograd.Function):
    """Weighted sums of table rows. PyTorch's own gradients of a gather took 4 to 10 times as long on a CPU."""

    @staticmethod
    def forward(context: Any, table: Any, rows: Any, weights: Any) -> Any:
        context.save_for_backward(table, rows, weights)
        return torch.nn.functional.embedding_bag(rows, table, mode="sum", per_sample_weights=weights)

    @staticmethod
    def backward(context: Any, slope: Any) -> tuple[Any, None, Any]:
        table, rows, weights = context.saved_tensors
        for_table = for_weights = None
        if context.needs_input_grad[0]:
            flat = rows.reshape(-1)
            columns = [
                slope.new_zeros(len(table)).index_add_(0, flat, (weights * slope[:, k : k + 1]).reshape(-1))
                for k in range(table.shape[1])
            ]
            for_table = torch.stack(columns, dim=1)
        if context.needs_input_grad[2]:
            for_weights = torch.einsum("nck,nk->nc", table[rows.long()], slope)
        return for_table, None, for_weights
