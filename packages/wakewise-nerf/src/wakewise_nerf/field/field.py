"""The radiance field: density and colour of a point seen along a direction, in space that is shrunk to a ball.

Multiresolution hash encoding: positions in a cube to features that are learnt.

T. Mueller et al., ACM TOG 41(4), 2022, doi 10.1145/3528223.3530127, section 3; the equations cited below are its.

Where in space there may be something: a coarse grid over shrunk space, learnt beside the field.
"""

from __future__ import annotations

import itertools
import math
from typing import Any

import torch

from wakewise_nerf.field.settings import FieldSettings

# Eq. 4. As signed 32-bit numbers: multiplication wraps around, and only the low bits are used.
PRIMES = (1, 2654435761 - 2**32, 805459861)


class HashGrid(torch.nn.Module):
    """Features at `levels` resolutions, each interpolated trilinearly between the 8 corners of a cell.

    A level with no more corners than `2 ** table_log2` has an entry for each; a finer one shares entries by a hash.

    `coarsest`, `finest`: cells along the cube at the first and the last level; between them they grow geometrically
    (eqs. 2, 3). `generator`: draws the first values, even in +-1e-4 as in the paper.
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

        `positions`, shape (n, 3): in the unit cube; what lies outside is taken on by the cells at its faces.
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


GEOMETRY = 15
HIDDEN = 64
# exp(11) per radius is opaque within any interval; beyond it float32 gradients serve nothing.
LARGEST_LOG_DENSITY = 11.0
# Density of an untrained field, per radius: thin enough that light passes the region, thick enough to learn from.
FIRST_LOG_DENSITY = -1.0


class RadianceField(torch.nn.Module):
    """Hash grid and two small networks (section 5.4 of the paper in `hash_grid`), and the colour of what is beyond.

    Lengths are in radii of the region about its centre; density is per radius.
    """

    def __init__(self, settings: FieldSettings) -> None:
        super().__init__()
        generator = torch.Generator().manual_seed(settings.random_seed)
        self.grid = HashGrid(
            levels=settings.levels,
            table_log2=settings.table_log2,
            features=settings.features,
            coarsest=settings.coarsest,
            finest=settings.finest,
            generator=generator,
        )
        self.density_network = _network((self.grid.width, HIDDEN, 1 + GEOMETRY), generator)
        self.colour_network = _network((GEOMETRY + 1 + 16, HIDDEN, HIDDEN, 3), generator)
        self.beyond = torch.nn.Parameter(torch.zeros(3))

    def density(self, points: Any) -> tuple[Any, Any]:
        """Density per radius, shape (n,), and what the colour network is told of the place, shape (n, 16)."""
        return self.density_in_cube(unit_cube(contract(points)))

    def density_in_cube(self, places: Any) -> tuple[Any, Any]:
        """Return the same as `density` for places in the cube that space is shrunk into, shape (n, 3)."""
        raw = self.density_network(self.grid(places))
        return torch.exp((raw[:, 0] + FIRST_LOG_DENSITY).clamp(max=LARGEST_LOG_DENSITY)), raw

    def forward(self, points: Any, directions: Any) -> tuple[Any, Any]:
        """Density, shape (n,), and colour, shape (n, 3), 0 to 1, of points seen along unit directions, both (n, 3)."""
        density, told = self.density(points)
        return density, torch.sigmoid(self.colour_network(torch.cat([told, spherical_harmonics(directions)], dim=1)))

    def background(self) -> Any:
        """Colour of light that comes from beyond everything, shape (3,)."""
        return torch.sigmoid(self.beyond)


def contract(points: Any) -> Any:
    """Leave the unit ball as it is and shrink all space around it into a shell of radius 1 to 2; shape (n, 3).

    J. T. Barron et al., Mip-NeRF 360, CVPR 2022, doi 10.1109/CVPR52688.2022.00539, eq. 10.
    """
    length = torch.linalg.vector_norm(points, dim=1, keepdim=True).clamp(min=1.0)
    return points * ((2.0 - 1.0 / length) / length)


def unit_cube(contracted: Any) -> Any:
    """From the ball of radius 2 about the origin to the cube from 0 to 1."""
    return 0.25 * contracted + 0.5


def spherical_harmonics(directions: Any) -> Any:
    """Real spherical harmonics of degree 0 to 3 of unit directions, shape (n, 3), orthonormal over the sphere: (n, 16).

    M. Abramowitz and I. A. Stegun, Handbook of Mathematical Functions, 1972, section 8; as polynomials.
    """
    x, y, z = directions.unbind(dim=1)
    xx, yy, zz = x * x, y * y, z * z
    pi = math.pi
    one = math.sqrt(1 / (4 * pi))
    two = math.sqrt(3 / (4 * pi))
    three = math.sqrt(15 / (4 * pi))
    four = math.sqrt(35 / (32 * pi))
    five = math.sqrt(105 / (4 * pi))
    six = math.sqrt(21 / (32 * pi))
    return torch.stack(
        [
            torch.full_like(x, one),
            two * y,
            two * z,
            two * x,
            three * x * y,
            three * y * z,
            math.sqrt(5 / (16 * pi)) * (3 * zz - 1),
            three * x * z,
            0.5 * three * (xx - yy),
            four * y * (3 * xx - yy),
            five * x * y * z,
            six * y * (5 * zz - 1),
            math.sqrt(7 / (16 * pi)) * z * (5 * zz - 3),
            six * x * (5 * zz - 1),
            0.5 * five * z * (xx - yy),
            four * x * (xx - 3 * yy),
        ],
        dim=1,
    )


def _network(widths: tuple[int, ...], generator: Any) -> Any:
    """Linear layers without bias and ReLU between them; first values even as X. Glorot and Y. Bengio, AISTATS 2010."""
    layers: list[Any] = []
    for before, after in itertools.pairwise(widths):
        layer = torch.nn.Linear(before, after, bias=False)
        bound = math.sqrt(6.0 / (before + after))
        with torch.no_grad():
            layer.weight.uniform_(-bound, bound, generator=generator)
        layers += [layer, torch.nn.ReLU()]
    return torch.nn.Sequential(*layers[:-1])


# Mueller et al. 2022, appendix E.2: densities decay by this factor at each update, so that a cell can become empty.
DECAY = 0.95
# A cell counts as empty where an interval of the region would stop less light than this (appendix E.2).
LEAST_ALPHA = 0.01
# Cells asked at once, which bounds memory.
BATCH = 2**18


class OccupancyGrid(torch.nn.Module):
    """Grid of the largest density met of late, `cells` along each side of the contracted cube.

    `interval`: length of an interval across the region, in radii.
    """

    density: Any
    occupied: Any
    real: Any

    def __init__(self, cells: int, interval: float) -> None:
        super().__init__()
        self.cells = cells
        self.threshold = LEAST_ALPHA / interval
        self.register_buffer("density", torch.zeros(cells**3))
        self.register_buffer("occupied", torch.ones(cells**3, dtype=torch.bool))
        centres = 4.0 * (self._corners(torch.arange(cells**3)) + 0.5) / cells - 2.0
        # The cube's corners lie outside the ball that all space is shrunk into: a third of the cells are nowhere.
        nowhere = torch.linalg.vector_norm(centres, dim=1) > 2.0 + 2.0 * math.sqrt(3.0) / cells
        self.register_buffer("real", ~nowhere, persistent=False)

    def _corners(self, index: Any) -> Any:
        """Whole coordinates of cells by their number, shape (n, 3)."""
        return torch.stack([index // self.cells**2, index // self.cells % self.cells, index % self.cells], dim=1)

    def holds(self, points: Any) -> Any:
        """Whether points, shape (n, 3) in radii, lie in an occupied cell; shape (n,)."""
        at = (unit_cube(contract(points)) * self.cells).int().clamp(0, self.cells - 1)
        return self.occupied[(at[:, 0] * self.cells + at[:, 1]) * self.cells + at[:, 2]]

    @torch.no_grad()
    def update(self, field: Any, generator: Any, *, all_cells: bool, apply: bool) -> None:
        """Ask the field about a point in each cell, or in an eighth of the cells and all occupied ones; then decide.

        `generator`: on the device of the grid; chooses cells and the points in them. `apply`: whether cells may become
        empty; before, only densities are gathered.
        """
        device, count = self.density.device, self.cells**3
        if all_cells:
            chosen = self.real.nonzero()[:, 0]
        else:
            lucky = torch.rand(count, device=device, generator=generator) < 0.125
            chosen = ((lucky | self.occupied) & self.real).nonzero()[:, 0]
        self.density[chosen] *= DECAY
        for part in chosen.split(BATCH):
            corner = self._corners(part)
            place = (corner + torch.rand(corner.shape, device=device, generator=generator)) / self.cells
            found, _ = field.density_in_cube(place)
            self.density[part] = torch.maximum(self.density[part], found)
        if apply:
            # A field that is thin everywhere must not become empty everywhere: what is denser than the mean stays.
            floor = float(self.density[self.real].mean())
            self.occupied = self.density > min(self.threshold, floor)

    def share(self) -> float:
        """Share of the cells that are occupied."""
        return float(self.occupied.float().mean())
