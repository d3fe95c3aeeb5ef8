"""Rendered geometry is the projection of the mesh, and the fast shading is a readable formula."""

import numba
import numpy as np
import pytest
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from imaging_helpers import BED_Z, box, box_scene, coral_scene, view

from wakewise.core.errors import InputError
from wakewise.vision.imaging import FlatPort, LensCamera, Lights, PinholeCamera, render, texture
from wakewise.vision.imaging.renderer import needs_supersampling

LIGHTS = Lights(lamps_C_m=np.array([[-0.2, -0.1, 0.0], [0.2, -0.1, 0.0]]))
CAMERA = PinholeCamera(480, 360, np.deg2rad(90))


LENS = LensCamera(480, 360, np.deg2rad(90), (-0.11, 0.10, 0.0014, 0.0005))
PORT = LensCamera(480, 360, np.deg2rad(75), port=FlatPort(air_m=0.02))


@pytest.mark.parametrize("camera", [CAMERA, LENS, PORT])
def test_depth_is_the_distance_to_the_plane(camera):
    """On the box's flat top the depth is that of the plane along each pixel's centre ray, within 0.02 mm."""
    X_WC = view(60)
    seen = render(box_scene(), camera, X_WC, LIGHTS)
    pixels = np.stack(np.meshgrid(np.arange(480) + 0.5, np.arange(360) + 0.5), axis=-1).reshape(-1, 2)
    near, far = (X_WC.apply(camera.unproject(pixels, np.full(len(pixels), d))) for d in (1.0, 2.0))
    depth = 1.0 + (BED_Z - 0.08 - near[:, 2]) / (far - near)[:, 2]
    hit = near + (depth - 1.0)[:, None] * (far - near)
    on_top = (depth > 0) & (np.abs(hit[:, 0]) < 0.0595) & (np.abs(hit[:, 1]) < 0.0495)
    assert on_top.sum() > 1000
    assert np.abs(seen.depth_m.ravel()[on_top] - depth[on_top]).max() < 2e-5


def test_edges_are_where_the_vertices_project():
    """The box's upper outline, to a fraction of a pixel from its cover, is the hull of its projected vertices."""
    from scipy.spatial import ConvexHull

    errors = []
    for elevation, azimuth in ((20, 10), (40, 75), (60, 200)):
        X_WC = view(elevation, azimuth)
        seen = render(box_scene(), CAMERA, X_WC, LIGHTS, samples=8)
        corners = CAMERA.project(X_WC.inverse().apply(box().mesh.vertices_m))
        hull = corners[ConvexHull(corners).vertices]
        for column in range(int(corners[:, 0].min()) + 2, int(corners[:, 0].max()) - 2):
            top = _mean_crossing(hull, column)
            rows = seen.target_fraction[:, column]
            inside = int(np.argmax(rows > 0.999))
            if top is not None:
                errors.append(inside - rows[:inside].sum() - top)
    assert len(errors) > 150
    assert abs(np.mean(errors)) < 0.01
    assert np.sqrt(np.mean(np.square(errors))) < 0.05


@pytest.mark.parametrize("camera", [LENS, PORT])
def test_edges_bend_as_the_lens_bends_them(camera):
    """Through distortion and through a port the box's upper outline is that of its projected edges, 0.05 px rms."""
    ends = [(a, b) for a in range(8) for b in range(a + 1, 8) if (a ^ b) in (1, 2, 4)]
    along = np.linspace(0.0, 1.0, 6001)[:, None]
    vertices = box().mesh.vertices_m
    edges_W = np.concatenate([vertices[a] + along * (vertices[b] - vertices[a]) for a, b in ends])
    errors = []
    for elevation, azimuth in ((25, 10), (45, 75)):
        X_WC = view(elevation, azimuth, 0.35)
        seen = render(box_scene(), camera, X_WC, LIGHTS, samples=8)
        pixels = camera.project(X_WC.inverse().apply(edges_W))
        corners = camera.project(X_WC.inverse().apply(vertices))[:, 0]
        for column in range(int(corners.min()) + 2, int(corners.max()) - 2):
            if np.abs(corners - column - 0.5).min() < 1.0:
                continue
            inside = pixels[(pixels[:, 0] >= column) & (pixels[:, 0] < column + 1)]
            slots = ((inside[:, 0] - column) * 8).astype(int)
            top = np.mean([inside[slots == k, 1].min() for k in range(8)])
            rows = seen.target_fraction[:, column]
            full = int(np.argmax(rows > 0.999))
            errors.append(full - rows[:full].sum() - top)
    assert len(errors) > 60
    assert np.sqrt(np.mean(np.square(errors))) < 0.05


def _mean_crossing(hull, column):
    """Mean height over a pixel column of the hull's upper edge (smallest y); None where a corner falls into it."""
    if ((hull[:, 0] > column - 0.5) & (hull[:, 0] < column + 1.5)).any():
        return None
    crossings = []
    for (x0, y0), (x1, y1) in zip(hull, np.roll(hull, -1, axis=0), strict=True):
        if min(x0, x1) < column + 0.5 < max(x0, x1):
            crossings.append(y0 + (column + 0.5 - x0) / (x1 - x0) * (y1 - y0))
    return min(crossings) if crossings else None


def test_vertices_of_a_coral_lie_on_the_depth_map():
    """Coral vertices that face the camera and are in sight agree with the depth at their pixel, median 0.1 mm."""
    scene, target = coral_scene()
    X_WC, camera = view(40, centre=target.centre_W_m), PinholeCamera(1920, 1440, np.deg2rad(90))
    seen = render(scene, camera, X_WC, LIGHTS, samples=1)
    points_C = X_WC.inverse().apply(target.mesh.vertices_m)
    pixels = camera.project(points_C)
    i = pixels.astype(int)
    offset = np.linalg.norm(pixels - i - 0.5, axis=1)
    error = seen.depth_m[i[:, 1], i[:, 0]] - points_C[:, 2]
    visible = (offset < 0.15) & (np.abs(error) < 0.002)
    assert visible.sum() > 200
    assert np.median(np.abs(error[visible])) < 1e-4


def test_a_point_has_one_colour_from_every_side():
    """The bed's pattern seen from opposite sides matches at the same points of the world."""
    lights = Lights(lamp=0.0, lamps_C_m=np.zeros((0, 3)))
    camera = PinholeCamera(960, 720, np.deg2rad(90))
    points_W = np.array([[x, y, BED_Z] for x in np.linspace(-0.1, 0.1, 15) for y in (-0.12, -0.1, 0.1, 0.12)])
    seen = []
    for azimuth in (0, 180):
        X_WC = view(70, azimuth, 0.4)
        image = render(box_scene(), camera, X_WC, lights).radiance[..., 1]
        i = np.round(camera.project(X_WC.inverse().apply(points_W)) - 0.5).astype(int)
        seen.append(np.array([image[y - 1 : y + 2, x - 1 : x + 2].mean() for x, y in i]))
    assert np.corrcoef(seen[0], seen[1])[0, 1] > 0.8


def test_shading_agrees_with_a_readable_twin():
    """With one sample a pixel, colours equal albedo times interpolated daylight, and times the lamps' irradiance."""
    scene, camera, X_WC = box_scene(), PinholeCamera(32, 24, np.deg2rad(60)), view(45)
    seen = render(scene, camera, X_WC, LIGHTS, samples=1)
    origin = X_WC.p_m - scene.foot_W_m
    triangles = scene.vertices_F_m[scene.faces].astype(float)
    checked = 0
    for row, column in np.ndindex(24, 32):
        if (row * 32 + column) % 13:
            continue
        ray = X_WC.R @ camera.rays(np.array([[column + 0.5, row + 0.5]]))[0]
        face, t, weights = _first_hit(triangles, origin, ray)
        point = origin + t * ray
        normal = weights @ scene.normals[scene.faces[face]]
        normal = normal / np.linalg.norm(normal)
        footprint = t / camera.focal_px
        kind = int(np.searchsorted(scene.first_face, face, side="right")) - 1
        facing = abs(normal @ ray) / np.linalg.norm(ray)
        if kind == 0:
            albedo = texture.coral_albedo(*point, footprint, scene.seed)
        elif kind == 1:
            slant = footprint / np.sqrt(facing)
            albedo = texture.baked_albedo(scene.bed_maps, texture.BED_TEXEL_M, point[0], point[1], slant)
        else:
            albedo = texture.stone_albedo(*point, footprint, scene.seed)
        day = weights @ scene.daylight[scene.faces[face], 0]
        lamp = 0.0
        for lamp_C in LIGHTS.lamps_C_m:
            to_lamp = X_WC.R @ lamp_C + origin - point
            r = np.sqrt(to_lamp @ to_lamp + 1e-4)
            on_surface, off_axis = normal @ to_lamp / r, -X_WC.R[:, 2] @ to_lamp / r
            lamp += 0.5 * LIGHTS.lamp * (0.5 / r) ** 2 * max(on_surface, 0.0) * max(off_axis, 0.0)
        assert seen.depth_m[row, column] == pytest.approx(t, rel=1e-4)
        assert np.allclose(seen.lamp_radiance[row, column], np.array(albedo) * lamp, rtol=0.02, atol=1e-4)
        assert np.allclose(seen.radiance[row, column], np.array(albedo) * (day + lamp), rtol=0.02, atol=1e-4)
        checked += 1
    assert checked > 40


def _first_hit(triangles, origin, ray):
    """Moeller-Trumbore over all triangles: face, distance in ray lengths, barycentric weights."""
    a, e1, e2 = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    p = np.cross(ray, e2)
    det = np.sum(e1 * p, axis=1)
    det = np.where(np.abs(det) < 1e-14, np.nan, det)
    s = origin - a
    u = np.sum(s * p, axis=1) / det
    q = np.cross(s, e1)
    v = q @ ray / det
    t = np.sum(e2 * q, axis=1) / det
    t = np.where((u >= -1e-9) & (v >= -1e-9) & (u + v <= 1 + 1e-9) & (t > 0), t, np.inf)
    face = int(np.argmin(t))
    return face, t[face], np.array([1 - u[face] - v[face], u[face], v[face]])


@pytest.mark.parametrize("camera", [CAMERA, LENS, PORT], ids=["ideal", "distorted", "port"])
def test_the_whole_view_is_what_ray_casting_sees(camera):
    """Target, stones and bed have the depth that rays cast at all triangles at once give, but for grazed edges."""
    scene, target = coral_scene()
    caster = EmbreeScene()
    TriangleMesh(caster, scene.vertices_F_m, scene.faces)
    X_WC = view(30, centre=target.centre_W_m)
    seen = render(scene, camera, X_WC, LIGHTS)
    pixels = np.stack(np.meshgrid(np.arange(480) + 0.5, np.arange(360) + 0.5), axis=-1).reshape(-1, 2)
    near, far = (X_WC.apply(camera.unproject(pixels, np.full(len(pixels), d))) for d in (0.05, 1.05))
    hits = caster.run((near - scene.foot_W_m).astype(np.float32), (far - near).astype(np.float32), output=True)
    depth = np.where(hits["geomID"] >= 0, 0.05 + hits["tfar"], 1e4).reshape(360, 480)
    found = np.minimum(seen.depth_m, 1e4)
    same = np.abs(depth - found) < 1e-5 * np.maximum(1.0, found**2)
    assert (~same).sum() < 20
    assert (depth < 1e4).mean() > 0.5
    on_target = (hits["primID"] < scene.first_face[1]).reshape(360, 480) & (depth < 1e4)
    assert (seen.target_fraction[on_target & same] > 0.0).mean() > 0.99


@pytest.mark.parametrize("elevation", [25, 65])
def test_samples_are_the_pixels_of_a_finer_image(elevation):
    """Where the target is in a pixel, its colour and share are the mean over 2 x 2 pixels of an image twice as fine."""
    scene, target = coral_scene()
    X_WC = view(elevation, 130, 0.3, centre=target.centre_W_m)
    coarse = render(scene, PinholeCamera(160, 120, np.deg2rad(70)), X_WC, LIGHTS, samples=2)
    fine = render(scene, PinholeCamera(320, 240, np.deg2rad(70)), X_WC, LIGHTS, samples=1)

    def halved(image):
        return image.reshape(120, 2, 160, 2, -1).mean(axis=(1, 3)).reshape(image[::2, ::2].shape)

    on_target = coarse.target_fraction > 0.0
    assert on_target.sum() > 500
    assert (coarse.target_fraction[on_target] < 1.0).sum() > 50
    same = np.abs(coarse.target_fraction - halved(fine.target_fraction)) < 1e-6
    assert same[on_target].mean() > 0.99
    for name in ("radiance", "lamp_radiance"):
        a, b = getattr(coarse, name), halved(getattr(fine, name))
        assert np.allclose(a[on_target & same], b[on_target & same], rtol=1e-3, atol=1e-4)


def test_needs_more_agrees_with_looking_at_each_neighbour():
    """On random kinds and depths, open water among them, the fast rule is the one that it states."""
    rng = np.random.default_rng(3)
    kind = rng.choice(np.array([-1, 0, 1, 1, 1, 1, 1, 1, 2], np.int8), (40, 50))
    kind[:20] = 1
    depth = rng.uniform(0.9, 0.95, (40, 50)).astype(np.float32)
    depth[kind < 0] = np.inf
    found = np.empty((40, 50), bool)
    needs_supersampling(kind, depth, 0, 40, found)
    for y, x in np.ndindex(40, 50):
        around = np.s_[max(0, y - 1) : y + 2, max(0, x - 1) : x + 2]
        own, d = kind[y, x], depth[y, x]
        edge = (kind[around] != own).any()
        step = own >= 0 and ((depth[around] < 0.96 * d) | (depth[around] > 1.04 * d)).any()
        assert found[y, x] == (own in (0, 2) or edge or step)
    assert 0.2 < found.mean() < 0.95


def test_where_one_ray_is_not_enough():
    """Resampled pixels are target, stones, and every pixel beside another kind or a step in depth; open bed is not."""
    kind = np.full((5, 7), 1, np.int32)
    depth = np.ones((5, 7), np.float32)
    kind[2, 1] = 0
    depth[:, 5:] = 2.0
    expected = np.zeros((5, 7), bool)
    expected[1:4, 0:3] = True
    expected[:, 4:6] = True
    found = np.ones((5, 7), bool)
    for first, last in ((0, 2), (2, 5)):  # bands look across their borders
        needs_supersampling(kind, depth, first, last, found)
    assert np.array_equal(found, expected)


def test_threads_do_not_change_a_byte():
    """One thread and all threads give the same image."""
    full = render(box_scene(), CAMERA, view(30), LIGHTS)
    threads = numba.get_num_threads()
    numba.set_num_threads(1)
    try:
        single = render(box_scene(), CAMERA, view(30), LIGHTS)
    finally:
        numba.set_num_threads(threads)
    for name in ("radiance", "lamp_radiance", "depth_m", "target_fraction"):
        assert getattr(full, name).tobytes() == getattr(single, name).tobytes()


def test_bad_numbers_are_refused():
    """No samples and negative lamps raise InputError."""
    with pytest.raises(InputError, match="samples"):
        render(box_scene(), CAMERA, view(), LIGHTS, samples=0)
    with pytest.raises(InputError, match="lights"):
        Lights(lamp=-1.0, lamps_C_m=np.zeros((1, 3)))
