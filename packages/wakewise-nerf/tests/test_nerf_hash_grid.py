"""The hash encoding is the paper's: a twin written out corner by corner, and gradients as finite differences."""

import itertools

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="needs the extra `nerf` (PyTorch)")

from wakewise_nerf.field.field import HashGrid


@pytest.fixture(scope="module")
def grid():
    """Four levels, of which two are dense and two hashed, with values far from zero."""
    made = HashGrid(
        levels=4, table_log2=9, features=2, coarsest=4, finest=19, generator=torch.Generator().manual_seed(3)
    )
    with torch.no_grad():
        made.table.uniform_(-1.0, 1.0, generator=torch.Generator().manual_seed(4))
    return made


def features_twin(grid, position):
    """Sum over eight corners, in plain Python with whole numbers that never overflow."""
    table = grid.table.detach().double().numpy()
    out, first = [], 0
    for cells in grid.resolutions:
        dense = (cells + 1) ** 3 <= 2**9
        scaled = [float(p) * cells for p in position]
        low = [min(max(int(np.floor(s)), 0), cells - 1) for s in scaled]
        value = np.zeros(2)
        for corner in itertools.product((0, 1), repeat=3):
            x, y, z = (a + b for a, b in zip(low, corner, strict=True))
            hashed = (x ^ (y * 2654435761) ^ (z * 805459861)) % 2**9
            row = x + (cells + 1) * (y + (cells + 1) * z) if dense else hashed
            weight = 1.0
            for s, a, b in zip(scaled, low, corner, strict=True):
                weight *= (s - a) if b else 1.0 - (s - a)
            value += weight * table[first + row]
        out.append(value)
        first += (cells + 1) ** 3 if dense else 2**9
    assert first == len(table)
    return np.concatenate(out)


def test_levels_grow_geometrically_from_coarsest_to_finest():
    """Eqs. 2 and 3 of the paper, with its own L = 16, N from 16 to 2048; both ends are met exactly."""
    made = HashGrid(levels=16, table_log2=14, features=2, coarsest=16, finest=2048, generator=torch.Generator())
    assert made.resolutions[0] == 16 and made.resolutions[-1] == 2048
    ratio = np.array(made.resolutions[1:]) / np.array(made.resolutions[:-1])
    assert np.all(np.abs(ratio - 128 ** (1 / 15)) < 0.05)
    assert made.width == 32


def test_features_are_those_of_the_readable_twin(grid):
    """Random positions, corners, faces and edges of the cube."""
    rng = np.random.default_rng(0)
    positions = np.concatenate([rng.random((60, 3)), list(itertools.product((0.0, 1.0, 0.5), repeat=3))])
    found = grid(torch.tensor(positions, dtype=torch.float32)).detach().numpy()
    assert grid.dense == 2
    for position, features in zip(positions.astype(np.float32), found, strict=True):
        np.testing.assert_allclose(features, features_twin(grid, position), atol=2e-5)


def test_corner_weights_sum_to_one(grid):
    """Trilinear interpolation keeps a constant."""
    _, weights = grid.corners(torch.rand(200, 3, generator=torch.Generator().manual_seed(1)))
    assert float(weights.min()) >= 0.0
    np.testing.assert_allclose(weights.sum(-1).numpy(), 1.0, atol=1e-5)


def test_gradients_are_finite_differences(grid):
    """Of a random linear function of the features: to every touched table entry, and to the positions."""
    positions = torch.rand(5, 3, generator=torch.Generator().manual_seed(5)).requires_grad_(True)
    mix = torch.rand(5, grid.width, generator=torch.Generator().manual_seed(6), dtype=torch.float32)
    grid.zero_grad()
    (grid(positions) * mix).sum().backward()
    slope = grid.table.grad.clone()

    def value(where):
        return sum(
            float(m @ features_twin(grid, p)) for m, p in zip(mix.double().numpy(), where.double().numpy(), strict=True)
        )

    touched = slope.abs().sum(1).nonzero()[:, 0]
    assert 100 < len(touched) <= 5 * 4 * 8
    base = value(positions.detach())
    for row in touched[::7]:
        for column in range(2):
            with torch.no_grad():
                grid.table[row, column] += 0.5
                change = value(positions.detach()) - base
                grid.table[row, column] -= 0.5
            assert float(slope[row, column]) == pytest.approx(2.0 * change, abs=1e-4)
    for k, axis in itertools.product(range(5), range(3)):
        step = torch.zeros(5, 3, dtype=torch.float64)
        step[k, axis] = 1e-5
        here = positions.detach().double()
        difference = (value(here + step) - value(here - step)) / 2e-5
        assert float(positions.grad[k, axis]) == pytest.approx(difference, rel=1e-3, abs=2e-3)
