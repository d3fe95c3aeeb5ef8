"""Light along rays obeys the closed form; space is shrunk smoothly; functions of direction are orthonormal."""

import math

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="needs the extra `nerf` (PyTorch)")

from wakewise_nerf.field.field import contract, spherical_harmonics
from wakewise_nerf.field.rendering import interval_edges, median_depth, render, weights_of


def test_homogeneous_slab_is_beers_law():
    """Any number of intervals: opacity 1 - exp(-s L), weights as the integral of s exp(-s t), half-way at ln 2 / s."""
    density, length = 3.0, 2.0
    for count in (1, 7, 200):
        edges = torch.linspace(0.5, 0.5 + length, count + 1, dtype=torch.float64)[None]
        lengths = edges[:, 1:] - edges[:, :-1]
        weights, through = weights_of(torch.full_like(lengths, density), lengths)
        far, near = (edges[0, 1:] - 0.5).numpy(), (edges[0, :-1] - 0.5).numpy()
        np.testing.assert_allclose(weights[0].numpy(), np.exp(-density * near) - np.exp(-density * far), rtol=1e-10)
        np.testing.assert_allclose(through[0].numpy(), np.exp(-density * near), rtol=1e-10)
        assert float(weights.sum()) == pytest.approx(1 - math.exp(-density * length), rel=1e-12)
        half = median_depth(torch.full_like(lengths, density), edges)
        assert float(half) == pytest.approx(0.5 + math.log(2) / density, rel=1e-12)


def test_two_slabs_shade_each_other():
    """The second slab sends what the first lets through; a ray that stops less than half of the light has no depth."""
    edges = torch.tensor([[0.0, 1.0, 2.0, 3.0]], dtype=torch.float64)
    density = torch.tensor([[0.2, 0.0, 0.4]], dtype=torch.float64)
    weights, _ = weights_of(density, edges[:, 1:] - edges[:, :-1])
    assert weights[0].tolist() == pytest.approx([1 - math.exp(-0.2), 0.0, math.exp(-0.2) * (1 - math.exp(-0.4))])
    assert float(median_depth(density, edges)) == 0.0
    thick = torch.tensor([[0.2, 0.0, 4.0]], dtype=torch.float64)
    assert float(median_depth(thick, edges)) == pytest.approx(2.0 + (math.log(2) - 0.2) / 4.0)


def test_intervals_cover_the_ball_evenly_and_all_before_and_behind():
    """Edges rise from within radius 2 to far behind, evenly inside the ball; a ray past the ball has none there."""
    origins = torch.tensor([[0.0, 0.0, -5.0], [1.3, 0.0, -5.0], [0.0, 0.2, 0.1]])
    directions = torch.tensor([[0.0, 0.0, 1.0]]).expand(3, 3)
    edges = interval_edges(origins, directions, 16)
    assert edges.shape == (3, 16 + 2 + 4 + 1)
    assert bool((edges[:, 1:] >= edges[:, :-1]).all())
    through = edges[0].numpy()
    assert through[0] == pytest.approx(3.0, abs=1e-5)
    np.testing.assert_allclose(through[2:19], np.linspace(4.0, 6.0, 17), atol=1e-5)
    assert through[-1] == pytest.approx(6.0 + 20.0, rel=1e-4)
    assert np.ptp(edges[1].numpy()[2:19]) == pytest.approx(0.0, abs=1e-5)
    assert float(edges[2, 0]) == pytest.approx(0.05)
    # Neither the widening before nor that behind starts with a jump: as long as shrunk space says.
    assert through[3] - through[2] == pytest.approx(0.125, abs=1e-5)
    assert 0.1 < through[2] - through[1] < 1.0


def test_contraction_keeps_the_ball_and_bounds_the_rest():
    """Identity inside, continuous with its slope across the sphere, radius 2 - 1/r outside."""
    generator = torch.Generator().manual_seed(0)
    inside = torch.nn.functional.normalize(torch.randn(50, 3, generator=generator, dtype=torch.float64), dim=1) * 0.9
    np.testing.assert_allclose(contract(inside).numpy(), inside.numpy(), atol=1e-12)
    unit = inside / 0.9
    for radius in (1.0, 1.5, 4.0, 1e6):
        shrunk = contract(unit * radius)
        np.testing.assert_allclose(shrunk.numpy(), unit.numpy() * (2 - 1 / radius), atol=1e-9)
    step = 1e-6
    slope = (contract(unit * (1 + step)) - contract(unit * (1 - step))) / (2 * step)
    np.testing.assert_allclose(slope.numpy(), unit.numpy(), atol=1e-5)


def test_spherical_harmonics_are_orthonormal():
    """Integrals of all products over the sphere, by a quadrature that is exact for them, are the identity."""
    nodes, weights = np.polynomial.legendre.leggauss(8)
    turn = 2 * np.pi * (np.arange(16) + 0.5) / 16
    z, angle = (a.ravel() for a in np.meshgrid(nodes, turn, indexing="ij"))
    share = np.repeat(weights, 16) * 2 * np.pi / 16
    ring = np.sqrt(1 - z**2)
    directions = torch.tensor(np.stack([ring * np.cos(angle), ring * np.sin(angle), z], axis=1))
    values = spherical_harmonics(directions).numpy()
    np.testing.assert_allclose((values * share[:, None]).T @ values, np.eye(16), atol=1e-12)


class Ball:
    """A field in closed form: constant density in a ball of radius 0.5 about the origin, red, on blue."""

    def density(self, points):
        inside = (torch.linalg.vector_norm(points, dim=1) < 0.5).float()
        return 4.0 * inside, inside

    def __call__(self, points, directions):
        return self.density(points)[0], torch.tensor([1.0, 0.0, 0.0]).expand(len(points), 3)

    def background(self):
        return torch.tensor([0.0, 0.0, 1.0])


def test_render_of_a_ball_is_its_closed_form():
    """Opacity by the length of the chord, colour mixed with what is beyond, depth ln 2 / s behind the surface."""
    offset = torch.tensor([0.0, 0.3, 0.45, 0.7])
    origins = torch.stack([offset, torch.zeros(4), torch.full((4,), -4.0)], dim=1)
    directions = torch.tensor([[0.0, 0.0, 1.0]]).expand(4, 3)
    seen = render(Ball(), None, origins, directions, samples=2000)
    chord = 2 * np.sqrt(np.maximum(0.25 - offset.numpy() ** 2, 0))
    opacity = 1 - np.exp(-4.0 * chord)
    np.testing.assert_allclose(seen.opacity.numpy(), opacity, atol=5e-3)
    np.testing.assert_allclose(seen.colour.numpy(), np.stack([opacity, 0 * opacity, 1 - opacity], 1), atol=5e-3)
    depth = np.where(opacity >= 0.5, 4.0 - chord / 2 + np.log(2) / 4.0, 0.0)
    np.testing.assert_allclose(seen.depth.numpy(), depth, atol=3e-3)
    alone = render(Ball(), None, origins, directions, samples=2000, colours=False)
    np.testing.assert_allclose(alone.depth.numpy(), seen.depth.numpy(), atol=1e-5)
    assert alone.colour is None
