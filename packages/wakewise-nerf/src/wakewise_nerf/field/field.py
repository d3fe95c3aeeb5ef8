"""The radiance field: density and colour of a point seen along a direction, in space that is shrunk to a ball."""

from __future__ import annotations

import itertools
import math
from typing import Any

import torch

from wakewise_nerf.field.hash_grid import HashGrid
from wakewise_nerf.field.settings import FieldSettings

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
