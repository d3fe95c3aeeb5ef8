"""Colours are fixed in the world: noise agrees with a readable twin, and the baked bed with the noise."""

import math

import numpy as np

from wakewise.vision.imaging import texture


def hash_twin(i, j, k, seed):
    """32-bit hash of a lattice point, with Python's own integers."""
    h = (i * 374761393 + j * 668265263 + k * 2147483629 + seed * 974634777) % 2**32
    h ^= h >> 16
    h = h * 0x85EBCA6B % 2**32
    h ^= h >> 13
    h = h * 0xC2B2AE35 % 2**32
    h ^= h >> 16
    return h / 2**32


def noise_twin(point, seed):
    """Value noise: hashed corners of the lattice cell, blended by smoothstep weights."""
    corner = np.floor(point).astype(int)
    s = point - corner
    s = s * s * (3 - 2 * s)
    total = 0.0
    for di, dj, dk in np.ndindex(2, 2, 2):
        d = np.array([di, dj, dk])
        total += np.prod(np.where(d == 1, s, 1 - s)) * hash_twin(*(int(c) for c in corner + d), seed)
    return total


def test_noise_agrees_with_its_twin():
    """The fast value noise equals the readable one, for negative coordinates too."""
    rng = np.random.default_rng(0)
    for point in rng.uniform(-900, 900, (200, 3)):
        assert math.isclose(texture.value_noise(*point, 77), noise_twin(point, 77), abs_tol=1e-9)


def test_noise_is_continuous_and_centred():
    """Noise crosses cell faces without a step, stays in [0, 1] and has mean 1/2."""
    assert abs(texture.value_noise(3 - 1e-9, 0.3, 0.4, 1) - texture.value_noise(3 + 1e-9, 0.3, 0.4, 1)) < 1e-7
    values = np.array([texture.value_noise(*p, 5) for p in np.random.default_rng(1).uniform(-500, 500, (5000, 3))])
    assert values.min() >= 0.0
    assert values.max() <= 1.0
    assert abs(values.mean() - 0.5) < 0.01


def test_detail_fades_with_the_footprint():
    """Octaves below the footprint vanish, so contrast falls with distance, to nothing when no cell is resolved."""
    points = np.random.default_rng(2).uniform(-1, 1, (2000, 3))
    spread = [
        np.std([texture.octaves(*p, 0.012, 0.0015, 1.0, footprint, 3) for p in points])
        for footprint in (0.0001, 0.002, 0.008, 0.02)
    ]
    assert spread[0] > spread[1] > spread[2] > spread[3] == 0.0


def test_baked_bed_agrees_with_its_noise():
    """At a texel's centre the baked map gives the albedo of that texel's footprint, within the 16-bit step."""
    maps = texture.bake_bed(64, 2, 0.001, 9)
    for i, j in ((3, 40), (31, 31), (60, 7)):
        x, y = (i + 0.5 - 32) * 0.001, (j + 0.5 - 32) * 0.001
        assert np.allclose(
            texture.baked_albedo(maps, 0.001, x, y, 0.0005), texture.sand_albedo(x, y, 0.001, 9), atol=2e-5
        )
    # Beyond the finest map's edge the next one answers.
    x, y = (60 + 0.5 - 32) * 0.002, (33 + 0.5 - 32) * 0.002
    assert np.allclose(texture.baked_albedo(maps, 0.001, x, y, 0.0005), texture.sand_albedo(x, y, 0.002, 9), atol=2e-5)


def bed_twin(maps, texel_m, x, y, footprint_m):
    """Bilinear in each of two levels that the footprint lies between, by numpy's interpolation; rest by log2."""
    size = maps.shape[1]

    def level(k):
        places = (np.arange(size) + 0.5 - 0.5 * size) * texel_m * 2.0**k
        along_y = [[np.interp(y, places, maps[k, i, :, c] / 65535.0) for i in range(size)] for c in range(3)]
        return np.array([np.interp(x, places, column) for column in along_y])

    low = int(np.clip(np.floor(np.log2(max(footprint_m / texel_m, 1.0))), 0, len(maps) - 2))
    rest = min(max(np.log2(max(footprint_m / texel_m, 1.0)) - low, 0.0), 1.0)
    return level(low) + rest * (level(low + 1) - level(low))


def test_looking_up_the_bed_agrees_with_its_twin():
    """Anywhere on the finest map the colour is that of the readable interpolation, but for 0.01 of a level."""
    maps = texture.bake_bed(64, 3, 0.001, 9)
    rng = np.random.default_rng(6)
    for x, y in rng.uniform(-0.03, 0.03, (60, 2)):
        footprint = 0.001 * 2.0 ** rng.uniform(-1.0, 3.0)
        found = texture.baked_albedo(maps, 0.001, x, y, footprint)
        assert np.allclose(found, bed_twin(maps, 0.001, x, y, footprint), atol=2e-3)


def test_logarithm_from_the_bits():
    """Whole number and rest add up to log2 within 0.01, exactly at powers of two."""
    for x in (1.0, 1.3, 1.99, 2.0, 3.0, 4.0, 1000.0, 4096.0):
        whole, rest = texture.whole_log2(x)
        assert whole == math.floor(math.log2(x))
        assert abs(whole + rest - math.log2(x)) <= (0.0 if math.log2(x).is_integer() else 0.01)


def test_albedos_are_reflectances():
    """Coral, stone and sand reflect between 0 and 1 in every band, and differ from place to place."""
    points = np.random.default_rng(3).uniform(-0.3, 0.3, (500, 3))
    for albedo in (texture.coral_albedo, texture.stone_albedo):
        colours = np.array([albedo(*p, 0.0005, 4) for p in points])
        assert colours.min() > 0.0
        assert colours.max() < 1.0
        assert np.std(colours[:, 0]) > 0.02
    sand = np.array([texture.sand_albedo(p[0], p[1], 0.0005, 4) for p in points])
    assert 0.0 < sand.min() < sand.max() < 1.0


def test_bed_is_level_at_the_foot():
    """The relief is within 1 mm under the target and grows outward to no more than 25 mm."""
    rng = np.random.default_rng(5)
    near = texture.bed_heights(rng.uniform(-0.05, 0.05, (500, 2)), 0.08, 6)
    far = texture.bed_heights(rng.uniform(0.6, 1.5, (500, 2)), 0.08, 6)
    assert np.abs(near).max() <= 0.001
    assert 0.003 < np.abs(far).max() <= 0.025
