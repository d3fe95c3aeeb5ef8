"""The film of a flight that finds its target: regions over pictures, and no more frames than a report can hold."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from wakewise.core.geometry import Pose
from wakewise.core.interfaces import TargetEstimate
from wakewise.operation.finding import found_film
from wakewise.operation.finding.found_film import STATUS_BGR, FilmFrames, with_region
from wakewise.perception import CalibratedCamera

CAMERA = CalibratedCamera(width=160, height=120, fx=120.0, fy=120.0, cx=79.5, cy=59.5)
HERE = Pose(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))
PICTURE = np.full((120, 160), 90, np.uint8)


def target(status: str, centre_W_m: tuple[float, float, float] = (0.0, 0.0, 1.0)) -> TargetEstimate:
    """A target of two points on its surface and one in the water, along the camera's axis."""
    centre = np.array(centre_W_m)
    return TargetEstimate(
        time_s=0.0,
        status=status,
        centre_W_m=centre,
        covariance=np.eye(3),
        radius_m=0.1,
        points_W_m=centre + np.array([[0.2, 0.0, 0.0], [-0.2, 0.0, 0.0], [0.0, 0.3, 0.0]]),
        weights=np.ones(3),
        distance_m=np.array([0.0, 0.0, 0.05]),
    )


@pytest.mark.parametrize("status", STATUS_BGR)
def test_surface_and_middle_are_drawn_where_they_are_seen_in_the_colour_of_the_status(status: str) -> None:
    """Points of the surface and the middle are, those of the water are not; the rest of the picture is as it was."""
    image = with_region(PICTURE, CAMERA, HERE, target(status))
    changed = np.any(image != 90, axis=2)
    np.testing.assert_allclose(image[60, 80], STATUS_BGR[status], atol=3)
    for u in (79.5 + 24.0, 79.5 - 24.0):
        assert changed[56:64, round(u) - 4 : round(u) + 5].any()
    assert not changed[90:102].any()
    assert changed.mean() < 0.05


def test_without_a_target_or_pose_and_behind_the_camera_the_picture_stays() -> None:
    """What cannot be seen is not drawn, and does not end the flight."""
    for X_WC, there in ((HERE, None), (None, target("tracked")), (HERE, target("lost", (0.0, 0.0, -1.0)))):
        np.testing.assert_array_equal(
            with_region(PICTURE, CAMERA, X_WC, there), np.repeat(PICTURE[..., None], 3, axis=2)
        )


def test_a_film_of_any_length_has_a_bounded_number_of_frames_evenly_spread(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """A flight of 100 pictures with at most 6 frames: no more, the first is the first, and steps are the same."""
    monkeypatch.setattr(found_film, "MOST_FRAMES", 6)
    film = FilmFrames()
    for k in range(100):
        film.add(np.full((120, 160), 2 * k, np.uint8), CAMERA, HERE, None, 0.2 * k)
    path = tmp_path / "found.webp"
    film.write(path)
    ok, shown = cv2.imreadanimation(str(path))
    levels = [float(np.median(frame[:30, :, :3])) for frame in shown.frames]
    assert ok
    assert 3 <= len(levels) <= 6
    assert levels[0] < 3.0
    assert np.ptp(np.diff(levels)) <= 6.0
    film.clear()
    film.write(tmp_path / "none.webp")
    assert not (tmp_path / "none.webp").exists()
