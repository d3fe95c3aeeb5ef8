"""The current from the load: exact where it is the only pull, honest about what else pulls."""

import numpy as np
import pytest

from wakewise.core.geometry import matrix_from_quat, quat_from_euler
from wakewise.estimation.current_from_drag import KNOWN_M_S, current_from_force, current_if_known, level_drag
from wakewise.robot.vehicles import acceleration, compile_body, load_vehicle, with_each_drag

TIGHT = 1e-4 * np.eye(3)


@pytest.mark.parametrize("name", ["paper", "bluerov2-heavy"])
@pytest.mark.parametrize("current", [(0.03, 0.02), (-0.2, 0.1), (0.0, -0.5), (1e-3, 0.0)])
def test_the_drag_of_a_current_gives_the_current_back(name, current):
    """Forward by the vehicle's drag, back by Newton: to a thousandth of a mm/s, pitched and turned as it may be."""
    packed, q = compile_body(load_vehicle(name)).packed, quat_from_euler(0.05, -0.6, 2.0)
    found = current_from_force(packed, q, *level_drag(packed, q, *current))
    assert found[:2] == pytest.approx(current, abs=1e-6)


def test_level_drag_is_what_the_vehicle_would_set_off_with():
    """The compiled force is the mass matrix times what a current adds to the acceleration of a vehicle at rest."""
    body, q, current = compile_body(load_vehicle("paper")), quat_from_euler(0.1, 0.3, -1.0), np.array([0.1, -0.05, 0.0])
    still, moved = (acceleration(body, q, np.zeros(6), np.zeros(6), c) for c in (np.zeros(3), current))
    force_B = (body.mass_matrix @ (moved - still))[:3]
    assert level_drag(body.packed, q, 0.1, -0.05) == pytest.approx((matrix_from_quat(q) @ force_B)[:2], rel=1e-9)


def test_no_force_is_no_current():
    """Zero in, zero out, and the slope of creeping flow."""
    found = current_from_force(compile_body(load_vehicle("paper")).packed, np.array([1.0, 0, 0, 0]), 0.0, 0.0)
    assert np.isfinite(found).all() and not found[:2].any() and found[2] > 0.0 and found[5] > 0.0


def test_trim_says_nothing_of_the_current():
    """A pull straight down leaves the level current as it is and claims none that sinks."""
    packed, q = compile_body(load_vehicle("paper")).packed, np.array([1.0, 0, 0, 0])
    level = level_drag(packed, q, 0.05, 0.0)
    found = [current_if_known([packed], q, np.array([*level, trim]), TIGHT, 0.2) for trim in (0.0, 5.0)]
    np.testing.assert_array_equal(found[0][0], found[1][0])
    assert found[0][0][2] == 0.0


def test_an_uncertain_load_tells_no_current():
    """Known only to 1 N, it is None; and what is told is claimed no better than drag is known."""
    packed, q = compile_body(load_vehicle("paper")).packed, np.array([1.0, 0, 0, 0])
    force = np.array([*level_drag(packed, q, 0.1, 0.0), 0.0])
    assert current_if_known([packed], q, force, np.eye(3), 0.2) is None
    current, covariance = current_if_known([packed], q, force, TIGHT, 0.2)
    assert np.sqrt(covariance[0, 0]) > 0.2 * current[0]
    assert np.sqrt(covariance[1, 1]) < KNOWN_M_S


def test_a_force_that_is_no_number_tells_no_current():
    """NaN is refused, not handed on."""
    packed, q = compile_body(load_vehicle("paper")).packed, np.array([1.0, 0, 0, 0])
    assert current_if_known([packed], q, np.array([np.nan, 0.0, 0.0]), TIGHT, 0.2) is None


@pytest.mark.parametrize("name", ["paper", "bluerov2-heavy"])
def test_whichever_published_drag_is_the_true_one_the_current_is_within_what_is_told(name):
    """From 1 to 12 cm/s, from ahead and abeam: within 2.5 standard deviations; by the believed drag alone up to 5."""
    sets = [compile_body(vehicle).packed for vehicle in with_each_drag(load_vehicle(name))]
    q, off, alone = np.array([1.0, 0.0, 0.0, 0.0]), [], []
    for true in sets:
        for current in np.array([[1.0, 0.0], [0.0, 1.0]])[:, None] * np.array([0.01, 0.03, 0.06, 0.12])[None, :, None]:
            for c in current:
                force = np.array([*level_drag(true, q, *c), 0.0])
                for told, many in ((off, sets), (alone, sets[:1])):
                    found, spread = current_if_known(many, q, force, 0.01 * TIGHT, 0.2)
                    e = found[:2] - c
                    told.append(float(np.sqrt(e @ np.linalg.solve(spread[:2, :2], e))))
    assert len(sets) > 2 and max(off) < 2.5 < max(alone)


def test_the_current_told_is_that_of_a_readable_twin():
    """Principal axes by LAPACK, one force after the other through Newton, mean and covariance by NumPy."""
    sets = np.stack([compile_body(vehicle).packed for vehicle in with_each_drag(load_vehicle("paper"))])
    q, root = quat_from_euler(0.05, -0.2, 2.0), 0.02 * np.random.default_rng(0).normal(size=(3, 3))
    force, around = np.array([*level_drag(sets[0], q, 0.1, -0.06), 0.3]), root @ root.T
    values, axes = np.linalg.eigh(around[:2, :2])
    reach = (axes * np.sqrt(2.0 * values)).T
    forces = force[:2] + np.concatenate([reach, -reach])
    told = np.array([current_from_force(packed, q, *f)[:2] for packed in sets for f in forces])
    level = told.mean(axis=0)
    spread = (told - level).T @ (told - level) / len(told) + 0.2**2 * np.outer(level, level)
    current, covariance = current_if_known(sets, q, force, around, 0.2)
    np.testing.assert_allclose(current, [*level, 0.0], rtol=1e-9)
    np.testing.assert_allclose(covariance[:2, :2], spread, rtol=1e-9)
    assert not covariance[2].any()
    assert not covariance[:, 2].any()
