"""Motion blur equals the mean of the frames that would have been seen."""

import numpy as np
import pytest
from imaging_helpers import box_scene, coral_scene, view

from wakewise.errors import InputError
from wakewise.geometry import Pose, quat_from_rotvec
from wakewise.imaging import Lights, PinholeCamera, motion_blur, motion_px, pose_at, render

LIGHTS = Lights(lamp=0.0, lamps_C_m=np.zeros((0, 3)))
CAMERA = PinholeCamera(400, 300, 2 * np.arctan(200 / 480))  # the middle of a photograph 960 px wide at 90 deg


def moving(middle, shift_C_m, turn_C_rad, count=5):
    """Poses about `middle`, from minus half to plus half of a shift and a turn."""
    return [
        middle @ Pose(k * np.asarray(shift_C_m), quat_from_rotvec(k * np.asarray(turn_C_rad)))
        for k in np.linspace(-0.5, 0.5, count)
    ]


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
