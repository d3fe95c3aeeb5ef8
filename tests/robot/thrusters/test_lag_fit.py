"""Identification of lag: known lags are found, and the measured step of a real thruster is repeated."""

import math
import os
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import TransferFunction, step

from wakewise.core.errors import InputError
from wakewise.robot.thrusters.lag_fit import LagFit, _lagged, identify_lag, read_step
from wakewise.robot.thrusters.rotor_lag import FirstOrderLag, LagModel, RotorLag, SecondOrderLag, SplitLag

DATA = Path(os.environ.get("WAKEWISE_DATA", Path(__file__).parents[4] / "shared" / "data"))
DT_S = 0.005
TIME = np.arange(0.0, 3.0, DT_S)
COMMAND = np.where(TIME >= 1.0, 12.0, 0.0)
BENCH_COMMAND_S, BENCH_RAMP_S = 3.449, 1.2
"""When the bench's command begins and how long its ramp takes, by the authors' own analysis script
(fminsearch_thruster_model_2.m of NGS-Exploration-Technology/ROV-Thruster-Model); the data file has no command."""
BENCH_END_S = 12.0
"""The command stops at about 12.6 s."""


def record(model: LagModel, *, delay_s: float, noise_N: float = 0.1) -> np.ndarray:
    late = round(delay_s / DT_S)
    delayed = np.concatenate([np.full(late, COMMAND[0]), COMMAND[: TIME.size - late]])
    return 0.3 + 0.9 * model.response(delayed, DT_S) + np.random.default_rng(5).normal(0.0, noise_N, TIME.size)


@pytest.mark.parametrize(
    ("model", "tolerance"),
    [
        (FirstOrderLag(time_constant_s=0.15), 4.0),
        (RotorLag(time_constant_s=0.15), 4.0),
        (SecondOrderLag(natural_rad_s=12.0, damping_ratio=0.5), 4.0),
        (SplitLag(time_constant_s=0.3, direct_share=1.5), 4.0),
    ],
    ids=lambda value: getattr(value, "name", ""),
)
def test_a_known_lag_is_recognised_with_its_parameters(model: LagModel, tolerance: float) -> None:
    """Every parameter lies within four of its standard errors, and the kind of lag is the one that made the data."""
    fit = identify_lag(TIME, COMMAND, record(model, delay_s=0.06))
    assert type(fit.model) is type(model)
    truth = {"offset_N": 0.3, "gain": 0.9, "delay_s": 0.06, **vars(model)}
    for estimate in fit.estimates:
        assert estimate.standard_error is not None
        assert abs(estimate.value - truth[estimate.name]) < tolerance * estimate.standard_error + 1e-3 * abs(
            truth[estimate.name]
        )
        assert estimate.standard_error < 0.15 * abs(truth[estimate.name])
    assert fit.r2 > 0.99
    assert math.isclose(fit.residual_rms_N, 0.1, rel_tol=0.15)


def test_white_noise_needs_no_averaging_and_a_line_does() -> None:
    """A 40 Hz ripple is found and averaged over its period, which raises R2 to what the lag deserves."""
    plain = record(FirstOrderLag(time_constant_s=0.2), delay_s=0.05)
    assert identify_lag(TIME, COMMAND, plain).average_s == 0.0
    shaken = plain + 5.0 * np.sin(2.0 * math.pi * 40.0 * TIME)
    fit = identify_lag(TIME, COMMAND, shaken)
    assert math.isclose(fit.average_s, 0.025, abs_tol=DT_S)
    assert fit.r2 > 0.99
    assert fit.r2_raw < 0.75
    assert fit.r2_raw <= fit.r2_ceiling + 0.01


def test_the_prediction_is_what_was_fitted() -> None:
    thrust = record(RotorLag(time_constant_s=0.1), delay_s=0.03)
    fit = identify_lag(TIME, COMMAND, thrust, average_s=0.0)
    error = thrust - fit.offset_N - fit.gain * _lagged(fit.model, fit.delay_s, COMMAND, DT_S)
    spread = np.sum((thrust - thrust.mean()) ** 2)
    assert math.isclose(1.0 - float(np.sum(error**2) / spread), fit.r2, abs_tol=1e-9)
    assert fit.r2 == fit.r2_raw
    assert fit.r2_ceiling == 1.0


def test_long_uneven_and_reversed_records_are_fitted_too() -> None:
    """24,000 samples, jittered times and a negative response give the same time constant."""
    model = FirstOrderLag(time_constant_s=0.2)
    time = np.linspace(0.0, 6.0, 24_000)
    command = (time >= 2.0).astype(float)
    noise = np.random.default_rng(2).normal(0.0, 0.2, time.size)
    thrust = -5.0 * model.response(command, float(time[1])) + noise
    jitter = np.random.default_rng(1).uniform(0.0, 3e-5, time.size)
    for times in (time, time + jitter):
        fit = identify_lag(times, command, thrust)
        value = next(e.value for e in fit.estimates if e.name == "time_constant_s")
        assert math.isclose(value, 0.2, rel_tol=0.01)
        assert math.isclose(fit.gain, -5.0, rel_tol=0.01)


def test_the_published_rotor_has_its_mean_delay_by_area() -> None:
    """Von Benzon's rotor: 28.7 ms from its coefficients and by area; least squares follows its fast part, 15-22 ms.

    The transfer function's slow pole (-13.2 / s) carries 29 % of the step as a tail of 76 ms: three quarters of the
    mean delay, but little of the squared error.
    """
    numerator, denominator = [6136.0, 108700.0], [1.0, 89.0, 9258.0, 108700.0]
    delay_s = denominator[-2] / denominator[-1] - numerator[-2] / numerator[-1]
    dt_s = 2e-4
    time = np.arange(0.0, 1.2, dt_s)
    after = time[time >= 0.2]
    response = step(TransferFunction(numerator, denominator), T=after - after[0])[1]
    thrust = np.concatenate([np.zeros(time.size - after.size), response])
    fit = identify_lag(time, (time >= 0.2).astype(float), thrust, average_s=0.0)
    assert fit.measured_delay_s is not None
    assert math.isclose(delay_s, 0.0287, abs_tol=5e-5)
    assert math.isclose(fit.measured_delay_s, delay_s, abs_tol=dt_s)
    assert 0.015 < fit.mean_delay_s < 0.022
    assert fit.r2 > 0.99


def bench() -> tuple[np.ndarray, np.ndarray]:
    """The +2 V step of a real thruster: time and axial force at 1 kHz, idle to the end of steady running."""
    path = DATA / "thruster_steps" / "2statep2V.csv"
    if not path.is_file():
        pytest.skip(f"{path.name} is not here; set WAKEWISE_DATA")
    table = np.loadtxt(path, delimiter=",", usecols=(1, 15))
    time, thrust = table[:, 0], -table[:, 1]
    kept = time <= BENCH_END_S
    return time[kept], thrust[kept]


def test_the_measured_step_is_repeated_with_r2_above_095() -> None:
    """Fitted lag and real +2 V step: R2 > 0.95 over 3.4 s idle, rise and 7 s steady, averaged over 36 ms.

    36 ms is one passing of the propeller's three blades at 59 rad/s, found from the data. Raw, the force carries 1 N
    rms of that ripple, so no steady model exceeds 0.79: the fit reaches 0.77.
    """
    time, thrust = bench()
    fit = identify_lag(time, (time >= BENCH_COMMAND_S).astype(float), thrust)
    assert fit.r2 > 0.95
    assert fit.window_s == (0.0, BENCH_END_S)
    assert math.isclose(fit.average_s, 2.0 * math.pi / 59.3 / 3.0, rel_tol=0.05)
    assert 0.76 < fit.r2_raw < fit.r2_ceiling < 0.80
    assert isinstance(fit.model, SecondOrderLag)
    assert all(candidate.r2 > 0.95 for candidate in fit.candidates)


def test_held_against_the_ramp_that_was_sent_the_bench_thruster_leads() -> None:
    """The bench's controller ramps for 1.2 s. Against that ramp the force does not lag but overshoots, R2 > 0.95.

    So the lag fitted to the step is mostly the controller's; the water's part is an overshoot of a direct share above
    1 that sinks within half a second. Thrust goes as the square of the voltage above the dead voltage.
    """
    time, thrust = bench()
    ramp = np.clip((time - BENCH_COMMAND_S) / BENCH_RAMP_S, 0.0, 1.0) ** 2
    fit = identify_lag(time, ramp, thrust)
    assert fit.r2 > 0.95
    assert isinstance(fit.model, SplitLag)
    assert fit.model.direct_share > 1.3
    assert fit.mean_delay_s < 0.0
    assert next(e for e in fit.estimates if e.name == "delay_s").standard_error is None


def test_standard_errors_know_that_ripple_is_correlated() -> None:
    """Repeating every sample ten times adds no knowledge: standard errors stay as they were, within a third."""
    thrust = record(FirstOrderLag(time_constant_s=0.2), delay_s=0.05, noise_N=0.5)
    fine = np.linspace(0.0, float(TIME[-1]), 10 * TIME.size)
    once = identify_lag(TIME, COMMAND, thrust, average_s=0.0)
    often = identify_lag(fine, np.interp(fine, TIME, COMMAND), np.interp(fine, TIME, thrust), average_s=0.0)
    assert math.isclose(error_of(often, "gain"), error_of(once, "gain"), rel_tol=0.33)


def error_of(fit: LagFit, name: str) -> float:
    error = next(estimate.standard_error for estimate in fit.estimates if estimate.name == name)
    assert error is not None
    return error


@pytest.mark.parametrize(
    ("time", "command", "thrust", "said"),
    [
        (TIME[:10], COMMAND[:10], COMMAND[:10], "10 samples, at least 20"),
        (TIME, COMMAND[:-1], COMMAND, "command: shape"),
        (TIME[::-1], COMMAND, COMMAND, "time_s must increase, sample 2"),
        (TIME, np.ones(TIME.size), COMMAND, "command is 1 throughout"),
        (TIME, COMMAND, np.zeros(TIME.size), "thrust_N is 0 throughout"),
        (TIME, COMMAND, np.full(TIME.size, math.nan), "thrust_N: holds NaN"),
    ],
)
def test_records_that_hold_no_step_are_refused(
    time: np.ndarray, command: np.ndarray, thrust: np.ndarray, said: str
) -> None:
    with pytest.raises(InputError, match=said):
        identify_lag(time, command, thrust)


def test_an_average_longer_than_the_record_allows_is_refused() -> None:
    for wrong in (-1.0, 1.0, math.nan):
        with pytest.raises(InputError, match="average_s = "):
            identify_lag(TIME, COMMAND, record(MODEL, delay_s=0.0), average_s=wrong)


MODEL = FirstOrderLag(time_constant_s=0.1)


def test_a_file_of_a_step_is_read_and_its_faults_are_named(tmp_path: Path) -> None:
    path = tmp_path / "step.csv"
    path.write_text("thrust_N,time_s,extra,command\n1,0,x,0\n2,0.1,y,1\n")
    time, command, thrust = read_step(path)
    assert (time.tolist(), command.tolist(), thrust.tolist()) == ([0.0, 0.1], [0.0, 1.0], [1.0, 2.0])
    for text, said in (
        ("", "no column time_s, command, thrust_N"),
        ("time_s,command\n0,1\n", "no column thrust_N"),
        ("time_s,command,thrust_N\n", "no rows"),
        ("time_s,command,thrust_N\n0,1,2\n0.1,1\n", "line 3"),
        ("time_s,command,thrust_N\n0,1,nan\n", "line 2"),
        ("time_s,command,thrust_N\n0,1,x\n", "line 2"),
    ):
        path.write_text(text)
        with pytest.raises(InputError, match=said):
            read_step(path)
    with pytest.raises(InputError, match="no such file"):
        read_step(tmp_path / "none.csv")
