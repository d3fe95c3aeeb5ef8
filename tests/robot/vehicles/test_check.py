"""What the geometry allows, against closed forms and a slow twin of the linear program."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from wakewise.core.errors import StageError
from wakewise.robot.vehicles import (
    Vehicle,
    VehicleDraft,
    achievable_wrench,
    actuation,
    allocation_rank,
    draft_names,
    failure_rank,
    failures,
    load_draft,
    load_vehicle,
    null_space_names,
)
from wakewise.robot.vehicles.check import effective_null_space, free_wrench, null_space_words

FOUR_AND_FOUR = ["bluerov2-heavy", "bluerov2-heavy-gazebo", "bluerov2-heavy-wu", "paper"]
SIX = ["bluerov2", "bluerov2-abir", "bluerov2-gazebo", "paper-six-thrusters"]


@pytest.fixture(scope="module", params=FOUR_AND_FOUR)
def vehicle(request: pytest.FixtureRequest) -> Vehicle:
    return load_vehicle(request.param)


@pytest.fixture(scope="module", params=draft_names())
def draft(request: pytest.FixtureRequest) -> VehicleDraft:
    return load_draft(request.param)


def test_eight_thrusters_lose_none_of_six_axes_when_one_fails(vehicle: Vehicle) -> None:
    assert allocation_rank(vehicle) == 6
    assert failure_rank(vehicle) == [6] * 8
    assert actuation(vehicle).startswith("over-actuated by 2")


@pytest.mark.parametrize("name", SIX)
def test_six_thrusters_are_called_under_actuated(name: str) -> None:
    """Each has rank 5 and loses one more when a vertical fails, for these come in one pair."""
    six = load_vehicle(name)
    assert allocation_rank(six) == 5
    assert failure_rank(six) == [5, 5, 5, 5, 4, 4]
    assert actuation(six).startswith("under-actuated: 6 thrusters cannot make")


def test_two_verticals_off_leave_heave_and_yaw_pure() -> None:
    """The horizontals sit below the origin, so surge pitches and sway rolls, and nothing can hold that."""
    assert actuation(load_vehicle("paper-six-thrusters")).endswith("cannot make surge, sway, roll, pitch alone")
    assert actuation(load_vehicle("bluerov2")).endswith("cannot make pitch alone")


def test_an_angle_rounded_to_three_digits_is_no_direction_of_thrust() -> None:
    """Axes tilted by 2e-4, as files that write 1.571 for a right angle have, do not count as a sixth direction."""
    six = load_vehicle("bluerov2")
    tilted = replace(
        six, thrusters=tuple(replace(t, axis_B=t.axis_B + np.array([0, 0, 2e-4 * t.p_BT_m[0]])) for t in six.thrusters)
    )
    assert np.linalg.matrix_rank(tilted.allocation_matrix, tol=1e-9) == 6
    assert allocation_rank(tilted) == 5
    assert np.allclose(effective_null_space(tilted)[:, 0], six.null_space[:, 0], atol=1e-3)
    assert np.allclose(achievable_wrench(tilted), achievable_wrench(six), rtol=1e-2, atol=1e-2)


def test_the_null_space_has_names_in_words(vehicle: Vehicle) -> None:
    assert null_space_names(vehicle) == ["horizontal squeeze", "vertical twist"]
    assert null_space_words(vehicle) == [
        "thrusters 1, 2, 3, 4 forward make no wrench",
        "thrusters 5, 8 forward against 6, 7 in reverse make no wrench",
    ]


def test_other_layouts_have_names_too() -> None:
    assert null_space_names(load_draft("orca")) == ["horizontal squeeze", "vertical twist"]
    assert null_space_names(load_draft("rexrov")) == ["horizontal squeeze", "mixed squeeze"]
    assert null_space_names(load_draft("bluerov2")) == ["horizontal squeeze"]


def test_fights_of_one_kind_are_told_apart_by_their_thrusters() -> None:
    """Two pairs of thrusters, each on one line, are two opposed pairs."""
    paper = load_draft("paper")
    ends = [([0.2, y, 0.0], [x, 0.0, 0.0]) for y in (-0.1, 0.1) for x in (1.0, -1.0)]
    pairs = replace(
        paper,
        thrusters=tuple(
            replace(paper.thrusters[0], name=str(i), p_BT_m=np.array(p), axis_B=np.array(a))
            for i, (p, a) in enumerate(ends)
        ),
    )
    names = null_space_names(pairs)
    assert names == ["horizontal opposed pair of 1, 2", "horizontal opposed pair of 3, 4"]


def test_a_matrix_without_places_has_fights(draft: VehicleDraft) -> None:
    """Where a file holds only a matrix, the null space is known and its form is not."""
    bare = replace(draft, thrusters=(), shipped_matrix=draft.allocation_matrix)
    assert allocation_rank(bare) == allocation_rank(draft)
    assert all("fight" in name for name in null_space_names(bare))


def test_the_achievable_wrench_has_its_closed_forms(vehicle: Vehicle) -> None:
    """Heave is limited by all four verticals; surge and yaw by the weaker of each opposed pair."""
    wrench = achievable_wrench(vehicle)
    forward, reverse = float(vehicle.thrust_upper_N[0]), float(-vehicle.thrust_lower_N[0])
    assert np.allclose(wrench[2], [-4.0 * reverse, 4.0 * forward], rtol=1e-9)
    # A null-space squeeze shifts all four horizontals alike, so both signs share the whole range of thrust.
    surge = 4.0 * np.sqrt(0.5) * 0.5 * (forward + reverse)
    assert np.allclose(wrench[0], [-surge, surge], rtol=1e-9)
    lever = 0.5 * float(vehicle.allocation_matrix[5, 0] - vehicle.allocation_matrix[5, 2])
    assert np.allclose(wrench[5], [-2.0 * lever * (forward + reverse), 2.0 * lever * (forward + reverse)], rtol=1e-9)


@pytest.mark.parametrize("name", ["rexrov", "orca", "bluerov2-heavy"])
def test_the_achievable_wrench_is_that_of_its_slow_twin(name: str) -> None:
    """The best corner of {scale, null-space thrusts} within the limits, found by trying all corners."""
    draft = load_draft(name)
    limits = draft.thrust_limits_N
    assert limits is not None
    matrix, found = draft.allocation_matrix, achievable_wrench(draft)
    for axis in range(6):
        # Thrust = columns @ (scale, z1, z2); every corner has three thrusters at a limit.
        columns = np.column_stack([np.linalg.pinv(matrix)[:, axis], draft.null_space])
        corners = []
        for rows in combinations(range(8), 3):
            if abs(np.linalg.det(columns[list(rows)])) < 1e-12:
                continue
            for pick in np.ndindex(2, 2, 2):
                at = np.linalg.solve(columns[list(rows)], [limits[p][r] for p, r in zip(pick, rows, strict=True)])
                thrust = columns @ at
                if np.all(thrust >= limits[0] - 1e-7) and np.all(thrust <= limits[1] + 1e-7):
                    corners.append(at[0])
        assert np.allclose(found[axis], [min(corners), max(corners)], rtol=1e-7)


def test_a_free_axis_reaches_at_least_as_far_as_a_pure_one(draft: VehicleDraft) -> None:
    limits = draft.thrust_limits_N
    assert limits is not None
    pure, free = achievable_wrench(draft), free_wrench(draft.allocation_matrix, *limits)
    assert np.all(free[:, 0] <= pure[:, 0] + 1e-6)
    assert np.all(free[:, 1] >= pure[:, 1] - 1e-6)


def test_a_failure_never_adds_anything(draft: VehicleDraft) -> None:
    for failure in failures(draft):
        assert failure.left_pct is not None
        left = failure.left_pct[~np.isnan(failure.left_pct)]
        assert np.all((left > -1e-6) & (left < 100.0 + 1e-6))


def test_a_lost_vertical_halves_heave_and_takes_nothing_sideways(vehicle: Vehicle) -> None:
    failure = failures(vehicle)[4]
    assert failure.lost == ()
    assert failure.left_pct is not None
    assert np.allclose(failure.left_pct[2], 50.0)
    assert np.allclose(failure.left_pct[5], 100.0)


def test_a_lost_vertical_of_two_takes_heave_and_roll() -> None:
    failure = failures(load_vehicle("bluerov2"))[5]
    assert (failure.rank, failure.lost) == (4, ("heave", "roll"))


def test_without_limits_there_is_no_achievable_wrench() -> None:
    orca = load_draft("orca")
    unlimited = replace(orca, thrusters=tuple(replace(t, max_forward_N=None) for t in orca.thrusters))
    with pytest.raises(StageError, match="limits are not stated"):
        achievable_wrench(unlimited)
    assert failures(unlimited)[0].left_pct is None
