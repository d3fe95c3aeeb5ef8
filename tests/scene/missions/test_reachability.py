"""Views within reach: clear of everything, ways round the target, and what a person is told."""

import math

import numpy as np
import pytest
import trimesh

from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose
from wakewise.scene.missions import CameraAim, CandidateViews, TankBounds, patches_of, reachable_views
from wakewise.scene.missions.clearance import gaps_of
from wakewise.scene.missions.orbit import camera_pose
from wakewise.scene.missions.reachability import direction_words, place_of
from wakewise.scene.targets import Mesh
from wakewise.vision.imaging import PinholeCamera

CAMERA = PinholeCamera(640, 480, math.radians(80.0))
CENTRE = np.array([0.2, -0.1, 1.2])
AIM = CameraAim(X_BC=camera_pose(np.zeros(3), math.pi, 0.0, 0.2))
SIZE = np.array([0.4, 0.35, 0.25])
BOUNDS = TankBounds(low_W_m=np.array([-0.6, -2.5, 0.0]), high_W_m=np.array([3.0, 2.5, 1.5]))


def ball() -> Mesh:
    sphere = trimesh.creation.icosphere(subdivisions=3, radius=0.1)
    return Mesh(sphere.vertices + CENTRE, sphere.faces)


def reached(*ranges_m: float, clearance_m: float = 0.05) -> CandidateViews:
    return reachable_views(
        patches_of(ball(), count=50, per_patch=2),
        CAMERA,
        centre_W_m=CENTRE,
        ranges_m=ranges_m,
        aim=AIM,
        size_m=SIZE,
        bounds=BOUNDS,
        target_W_m=ball().vertices_m,
        clearance_m=clearance_m,
    )


def at(azimuth_deg: float, elevation_deg: float = 20.0, range_m: float = 0.5) -> Pose:
    return camera_pose(CENTRE, math.radians(azimuth_deg), math.radians(elevation_deg), range_m)


def test_every_view_keeps_clear() -> None:
    """At each view the hull is as far from everything as is asked; some views of the sphere are out of reach."""
    views = reached(0.5, 0.8)
    assert 20 < len(views.places) < 240
    for number in range(len(views.places)):
        X_WB = views.pose(number) @ AIM.X_BC.inverse()
        assert min(gaps_of(X_WB, SIZE, BOUNDS, ball().vertices_m).values()) >= 0.05
    assert len(reached(0.5, 0.8, clearance_m=0.3).places) < len(views.places)


def test_where_nothing_can_be_reached_there_are_no_views() -> None:
    """A sphere that the hull cannot be on leaves no view, and that is no fault."""
    assert len(reached(0.11).places) == 0


def test_a_range_that_is_none_is_refused() -> None:
    """Ranges are above zero."""
    with pytest.raises(InputError, match="ranges"):
        reached(0.0)


def test_ways_go_round_and_are_never_shorter_than_straight() -> None:
    """A way is at least the straight line, nothing to where one is, and half round it is half a circle."""
    views = reached(0.8)
    here = views.pose(7)
    ways = views.ways_m(here.p_m)
    straight = np.linalg.norm(views.points_W_m() - here.p_m, axis=1)
    assert ways[7] == pytest.approx(0.0, abs=1e-6)
    assert (ways >= straight - 1e-9).all()
    assert ways.max() <= 0.8 * math.pi + 1e-9
    assert views.points_W_m()[7] == pytest.approx(here.p_m)


def test_a_place_is_told_back() -> None:
    """Azimuth, elevation and range of a camera's place are those that it was made from."""
    assert place_of(at(130, 35, 0.7).p_m, CENTRE) == pytest.approx([math.radians(130), math.radians(35), 0.7])


@pytest.mark.parametrize(
    ("to", "words"),
    [
        (at(20), "go left 0.2 m"),
        (at(-40), "go right 0.3 m"),
        (at(0, 20, 0.3), "go down 0.07 m, closer 0.2 m"),
        (at(0, 50), "go up 0.2 m, look down 30 deg"),
        (at(0), "take a photograph from here"),
        (at(350, 20, 0.8), "go right 0.1 m, up 0.1 m, back 0.3 m"),
    ],
)
def test_words_are_those_of_someone_who_looks_at_the_target(to: Pose, words: str) -> None:
    """Left and right are the viewer's; up, down, closer, back and the camera's pitch are said where they matter."""
    assert direction_words(at(0), to, CENTRE) == words


def test_left_is_left_in_the_picture() -> None:
    """Who goes where the words say left has moved along the picture's own left."""
    here, there = at(0), at(20)
    assert "left" in direction_words(here, there, CENTRE)
    assert (there.p_m - here.p_m) @ here.R[:, 0] < 0.0
