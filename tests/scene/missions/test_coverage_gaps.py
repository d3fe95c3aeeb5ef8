"""Why parts were not seen: the reasons add up, and each is given where it holds."""

import math

import numpy as np
import pytest
import trimesh

from wakewise.core.geometry import Pose
from wakewise.scene.missions import Coverage, find_coverage_gaps, patches_of
from wakewise.scene.missions.orbit import camera_pose
from wakewise.scene.targets import Mesh
from wakewise.vision.imaging import PinholeCamera

CAMERA = PinholeCamera(1280, 960, math.radians(80.0))
CENTRE = np.array([0.0, 0.0, 1.0])
SPHERE = trimesh.creation.icosphere(subdivisions=4, radius=0.1)
PATCHES = patches_of(Mesh(SPHERE.vertices + CENTRE, SPHERE.faces), count=200, per_patch=5)


def at(azimuth_deg: float, range_m: float = 0.5) -> Pose:
    return camera_pose(CENTRE, math.radians(azimuth_deg), 0.3, range_m)


def after(*poses: Pose) -> Coverage:
    coverage = Coverage.begin(PATCHES)
    for X_WC in poses:
        coverage = coverage.seen(X_WC, CAMERA)
    return coverage


@pytest.mark.parametrize("poses", [(), (at(0),), (at(0), at(12), at(24)), (at(0), at(120), at(240)), (at(0, 2.0),)])
def test_reasons_and_coverage_are_the_whole(poses: tuple[Pose, ...]) -> None:
    """What is seen well, in no photograph, shown poorly and shown too seldom are together the surface."""
    coverage = after(*poses)
    why = find_coverage_gaps(coverage, poses, CAMERA)
    assert coverage.share + why.unseen + why.poorly + why.seldom == pytest.approx(1.0)


def test_each_reason_is_given_where_it_holds() -> None:
    """Before the first photograph nothing is seen; from afar all is poor; one good photograph is too few."""
    assert find_coverage_gaps(after(), (), CAMERA).unseen == 1.0
    far = find_coverage_gaps(after(at(0, 2.0)), (at(0, 2.0),), CAMERA)
    assert (far.seldom, far.poorly > 0.3) == (0.0, True)
    once = find_coverage_gaps(after(at(0)), (at(0),), CAMERA)
    assert once.seldom > 0.15
    assert once.poorly < once.seldom
