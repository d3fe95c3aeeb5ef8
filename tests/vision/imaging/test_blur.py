"""Motion blur equals the mean of the frames that would have been seen."""

import numpy as np
import pytest
from imaging_helpers import box_scene, coral_scene, view

from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose, quat_from_rotvec
from wakewise.vision.imaging import LensCamera, Lights, PinholeCamera, Shutter, motion_blur, motion_px, pose_at, render

LIGHTS = Lights(lamp=0.0, lamps_C_m=np.zeros((0, 3)))
CAMERA = PinholeCamera(400, 300, 2 * np.arctan(200 / 480))  # the middle of a photograph 960 px wide at 90 deg


def moving(middle, shift_C_m, turn_C_rad, count=5):
    """Poses about `middle`, from minus half to plus half of a shift and a turn."""
    return [
        middle @ Pose(k * np.asarray(shift_C_m), quat_from_rotvec(k * np.asarray(turn_C_rad)))
        for k in np.linspace(-0.5, 0.5, count)
    ]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("shift", "turn"),
    [((0.006, 0.0, 0.0), (0, 0, 0)), ((0.0, 0.003, 0.01), (0, 0, 0)), ((0, 0, 0), (0.004, 0.01, 0.02))],
)
def test_blur_agrees_with_the_mean_of_true_renders(shift, turn):
    """Blurring the middle view takes away at least 4/5 of the error of leaving it sharp, at 5-12 px of motion."""
    scene, target = coral_scene()
    poses = moving(view(40, centre=target.centre_W_m), shift, turn)
    frames = 8
    truth = np.mean(
        [render(scene, CAMERA, pose_at(poses, (k + 0.5) / frames), LIGHTS).radiance for k in range(frames)], axis=0
    )
    middle = render(scene, CAMERA, pose_at(poses, 0.5), LIGHTS)
    blurred = motion_blur(middle.radiance, middle.depth_m, CAMERA, poses)
    inner = np.s_[12:-12, 12:-12]
    sharp_error = np.sqrt(np.mean((middle.radiance[inner] - truth[inner]) ** 2))
    blur_error = np.sqrt(np.mean((blurred[inner] - truth[inner]) ** 2))
    assert motion_px(CAMERA, poses, 0.45) > 2.0
    assert blur_error < 0.2 * sharp_error, (blur_error, sharp_error)


def test_a_hardly_moving_camera_is_not_softened():
    """At 0.6 px of motion the blurred image is nearer to the mean of true renders than the sharp one: no extra blur."""
    scene, target = coral_scene()
    poses = moving(view(40, centre=target.centre_W_m), (0.0006, 0.0, 0.0), (0, 0, 0))
    frames = [render(scene, CAMERA, pose_at(poses, (k + 0.5) / 6), LIGHTS).radiance for k in range(6)]
    truth = np.mean(frames, axis=0)
    middle = render(scene, CAMERA, pose_at(poses, 0.5), LIGHTS)
    blurred = motion_blur(middle.radiance, middle.depth_m, CAMERA, poses)
    inner = np.s_[12:-12, 12:-12]
    assert np.mean((blurred[inner] - truth[inner]) ** 2) < np.mean((middle.radiance[inner] - truth[inner]) ** 2)


def test_a_still_camera_does_not_blur():
    """Without motion the image comes back as it was."""
    X_WC = view()
    seen = render(box_scene(), CAMERA, X_WC, LIGHTS)
    assert motion_blur(seen.radiance, seen.depth_m, CAMERA, [X_WC] * 3) is seen.radiance
    assert motion_blur(seen.radiance, seen.depth_m, CAMERA, [X_WC]) is seen.radiance


def test_motion_of_a_sideways_step():
    """A sideways step d moves a point at depth z by f d / z pixels."""
    poses = moving(Pose(np.zeros(3)), (0.01, 0.0, 0.0), (0, 0, 0))
    assert motion_px(CAMERA, poses, 0.5) == pytest.approx(CAMERA.focal_px * 0.01 / 0.5, rel=1e-9)


def test_a_uniform_image_stays_uniform():
    """Blur moves light and makes none."""
    poses = moving(view(), (0.01, 0.01, 0.0), (0, 0.02, 0))
    image = np.full((300, 400, 3), 0.3, np.float32)
    depth = np.random.default_rng(0).uniform(0.3, 2.0, (300, 400)).astype(np.float32)
    depth[:50] = np.inf
    assert np.allclose(motion_blur(image, depth, CAMERA, poses), 0.3, atol=1e-6)


def keys(t):
    """Cubic convolution's weights of the neighbours at -1, 0, 1, 2 by Keys's own formula, a = -1/2."""
    distance = np.abs(t - np.arange(-1, 3))
    inner = 1.5 * distance**3 - 2.5 * distance**2 + 1.0
    return np.where(distance <= 1.0, inner, -0.5 * distance**3 + 2.5 * distance**2 - 4.0 * distance + 2.0)


def blurred_twin(image, depth, camera, poses, frames, x, y):
    """One pixel of the mean of frames, each looked up where the middle frame's own points went."""
    middle, h, w = pose_at(poses, 0.5), *depth.shape
    total = np.zeros(3)
    for k in range(frames):
        X_KM = pose_at(poses, (k + 0.5) / frames).inverse() @ middle
        here = np.array([x + 0.5, y + 0.5])
        q = here.copy()
        for _ in range(20):
            i, j = np.clip(q.astype(int), 0, [w - 1, h - 1])
            q += here - camera.project(X_KM.apply(camera.unproject(q[None], depth[j, i : i + 1])))[0]
        u, v = np.clip(q - 0.5, 0.0, [w - 1, h - 1])
        i, j = int(u), int(v)
        columns, rows = np.clip(np.arange(i - 1, i + 3), 0, w - 1), np.clip(np.arange(j - 1, j + 3), 0, h - 1)
        total += np.einsum("n,m,nmc->c", keys(v - j), keys(u - i), image[np.ix_(rows, columns)].astype(float))
    return np.maximum(total, 0.0) / frames


@pytest.mark.parametrize("camera", [CAMERA, LensCamera(400, 300, 0.8, (-0.1, 0.05, 0.0, 0.0))], ids=["ideal", "lens"])
@pytest.mark.parametrize("turn", [(0, 0, 0), (0.004, 0.01, 0.02)])
def test_blur_agrees_with_a_readable_twin(camera, turn):
    """Whole rows at once give what one pixel at a time gives, at depth edges, at the image's border and elsewhere."""
    rng = np.random.default_rng(8)
    image = rng.uniform(0.1, 0.9, (300, 400, 3)).astype(np.float32)
    depth = np.full((300, 400), 0.8, np.float32) + np.linspace(0, 0.1, 400, dtype=np.float32)
    depth[100:200, 150:250] = 0.5
    poses = moving(view(), (0.002, 0.001, 0.003), turn)
    motion = motion_px(camera, poses, float(np.quantile(depth[::8, ::8], 0.001)))
    frames = 2 * int(np.ceil(0.5 * (motion - 1.0))) + 1
    found = motion_blur(image, depth, camera, poses)
    inside = [(rng.integers(0, 400), rng.integers(0, 300)) for _ in range(60)]
    for x, y in [(0, 0), (399, 299), (1, 150), (398, 7), *inside]:
        if np.ptp(depth[max(0, y - 12) : y + 13, max(0, x - 12) : x + 13]) > 0.1:
            continue  # where a step in depth passes, whole fans of sources are as good as one another
        expected = blurred_twin(image, depth, camera, poses, frames, int(x), int(y))
        assert np.allclose(found[y, x], expected, atol=5e-3), (x, y)


def test_pose_at_ends_and_between():
    """The exposure's poses are met at their instants; between two of them the rotation is half of the turn."""
    poses = moving(view(), (0.02, 0, 0), (0, 0, 0.2), count=3)
    for k, fraction in enumerate((0.0, 0.5, 1.0)):
        assert np.allclose(pose_at(poses, fraction).p_m, poses[k].p_m)
        assert np.allclose(np.abs(pose_at(poses, fraction).q @ poses[k].q), 1.0)
    quarter = poses[0].inverse() @ pose_at(poses, 0.25)
    assert np.allclose(quarter.q, quat_from_rotvec([0, 0, 0.05]), atol=1e-9)
    with pytest.raises(InputError, match="exposure"):
        pose_at([], 0.5)


def by_rows(scene, poses, shutter, frames, rows, every):
    """Truth of a rolling shutter: some bands of rows are cut from renders at the poses of their own time."""
    truth = np.full((CAMERA.height, CAMERA.width, 3), np.nan)
    for top in range(0, CAMERA.height, rows * every):
        instants = [shutter.fraction((top + 0.5 * rows) / CAMERA.height, (k + 0.5) / frames) for k in range(frames)]
        seen = [render(scene, CAMERA, pose_at(poses, at), LIGHTS).radiance[top : top + rows] for at in instants]
        truth[top : top + rows] = np.mean(seen, axis=0)
    return truth


@pytest.mark.parametrize(
    ("shift", "turn", "shutter", "frames"),
    [
        ((0.008, 0.0, 0.0), (0, 0, 0), Shutter(open=0.01, rolling=0.99), 1),
        ((0.0, 0.008, 0.008), (0.004, 0.016, 0.02), Shutter(open=0.4, rolling=0.6), 6),
    ],
    ids=["skew alone", "skew and blur"],
)
def test_a_rolling_shutter_agrees_with_true_renders_of_its_rows(shift, turn, shutter, frames):
    """Rows warped to their own time are as they were rendered there, within a fifth of the error of one instant."""
    scene, target = coral_scene()
    poses = moving(view(40, centre=target.centre_W_m), shift, turn)
    truth = by_rows(scene, poses, shutter, frames, rows=20, every=2)
    middle = render(scene, CAMERA, pose_at(poses, 0.5), LIGHTS)
    rolled = motion_blur(middle.radiance, middle.depth_m, CAMERA, poses, shutter)
    # The middle of each band is where truth and rows are of the same instant.
    inner = np.array([y for y in range(12, 288) if y % 40 in (9, 10)])
    columns = np.s_[12:-12]
    sharp_error = np.sqrt(np.mean((middle.radiance[inner, columns] - truth[inner, columns]) ** 2))
    roll_error = np.sqrt(np.mean((rolled[inner, columns] - truth[inner, columns]) ** 2))
    assert roll_error < 0.2 * sharp_error, (roll_error, sharp_error)


def test_a_sideways_step_skews_the_picture():
    """A post under a rolling shutter leans by the motion between its rows; the middle row stays where it was."""
    image = np.zeros((300, 400, 3), np.float32)
    image[:, 180:220] = 1.0
    depth = np.full((300, 400), 0.5, np.float32)
    poses = moving(view(), (0.01, 0.0, 0.0), (0, 0, 0))
    rolled = motion_blur(image, depth, CAMERA, poses, Shutter(open=1e-3, rolling=0.999))[..., 0]
    place = rolled @ (np.arange(400) + 0.5) / rolled.sum(axis=1)
    lean = np.polyfit(np.arange(300) + 0.5 - 150.0, place - 200.0, 1)
    motion = CAMERA.focal_px * 0.01 / 0.5
    assert lean[0] * 300.0 == pytest.approx(-0.999 * motion, rel=0.01)
    assert lean[1] == pytest.approx(0.0, abs=0.05)


def test_a_rolling_shutter_of_no_readout_is_a_global_one():
    """Open for all of the time and rolling not at all, rows give what whole frames give."""
    scene, target = coral_scene()
    poses = moving(view(40, centre=target.centre_W_m), (0.006, 0.0, 0.0), (0, 0, 0.01))
    middle = render(scene, CAMERA, pose_at(poses, 0.5), LIGHTS)
    whole = motion_blur(middle.radiance, middle.depth_m, CAMERA, poses)
    rows = motion_blur(middle.radiance, middle.depth_m, CAMERA, poses, Shutter(open=1.0, rolling=1e-9))
    assert np.sqrt(np.mean((rows - whole) ** 2)) < 0.02 * float(np.std(middle.radiance))


def test_a_shutter_cannot_be_open_for_longer_than_there_are_poses():
    """Shares that are zero or add up to more than all are refused."""
    for wrong in ({"open": 0.0}, {"open": 0.7, "rolling": 0.4}, {"rolling": -0.1}):
        with pytest.raises(InputError, match="shutter"):
            Shutter(**wrong)
