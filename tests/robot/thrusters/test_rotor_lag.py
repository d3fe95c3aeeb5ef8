"""Lag models: their steps are exact, agree with their series, and settle where they are told."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm

from wakewise.core.errors import InputError
from wakewise.robot.thrusters import thruster_lag
from wakewise.robot.thrusters.rotor_lag import FirstOrderLag, LagModel, RotorLag, SecondOrderLag, SplitLag

MODELS: list[LagModel] = [
    FirstOrderLag(time_constant_s=0.07),
    RotorLag(time_constant_s=0.07),
    SecondOrderLag(natural_rad_s=20.0, damping_ratio=0.4),
    SecondOrderLag(natural_rad_s=20.0, damping_ratio=1.0),
    SecondOrderLag(natural_rad_s=20.0, damping_ratio=3.0),
    SplitLag(time_constant_s=0.1, direct_share=1.6),
]
every = pytest.mark.parametrize("model", MODELS, ids=lambda m: f"{m.name} {getattr(m, 'damping_ratio', '')}")
COMMANDS = np.array([3.0, -8.0, 0.0])


@every
def test_two_half_steps_are_one_step(model: LagModel) -> None:
    start = model.rest([1.0, 2.0, -3.0])
    once = model.step(start, COMMANDS, 0.08)
    twice = model.step(model.step(start, COMMANDS, 0.03), COMMANDS, 0.05)
    assert np.allclose(once, twice, rtol=1e-10, atol=1e-12)


@every
def test_at_rest_nothing_moves_and_after_long_it_rests(model: LagModel) -> None:
    assert np.allclose(model.thrust(model.step(model.rest(COMMANDS), COMMANDS, 0.02)), COMMANDS, atol=1e-12)
    late = model.step(model.rest([5.0, 5.0, 5.0]), COMMANDS, 60.0)
    assert np.allclose(model.thrust(late), COMMANDS, atol=1e-9)


@every
def test_a_series_is_the_step_repeated(model: LagModel) -> None:
    """The fast response equals the slow loop, sample by sample."""
    commands = np.random.default_rng(3).normal(0.0, 5.0, 200)
    state, loop = model.rest(commands[:1]), []
    for command in commands:
        loop.append(float(model.thrust(state)[0]))
        state = model.step(state, np.array([command]), 0.013)
    assert np.allclose(model.response(commands, 0.013), loop, rtol=1e-9, atol=1e-9)


@every
def test_the_mean_delay_is_the_area_above_the_step_response(model: LagModel) -> None:
    dt_s = 1e-4
    commands = np.concatenate([[0.0], np.ones(40_000)])
    area_s = dt_s * float(np.sum(1.0 - model.response(commands, dt_s)[2:])) + 0.5 * dt_s
    assert math.isclose(area_s, model.mean_delay_s, abs_tol=2e-4)


def test_the_first_order_step_is_the_plants_own() -> None:
    start = np.array([5.0, -3.0, 1.0])
    stepped = FirstOrderLag(time_constant_s=0.1).step(start[None, :], COMMANDS, 0.03)[0]
    assert np.allclose(stepped, thruster_lag(start, COMMANDS, np.full(3, 0.1), 0.03), rtol=1e-14)


@given(st.floats(0.1, 200.0), st.floats(0.05, 20.0), st.floats(1e-6, 2.0))
def test_the_second_order_transition_is_the_matrix_exponential(w: float, z: float, dt_s: float) -> None:
    system = np.array([[0.0, 1.0], [-w * w, -2.0 * z * w]])
    want = expm(system * dt_s)
    got = SecondOrderLag(natural_rad_s=w, damping_ratio=z).transition(dt_s)
    assert np.allclose(got, want, rtol=1e-6, atol=1e-7 * max(1.0, w * w))


def test_near_critical_damping_the_transition_is_smooth() -> None:
    below, at, above = (
        SecondOrderLag(natural_rad_s=9.0, damping_ratio=z).transition(0.1) for z in (1.0 - 1e-9, 1.0, 1.0 + 1e-9)
    )
    assert np.allclose(below, at, atol=1e-6)
    assert np.allclose(above, at, atol=1e-6)


def test_a_reversing_rotor_passes_through_zero_slowly() -> None:
    """Thrust as the square of speed starts flat: early on it is behind a first-order lag of the same constant."""
    rotor, first = RotorLag(time_constant_s=0.1), FirstOrderLag(time_constant_s=0.1)
    commands = np.concatenate([[0.0], np.ones(20)])
    assert np.all(rotor.response(commands, 0.01)[2:] < first.response(commands, 0.01)[2:])
    assert math.isclose(
        float(rotor.thrust(rotor.step(rotor.rest([-4.0]), [4.0], 0.1 * math.log(2.0)))[0]), 0.0, abs_tol=1e-12
    )


def test_lags_without_time_are_refused() -> None:
    for wrong in (0.0, -1.0, math.nan, math.inf):
        for build in (
            lambda v: FirstOrderLag(time_constant_s=v),
            lambda v: RotorLag(time_constant_s=v),
            lambda v: SecondOrderLag(natural_rad_s=v, damping_ratio=1.0),
            lambda v: SecondOrderLag(natural_rad_s=1.0, damping_ratio=v),
            lambda v: SplitLag(time_constant_s=1.0, direct_share=v),
        ):
            with pytest.raises(InputError, match="must be finite and more than 0"):
                build(wrong)
