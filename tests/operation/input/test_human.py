"""The person at the sticks: late, rough, minding few things at a time, and the same whenever drawn again."""

import numpy as np
import pytest

from wakewise.control.operator_model import CameraMotion, OperatorModel, StickDeflection, begin, sample_operator, steer
from wakewise.control.operator_population import OperatorPopulation
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose, quat_from_euler

DT_S = 0.02
STICKS = StickDeflection(
    inertia=np.array([10.0, 12.0, 0.0, 0.0]),
    drag=np.array([5.0, 6.0, 0.0, 0.0]),
    full=np.array([100.0, 100.0, 5.0, 2.6]),
    lag_s=np.full(4, 0.1),
)
TINY = (1e-9, 1e-9)
PLAIN = {
    "remnant": TINY,
    "image_step": TINY,
    "size_step": TINY,
    "rate_step_per_s": TINY,
    "azimuth_drift_deg": TINY,
    "standoff_drift": TINY,
    "level_drift": TINY,
    "heading_drift_deg": TINY,
    "trim_s": (1e9, 1e9),
    "stick_step": (1e-6, 1e-6),
    "pace": TINY,
    "attended": 4,
}
"""A person without limits but for the delays."""


def person(seed: int = 3, **changes) -> OperatorModel:
    return sample_operator(seed, STICKS, OperatorPopulation(**changes))


def view(place=(0.0, 0.0, 0.0), heading=0.0, velocity=(0.0, 0.0, 0.0), turn=0.0) -> CameraMotion:
    v = np.array(velocity)
    return CameraMotion(p_W_m=np.array(place), heading_rad=heading, v_W_m_s=v, turn_rad_s=turn, hull_W_m_s=v)


def pushes(who: OperatorModel, views, goal_views) -> np.ndarray:
    """What the sticks ask for, step by step, shape (n, 4)."""
    state, out = begin(who), []
    for seen, desired in zip(views, goal_views, strict=True):
        state, asked = steer(who, state, DT_S, seen, desired)
        out.append(asked)
    return np.array(out)


def first_answer_s(asked: np.ndarray) -> float:
    return DT_S * float(np.argmax(np.abs(asked).max(axis=1) > 1e-3))


@pytest.mark.parametrize("seed", range(5))
def test_a_step_in_the_goal_is_answered_no_sooner_than_the_delay(seed):
    """Nothing moves for the delay less the hand's lag; what the vehicle does is seen later still, by the video."""
    who = person(seed, **{**PLAIN, "pace": (1.0, 1.0)})
    still, away, n = view(), view((0.2, -0.1, 0.05), 0.3), 150
    by_goal = first_answer_s(pushes(who, [still] * n, [still] * 50 + [away] * (n - 50))) - 50 * DT_S
    by_view = first_answer_s(pushes(who, [still] * 50 + [away] * (n - 50), [still] * n)) - 50 * DT_S
    assert who.delay_s - 0.1 - DT_S <= by_goal <= who.delay_s + 0.1
    assert by_view - by_goal == pytest.approx(who.video_s, abs=1.5 * DT_S)


@pytest.mark.parametrize("axis", [0, 1, 2, 3])
def test_the_open_loop_falls_by_20_dB_a_decade_about_its_crossover(axis):
    """Person times vehicle is w_c / s with the delay, whether the stick asks for a force or for a rate."""
    who = person(4, **PLAIN)
    crossover = float(who.crossover_rad_s[axis])
    loop = []
    for omega in crossover * np.array([0.5, 1.0, 2.0]):
        period = round(2.0 * np.pi / omega / DT_S)
        t = DT_S * np.arange(4 * period)
        wave, slope = 0.01 * np.sin(omega * t), 0.01 * omega * np.cos(omega * t)
        unit = np.eye(3)[axis] if axis < 3 else np.zeros(3)
        goal_views = [
            view(unit * x, x if axis == 3 else 0.0, unit * v, v if axis == 3 else 0.0)
            for x, v in zip(wave, slope, strict=True)
        ]
        asked = pushes(who, [view()] * len(t), goal_views)[2 * period :, axis]
        answer = 2.0 * np.mean(asked * np.exp(-1j * omega * t[2 * period :])) / (0.01 / 1j)
        s = 1j * omega
        vehicle = 1.0 / (STICKS.inertia[axis] * s**2 + STICKS.drag[axis] * s) if axis < 2 else 1.0 / s
        loop.append(answer * vehicle)
    size_db, phase_deg = 20.0 * np.log10(np.abs(loop)), np.degrees(np.angle(loop))
    assert size_db[1] == pytest.approx(0.0, abs=1.0)
    assert (size_db[2] - size_db[0]) / np.log10(4.0) == pytest.approx(-20.0, abs=3.0)
    assert phase_deg[1] == pytest.approx(-90.0 - np.degrees(crossover * who.delay_s), abs=6.0)


def test_the_crossover_leaves_the_phase_that_is_kept_in_hand():
    """With all delays of the loop in it, the phase at the crossover is the margin drawn."""
    who = person(1, phase_margin_deg=(40.0, 40.0))
    late_s = who.delay_s + who.video_s + STICKS.lag_s
    np.testing.assert_allclose(np.degrees(0.5 * np.pi - who.crossover_rad_s * late_s), 40.0)


def test_a_vehicle_that_coasts_for_ever_is_steered_with_less_gain():
    """Inertia beyond the lead that can be made costs phase, so the crossover is lower, at the same margin."""
    sticks = StickDeflection(inertia=STICKS.inertia, drag=np.zeros(4), full=STICKS.full, lag_s=STICKS.lag_s)
    plain = {"phase_margin_deg": (30.0, 30.0), "lead_most_s": (4.0, 4.0)}
    who, coasting = person(1, **plain), sample_operator(1, sticks, OperatorPopulation(**plain))
    late_s, omega = coasting.delay_s + coasting.video_s + 0.1, coasting.crossover_rad_s[:2]
    assert np.all(omega < who.crossover_rad_s[:2]) and np.all(omega * 4.0 > 1.0)
    np.testing.assert_allclose(np.degrees(np.arctan(omega * 4.0) - omega * late_s), 30.0, atol=1e-6)
    np.testing.assert_allclose(coasting.crossover_rad_s[2:], who.crossover_rad_s[2:])


def test_two_draws_of_one_seed_are_one_person():
    """Person and pushes follow from the seed alone; another seed is someone else."""
    rng = np.random.default_rng(0)
    goal_views = [view(0.1 * rng.normal(size=3), 0.1) for _ in range(200)]
    flights = [pushes(person(seed), [view()] * 200, goal_views) for seed in (5, 5, 6)]
    np.testing.assert_array_equal(flights[0], flights[1])
    assert person(5).delay_s == person(5).delay_s != person(6).delay_s
    assert not np.array_equal(flights[0], flights[2])


def test_small_offsets_are_let_be():
    """What lies within the step that is let be moves no stick; what lies beyond does."""
    changes = {**PLAIN, "image_step": (0.02, 0.02), "size_step": (0.04, 0.04)}
    for offset, answered in (((0.035, 0.015, 0.015), False), ((0.06, 0.0, 0.0), True), ((0.0, 0.03, 0.0), True)):
        asked = pushes(person(2, **changes), [view()] * 200, [view(offset)] * 200)
        assert bool(np.any(np.abs(asked) > 1e-3)) is answered


def test_few_axes_are_minded_at_a_time():
    """With four axes off, no more than two are worked at once, and each gets its turn."""
    who = person(7, **{**PLAIN, "attended": 2})
    state, desired, minded = begin(who), view((0.3, 0.3, 0.3), 0.5), []
    for _ in range(600):
        state, _ = steer(who, state, DT_S, view(), desired)
        minded.append(state.minded)
    counts = np.sum(minded, axis=1)
    assert counts.max() == 2 and np.all(np.any(minded, axis=0))


def test_nudges_make_what_a_thumb_cannot_hold():
    """Pushes finer than a step of the thumb come out right in the mean."""
    fine = pushes(person(8, **PLAIN), [view()] * 1500, [view((0.05, 0.0, 0.0))] * 1500)
    rough = pushes(person(8, **{**PLAIN, "stick_step": (0.05, 0.05)}), [view()] * 1500, [view((0.05, 0.0, 0.0))] * 1500)
    step_N = 0.05 * person(8).gain * 100.0
    assert 0.0 < fine[500:, 0].mean() < step_N
    assert set(np.round(rough[500:, 0] / step_N, 6)) == {0.0, 1.0}
    assert rough[500:, 0].mean() == pytest.approx(fine[500:, 0].mean(), rel=0.1)


def test_noise_grows_with_what_is_seen():
    """Remnant is in proportion to the size of what is seen (Levison, Baron and Kleinman 1969)."""
    changes = {**PLAIN, "remnant": (0.01, 0.01)}
    spread = [
        pushes(person(9, **changes), [view()] * 2000, [view((size, 0.0, 0.0))] * 2000)[500:, 0].std()
        for size in (0.02, 0.04)
    ]
    assert spread[0] > 0.0 and spread[1] == pytest.approx(2.0 * spread[0], rel=1e-3)


def test_the_camera_is_kept_on_the_target():
    """Beside the desired place the desired heading is no longer the one that shows the target in the middle."""
    who, watch = person(3, **PLAIN), np.array([1.0, 0.0, 0.0])
    state = begin(who)
    for _ in range(100):
        state, asked = steer(who, state, DT_S, view((0.0, 0.3, 0.0)), view((0.0, 0.3, 0.0)), watch)
    assert asked[3] < 0.0  # the target is to the left


def test_a_view_is_where_the_camera_is():
    """Place, heading and motion are those of the camera, not of the hull that carries it."""
    X_WB = Pose(np.array([1.0, 2.0, 3.0]), quat_from_euler(0.0, 0.0, 0.5 * np.pi))
    X_BC = Pose.from_matrix(np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]), np.array([0.2, 0.0, 0.0]))
    seen = CameraMotion.of(X_WB, np.array([0.1, 0.0, 0.0, 0.0, 0.0, 0.5]), X_BC)
    np.testing.assert_allclose(seen.p_W_m, [1.0, 2.2, 3.0], atol=1e-12)
    np.testing.assert_allclose(seen.v_W_m_s, [-0.1, 0.1, 0.0], atol=1e-12)
    np.testing.assert_allclose(seen.hull_W_m_s, [0.0, 0.1, 0.0], atol=1e-12)
    assert seen.heading_rad == pytest.approx(0.5 * np.pi) and seen.turn_rad_s == pytest.approx(0.5)


@pytest.mark.parametrize(
    "wrong", [{"delay_s": (0.4, 0.2)}, {"gain": (0.0, 0.5)}, {"phase_margin_deg": (50.0, 95.0)}, {"attended": 5}]
)
def test_people_who_cannot_be_are_refused(wrong):
    """Ranges out of order, at zero, or without any phase left to steer with."""
    with pytest.raises(InputError, match=next(iter(wrong))):
        OperatorPopulation(**wrong)
