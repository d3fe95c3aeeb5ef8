"""Clearance: what a hull may come near."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose, quat_from_matrix
from wakewise.scene.missions import MissionSettings, TankBounds, check_clearance, plan_route
from wakewise.scene.missions.clearance import box_distance
from wakewise.scene.missions.orbit import R_FC

BOUNDS = TankBounds(low_W_m=np.array([-3.0, -2.5, 0.0]), high_W_m=np.array([3.0, 2.5, 1.5]))
TARGET = np.random.default_rng(0).uniform([-0.07, -0.07, 1.35], [0.07, 0.07, 1.5], (500, 3))
CENTRE = np.array([0.0, 0.0, 1.43])
X_BC = Pose(np.array([0.225, 0.0, 0.0]), quat_from_matrix(R_FC))
SIZE = np.array([0.45, 0.35, 0.28])


def least(mission: MissionSettings, bounds: TankBounds = BOUNDS) -> float:
    return check_clearance(plan_route(CENTRE, mission), X_BC, SIZE, bounds, TARGET, mission.clearance_m)


def test_the_default_orbits_are_clear() -> None:
    """The default mission round a 15 cm target keeps its clearance in the default tank."""
    assert least(MissionSettings()) >= MissionSettings().clearance_m


@pytest.mark.parametrize(
    ("changes", "field", "what"),
    [
        ({"elevations_deg": (3.0,), "views": (8,)}, "mission.elevations_deg", "the floor"),
        ({"standoff_m": 0.11, "elevations_deg": (60.0,), "views": (8,)}, "mission.standoff_m", "the target"),
        ({"standoff_m": 1.5, "elevations_deg": (60.0,), "views": (8,)}, "mission.standoff_m", "the water surface"),
        (
            {"standoff_m": 2.2, "elevations_deg": (20.0,), "views": (8,), "approach_m": 0.0},
            "mission.standoff_m",
            "a wall",
        ),
    ],
)
def test_a_route_that_would_touch_is_refused(changes: dict[str, object], field: str, what: str) -> None:
    """The message names the field to change and what would be touched, in one line."""
    with pytest.raises(InputError, match=field) as caught:
        least(MissionSettings.model_validate(changes))
    assert what in str(caught.value)
    assert "\n" not in str(caught.value)


@given(st.tuples(*[st.floats(-1.0, 1.0)] * 3))
def test_box_distance_is_that_of_the_nearest_point_of_the_box(point: tuple[float, float, float]) -> None:
    """Outside, the distance is that to the point clamped into the box; inside it is minus the way to a face."""
    p = np.array(point)
    d = box_distance(p[None], SIZE)[0]
    inside = bool(np.all(np.abs(p) <= SIZE / 2))
    expected = -np.min(SIZE / 2 - np.abs(p)) if inside else np.linalg.norm(p - np.clip(p, -SIZE / 2, SIZE / 2))
    assert d == pytest.approx(expected, abs=1e-12)
