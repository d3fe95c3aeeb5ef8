"""A ray walking over the height field meets what a ray cast at all of its triangles meets."""

import numpy as np

from wakewise.vision.imaging.bed_view import grid_faces, height_field, meet

RNG = np.random.default_rng(4)
LINES = np.cumsum(np.concatenate([[-0.7], RNG.uniform(0.02, 0.09, 30)]))
HEIGHTS = RNG.uniform(-0.05, 0.05, (31, 31)).astype(np.float32)
FIELD = height_field(LINES, HEIGHTS)


def vertices():
    x, y = np.meshgrid(LINES, LINES, indexing="ij")
    return np.stack([x.ravel(), y.ravel(), HEIGHTS.astype(float).ravel()], axis=1)


def walk(origin, way, most=1e4):
    arrays = (FIELD.lines_m, FIELD.per_cell, FIELD.cell_at, FIELD.z_m, FIELD.tops_m, 1.0 / FIELD.bin_m, *FIELD.range_m)
    return meet(*arrays, *(float(c) for c in origin), *(float(c) for c in way), most)


def cast(origin, way):
    """Nearest triangle by Moeller and Trumbore, over all: distance, infinite for none or if it is met from below."""
    a, b, c = (vertices()[grid_faces(31)[:, k]] for k in range(3))
    e1, e2 = b - a, c - a
    p = np.cross(way, e2)
    det = np.sum(e1 * p, axis=1)
    s = origin - a
    u = np.sum(s * p, axis=1) / det
    q = np.cross(s, e1)
    v, t = q @ way / det, np.sum(e2 * q, axis=1) / det
    t = np.where((u >= 0.0) & (v >= 0.0) & (u + v <= 1.0) & (t > 0.0), t, np.inf)
    return t.min() if det[np.argmin(t)] > 0.0 else np.inf


def test_walking_agrees_with_casting_at_every_triangle():
    """Rays from above, steep and grazing, from inside and outside of the field, meet it at the same distance."""
    rng, hits, misses = np.random.default_rng(0), 0, 0
    for k in range(600):
        origin = np.array([*rng.uniform(-0.8, 0.8, 2), rng.uniform(-0.4, -0.04)])
        way = rng.normal(size=3) * [1.0, 1.0, 0.05 if k % 2 else 1.0]
        way[2] = abs(way[2]) if k % 3 else way[2]
        expected, found = cast(origin, way), walk(origin, way)[0]
        if np.isinf(expected) or np.isinf(found):
            assert np.isinf(expected) == np.isinf(found)
            misses += 1
        else:
            assert abs(found - expected) < 1e-9 * (1.0 + expected)
            hits += 1
    assert min(hits, misses) > 100


def test_the_place_is_on_the_ray_and_on_the_surface():
    """Cell and place in it are those of the point at the distance found, and the height there is the ray's."""
    rng, checked = np.random.default_rng(1), 0
    for _ in range(200):
        origin, way = np.array([*rng.uniform(-0.5, 0.5, 2), -0.3]), np.array([*rng.normal(size=2), 1.0])
        t, i, j, u, v = walk(origin, way)
        if np.isinf(t):
            continue
        point = origin + t * way
        assert np.allclose(point[0], LINES[i] + u * (LINES[i + 1] - LINES[i]), atol=1e-9)
        assert np.allclose(point[1], LINES[j] + v * (LINES[j + 1] - LINES[j]), atol=1e-9)
        third = HEIGHTS[i + 1, j] if u >= v else HEIGHTS[i, j + 1]
        weights = 1.0 - max(u, v), abs(u - v), min(u, v)
        height = np.dot(weights, np.array([HEIGHTS[i, j], third, HEIGHTS[i + 1, j + 1]], dtype=float))
        assert abs(point[2] - height) < 1e-9
        checked += 1
    assert checked > 50


def test_rays_along_the_axes_and_upward():
    """Straight down meets the height below; along an axis works; upward, from below and too far meet nothing."""
    i, j = 12, 20
    x, y = LINES[i], LINES[j]
    assert abs(walk((x, y, -1.0), (0.0, 0.0, 1.0))[0] - (1.0 + HEIGHTS[i, j])) < 1e-9
    assert np.isinf(walk((x, y, -1.0), (0.0, 0.0, -1.0))[0])
    assert np.isinf(walk((x, y, 0.3), (0.0, 0.0, -1.0))[0])
    assert np.isinf(walk((x, y, -1.0), (0.0, 0.0, 1.0), 0.5)[0])
    assert np.isinf(walk((9.0, y, -1.0), (0.0, 0.0, 1.0))[0])
    for way in ((1.0, 0.0, 0.1), (0.0, -1.0, 0.1)):
        assert abs(walk((x + 1e-3, y + 1e-3, -0.06), way)[0] - cast(np.array([x + 1e-3, y + 1e-3, -0.06]), way)) < 1e-9


def test_faces_of_the_grid_face_up():
    """Every triangle's normal leads to z < 0, and together they cover the square."""
    a, b, c = (vertices()[grid_faces(31)[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    assert (normals[:, 2] < 0.0).all()
    assert np.isclose(-0.5 * normals[:, 2].sum(), (LINES[-1] - LINES[0]) ** 2)
