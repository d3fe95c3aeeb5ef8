"""Flight figures on flights whose figures are known in closed form."""

import numpy as np
import polars as pl
import pytest

from wakewise.core.errors import InputError
from wakewise.core.geometry import quat_from_euler, quat_from_rotvec, quat_multiply
from wakewise.vision.evaluation import SWAY_FIGURES, flight_figures
from wakewise.vision.evaluation.flight import (
    attitude_rmse_deg,
    path_distance,
    rising_edges,
    roll_pitch_errors_deg,
    sign_flips,
)


def table(n=400, dt=0.05, late_s=0.0, **extra):
    """A lap on a circle of 0.5 m, flown `late_s` behind the goal."""
    t = dt * np.arange(n)
    columns = {"time_s": t}
    for who, at in (("goal", t), ("true", t - late_s)):
        angle = 0.3 * at
        columns |= {f"{who}_x_m": 0.5 * np.cos(angle), f"{who}_y_m": 0.5 * np.sin(angle), f"{who}_z_m": 0 * t + 1.0}
        q = np.array([quat_from_euler(0.0, 0.0, a + np.pi / 2) for a in angle])
        columns |= {f"{who}_q{k}": q[:, i] for i, k in enumerate("wxyz")}
        columns |= {f"{who}_u_m_s": 0 * t + 0.15, f"{who}_v_m_s": 0 * t, f"{who}_w_m_s": 0 * t}
    return pl.DataFrame(columns | extra)


def test_what_the_controller_sees_and_what_it_cannot_know_are_told_apart():
    """An estimate 4 mm off one way and a vehicle held 3 mm off by it the other way."""
    steps = table()
    goal = steps.select(f"goal_{k}_m" for k in "xyz").to_numpy()
    est = pl.DataFrame({f"est_{k}_m": goal[:, i] + (0.003 if k == "z" else 0.0) for i, k in enumerate("xyz")})
    true = [pl.Series("true_z_m", goal[:, 2] + 0.007)]
    figures = flight_figures(pl.concat([steps, est], how="horizontal").with_columns(true))
    told = (figures["tracking_rmse_mm"], figures["estimate_rmse_mm"], figures["position_rmse_mm"])
    assert told == pytest.approx((3.0, 4.0, 7.0))
    assert flight_figures(steps)["tracking_rmse_mm"] is None


def test_being_late_is_no_path_error():
    """Lateness costs position error (chord of the arc) but no path error."""
    figures = flight_figures(table(late_s=0.2))
    assert figures["position_rmse_mm"] == pytest.approx(1e3 * 2 * 0.5 * np.sin(0.03), rel=1e-6)
    inner = path_distance(
        *(table(late_s=0.2).select(f"{w}_{k}_m" for k in "xyz").to_numpy()[10:] for w in ("true", "goal")),
        table()["time_s"].to_numpy()[10:],
    )
    assert 1e3 * inner[5:].max() < 0.05
    assert figures["velocity_deviation_pct"] == pytest.approx(100 * 2 * np.sin(0.03), rel=1e-6)


def test_next_lap_does_not_hide_this_one():
    """Only the path near in time counts: standing still at the start is an error later."""
    t = np.arange(0, 30, 0.1)
    goal = np.stack([np.sin(0.3 * t), np.cos(0.3 * t), 0 * t], axis=1)
    assert path_distance(np.tile(goal[:1], (len(t), 1)), goal, t)[100] > 0.5


def test_energy_and_means_are_integrals_over_time():
    """100 W for 20 s is 2 kJ; the exposure mean takes only exposing rows; missing values are left out."""
    n = 400
    speed = np.where(np.arange(n) < 200, 0.02, 0.04)
    steps = table(
        power_W=np.full(n, 100.0),
        target_speed_mean_m_s=speed,
        exposing=np.arange(n) >= 300,
        disturbance=np.where(np.arange(n) < 100, np.nan, 3.0),
        collision=np.isin(np.arange(n), [5, 6, 50]),
        fallback=["late" if i == 7 else "" for i in range(n)],
    )
    figures = flight_figures(steps)
    assert figures["energy_kJ"] == pytest.approx(2.0)
    assert figures["duration_s"] == pytest.approx(20.0)
    assert figures["target_speed_mean_m_s"] == pytest.approx(0.03)
    assert figures["exposure_speed_mean_m_s"] == pytest.approx(0.04)
    assert figures["disturbance"] == pytest.approx(3.0)
    assert (figures["collisions"], figures["fallbacks"]) == (2, 1)


def test_reversals_ignore_chatter_about_zero():
    """A thruster reverses when it pushes the other way, not when it flickers about nothing."""
    assert sign_flips(np.array([[1.0, 0.05, -0.05, 1.0, -1.0, 0.0, -1.0, 2.0]]).T) == 2
    assert rising_edges(np.array([True, True, False, True])) == 2
    t1 = np.tile([5.0, -5.0], 200)
    figures = flight_figures(table(thrust_1_N=t1, thrust_2_N=np.ones(400)))
    assert figures["sign_flips_per_s"] == pytest.approx(399 / 20)


def test_attitude_error_is_against_the_goal():
    """Three degrees of roll and four of pitch are the two errors; yaw does not count."""
    goal = np.array([quat_from_euler(0.0, 0.0, 0.5)])
    true = np.array([quat_from_euler(np.radians(3), np.radians(4), -0.9)])
    assert roll_pitch_errors_deg(true, goal) == pytest.approx(np.array([[3.0, 4.0]]))


def test_a_roll_across_half_a_turn_is_a_small_error():
    """From 179 to -179 degrees are two, not 358."""
    goal, true = (np.array([quat_from_euler(np.radians(roll), 0.0, 0.3)]) for roll in (179.0, -179.0))
    assert roll_pitch_errors_deg(true, goal) == pytest.approx(np.array([[2.0, 0.0]]), abs=1e-6)


def test_the_largest_lean_is_that_of_the_worst_step_and_of_the_worse_angle():
    """One step of 2 degrees of roll and -3 of pitch among level ones has a maximum of 3 and an rms of far less."""
    q = np.array([quat_from_euler(0.0, 0.0, 0.3 * 0.05 * k + np.pi / 2) for k in range(400)])
    q[200] = quat_from_euler(np.radians(2.0), np.radians(-3.0), 0.3 * 10.0 + np.pi / 2)
    figures = flight_figures(table().with_columns(pl.Series(f"true_q{k}", q[:, i]) for i, k in enumerate("wxyz")))
    assert figures["roll_pitch_max_deg"] == pytest.approx(3.0)
    assert figures["roll_pitch_rms_deg"] == pytest.approx(np.sqrt(13.0 / 800.0))


def test_a_step_counts_for_as_long_as_it_lasts():
    """Of uneven steps the mean is over time, not over rows; the last lasts as long as the usual one."""
    steps = pl.DataFrame(
        {
            "time_s": [0.0, 1.0, 1.1, 1.2, 1.3],
            "target_speed_mean_m_s": [1.0, 0.0, 0.0, 0.0, 0.0],
            "exposing": [True, True, False, False, False],
            "power_W": [10.0, 0.0, 0.0, 0.0, 100.0],
        }
    )
    figures = flight_figures(steps)
    assert figures["duration_s"] == pytest.approx(1.4)
    assert figures["target_speed_mean_m_s"] == pytest.approx(1.0 / 1.4)
    assert figures["exposure_speed_mean_m_s"] == pytest.approx(1.0 / 1.1)
    assert figures["energy_kJ"] == pytest.approx(0.020)


def test_the_whole_turn_counts_yaw():
    """A quarter turn is 90 degrees about any axis, whichever sign its quaternion has."""
    goal = np.array([quat_from_euler(0.1, 0.2, 0.5)] * 3)
    quarters = [quat_multiply(goal[0], quat_from_rotvec(0.5 * np.pi * axis)) for axis in np.eye(3)]
    assert attitude_rmse_deg(np.array(quarters), -goal) == pytest.approx(90.0)
    assert attitude_rmse_deg(goal, -goal) == pytest.approx(0.0, abs=1e-5)


def test_exceedance_is_a_share_of_surface_and_time():
    """Half of the surface for half of the time is a quarter; still water has no speed to exceed."""
    over = np.where(np.arange(400) < 200, 0.5, 0.0)
    figures = flight_figures(
        table(target_over_1cm_s=over, target_over_ambient=np.full(400, np.nan), exposing=np.arange(400) < 200)
    )
    assert figures["exceedance_1cm_s_pct"] == pytest.approx(25.0)
    assert figures["exposure_exceedance_1cm_s_pct"] == pytest.approx(50.0)
    assert figures["exceedance_ambient_pct"] is None


def test_missing_columns_give_none_and_no_rows_an_error():
    """A figure that cannot be computed is None, never 0."""
    figures = flight_figures(pl.DataFrame({"time_s": [0.0, 0.1]}))
    assert figures.pop("duration_s") == pytest.approx(0.2)
    assert set(figures.values()) == {None}
    with pytest.raises(InputError, match="time_s"):
        flight_figures(pl.DataFrame({"x": [1]}))
    with pytest.raises(InputError, match="grow"):
        flight_figures(pl.DataFrame({"time_s": [0.0, 0.0]}))


def test_grains_that_move_are_told_as_a_share_and_a_time():
    """The mean share of the bed over time, and the time in which any of it moves; None where no grains lie."""
    share = np.where(np.arange(400) < 100, 0.2, 0.0)
    figures = flight_figures(table(bed_over_threshold=share))
    assert figures["bed_over_threshold_pct"] == pytest.approx(5.0)
    assert figures["bed_over_threshold_s"] == pytest.approx(0.25 * figures["duration_s"])
    none = flight_figures(table(bed_over_threshold=np.full(400, np.nan)))
    assert none["bed_over_threshold_pct"] is none["bed_over_threshold_s"] is None


def test_sway_is_judged_at_the_shutter_and_its_peaks_over_all():
    """Root mean square, mean shape and the spread about it over exposures; peaks and the way slid over the flight."""
    n = 400
    swing = np.where(np.arange(n) % 2 == 0, 0.001, 0.003)
    exposing = np.arange(n) % 10 < 2  # one of each, so that the mean is 2 mm
    columns = {
        "sway_m": 1.5 * swing, "sway_peak_m": 4.0 * swing + (np.arange(n) == 7) * 0.1, "sway_x_m": swing,
        "sway_y_m": 0.0 * swing, "sway_z_m": 0.0 * swing, "target_stress_Pa": 1e6 * swing,
        "shifted_m": np.linspace(0.0, 0.02, n), "sway_wash_m": 0.5 * swing, "target_drag_N": 10.0 * swing,
    }  # fmt: skip
    figures = flight_figures(table(exposing=exposing, **columns))
    assert figures["sway_rms_mm"] == pytest.approx(1.5 * np.sqrt(5.0))
    assert figures["sway_wash_mm"] == pytest.approx(0.5 * np.sqrt(5.0))
    assert figures["sway_mean_mm"] == pytest.approx(2.0)
    assert figures["sway_about_mean_mm"] == pytest.approx(1.0)
    assert figures["sway_peak_mm"] == pytest.approx(112.0)
    assert figures["target_stress_peak_Pa"] == pytest.approx(3e3)
    assert figures["target_drag_peak_N"] == pytest.approx(0.03)
    assert figures["shifted_mm"] == pytest.approx(20.0)
    rigid = flight_figures(table(exposing=exposing))
    assert all(rigid[key] is None for key in SWAY_FIGURES)
