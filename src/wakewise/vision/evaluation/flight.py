"""Figures of a flight from the table of its control steps.

Functions take arrays with one row per step and no NaN, `flight_figures` takes the table. World W is NED, body B is FRD.
"""

from __future__ import annotations

import numpy as np
import polars as pl

from wakewise.core.arrays import Array, BoolArray
from wakewise.core.errors import InputError
from wakewise.core.geometry import euler_from_quat, matrix_from_quat

REVERSAL_N = 0.1
"""A thruster has reversed once its force has passed from beyond this on one side to beyond it on the other."""

PATH_WINDOW_S = 5.0

SWAY_FIGURES = (
    "sway_rms_mm",
    "sway_peak_mm",
    "sway_mean_mm",
    "sway_about_mean_mm",
    "sway_wash_mm",
    "target_stress_peak_Pa",
    "target_drag_peak_N",
    "shifted_mm",
)


def rms(values: Array) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def path_distance(true_W_m: Array, goal_W_m: Array, time_s: Array, window_s: float = PATH_WINDOW_S) -> Array:
    """Distance in m from each true position to the goal's path, shape (n,): being late along the path costs nothing.

    Only the part of the path flown within `window_s` before or after counts, so that an orbit's next lap cannot hide an
    error of this one. Positions have shape (n, 3).
    """
    n = len(time_s)
    out = np.empty(n)
    first = np.searchsorted(time_s, time_s - window_s)
    last = np.searchsorted(time_s, time_s + window_s, side="right") - 1
    for i in range(n):
        corners = goal_W_m[first[i] : last[i] + 1]
        if len(corners) == 1:
            out[i] = np.linalg.norm(true_W_m[i] - corners[0])
            continue
        along = np.diff(corners, axis=0)
        squared = np.maximum((along**2).sum(axis=1), 1e-18)
        share = np.clip(((true_W_m[i] - corners[:-1]) * along).sum(axis=1) / squared, 0.0, 1.0)
        nearest = corners[:-1] + share[:, None] * along
        out[i] = np.sqrt(((true_W_m[i] - nearest) ** 2).sum(axis=1).min())
    return out


def velocity_deviation_pct(true_WB_q: Array, true_B_m_s: Array, goal_WB_q: Array, goal_B_m_s: Array) -> float | None:
    """RMS of true minus goal velocity, both in the world, in percent of the RMS of the goal's; None if that is 0.

    Quaternions (w, x, y, z) have shape (n, 4), velocities in their own body frame (n, 3).
    """
    true_W = np.einsum("nij,nj->ni", matrix_from_quat(true_WB_q), true_B_m_s)
    goal_W = np.einsum("nij,nj->ni", matrix_from_quat(goal_WB_q), goal_B_m_s)
    goal = rms(np.linalg.norm(goal_W, axis=1))
    return 100.0 * rms(np.linalg.norm(true_W - goal_W, axis=1)) / goal if goal > 1e-6 else None


def roll_pitch_errors_deg(true_WB_q: Array, goal_WB_q: Array) -> Array:
    """Errors in roll and pitch in degrees, shape (n, 2), between -180 and 180; quaternions (w, x, y, z), (n, 4)."""
    error = euler_from_quat(true_WB_q)[:, :2] - euler_from_quat(goal_WB_q)[:, :2]
    return np.asarray(np.degrees((error + np.pi) % (2 * np.pi) - np.pi))


def attitude_rmse_deg(true_WB_q: Array, goal_WB_q: Array) -> float:
    """RMS in degrees of the angle between true and goal attitude; quaternions (w, x, y, z), shape (n, 4)."""
    cosine = np.abs(np.einsum("ni,ni->n", true_WB_q, goal_WB_q))
    cosine /= np.linalg.norm(true_WB_q, axis=1) * np.linalg.norm(goal_WB_q, axis=1)
    return float(np.degrees(rms(2.0 * np.arccos(np.clip(cosine, -1.0, 1.0)))))


def sign_flips(thrusts_N: Array, dead_N: float = REVERSAL_N) -> int:
    """How often any thruster reversed; thrusts have shape (steps, thrusters), forces below `dead_N` have no sign."""
    flips = 0
    for column in np.asarray(thrusts_N).T:
        signs = np.sign(column[np.abs(column) > dead_N])
        flips += int(np.count_nonzero(np.diff(signs)))
    return flips


def rising_edges(flags: BoolArray) -> int:
    """How often a flag went up, counting one that is up from the start."""
    up = np.asarray(flags, dtype=np.bool_)
    return int(up[:1].sum() + np.count_nonzero(up[1:] & ~up[:-1]))


def step_lengths_s(time_s: Array) -> Array:
    """How long each step lasted, shape (n,); the last as long as the usual one."""
    if len(time_s) < 2:
        return np.zeros(len(time_s))
    gaps = np.diff(time_s)
    if not np.all(gaps > 0):
        raise InputError("steps: time_s must grow from row to row")
    return np.append(gaps, np.median(gaps))


def flight_figures(steps: pl.DataFrame) -> dict[str, float | int | None]:
    """Figures of one flight from the table of its steps (`steps.parquet`); None where a column is missing.

    `wakewise.experiments.trials.metrics` defines each by its key, with its unit, but tracking_rmse_mm: estimated
    position against the goal's, which is the error that the controller sees. Raises InputError if the table has no rows
    or no time.
    """
    if "time_s" not in steps.columns or steps.height == 0:
        raise InputError(
            f"steps: {steps.height} rows and columns {steps.columns[:3]}; needs time_s and at least one row"
        )
    time = _columns(steps, "time_s")[:, 0]
    lasts = step_lengths_s(time)
    duration = float(lasts.sum())
    out: dict[str, float | int | None] = {"duration_s": duration}
    for key, column in (
        ("target_speed_mean_m_s", "target_speed_mean_m_s"),
        ("target_speed_p95_m_s", "target_speed_p95_m_s"),
        ("bed_speed_p95_m_s", "bed_speed_p95_m_s"),
        ("turbidity_mean_per_m", "turbidity_per_m"),
        ("target_pressure_mean_Pa", "target_pressure_mean_Pa"),
        ("target_pressure_p95_Pa", "target_pressure_p95_Pa"),
        ("bed_shear_p95_Pa", "bed_shear_p95_Pa"),
        ("tracer_speed_mean_m_s", "tracer_speed_mean_m_s"),
        ("ray_optical_depth", "ray_optical_depth"),
        ("disturbance", "disturbance"),
    ):
        out[key] = _mean(steps, column, lasts, np.ones(len(time), dtype=np.bool_))
    for key, column in (
        ("exceedance_1cm_s_pct", "target_over_1cm_s"),
        ("exceedance_ambient_pct", "target_over_ambient"),
        ("bed_over_threshold_pct", "bed_over_threshold"),
    ):
        share = _mean(steps, column, lasts, np.ones(len(time), dtype=np.bool_))
        out[key] = None if share is None else 100.0 * share
    exposing = _flags(steps, "exposing")
    for key, column in (
        ("exposure_speed_mean_m_s", "target_speed_mean_m_s"),
        ("exposure_speed_p95_m_s", "target_speed_p95_m_s"),
        ("exposure_pressure_mean_Pa", "target_pressure_mean_Pa"),
        ("exposure_pressure_p95_Pa", "target_pressure_p95_Pa"),
        ("exposure_optical_depth", "ray_optical_depth"),
    ):
        out[key] = None if exposing is None else _mean(steps, column, lasts, exposing)
    share = None if exposing is None else _mean(steps, "target_over_1cm_s", lasts, exposing)
    out["exposure_exceedance_1cm_s_pct"] = None if share is None else 100.0 * share
    known = _finite(steps, "bed_over_threshold") is not None
    out["bed_over_threshold_s"] = float((_columns(steps, "bed_over_threshold")[:, 0] > 0.0) @ lasts) if known else None
    lifted = _finite(steps, "silt_lifted_g")
    out["silt_lifted_g"] = None if lifted is None else float(lifted[-1])
    suspended = _finite(steps, "silt_suspended_g")
    out["silt_suspended_max_g"] = None if suspended is None else float(suspended.max())
    out |= sway_figures(steps, exposing)
    out |= _tracking(steps, time)
    power = _maybe(steps, "power_W")
    out["energy_kJ"] = None if power is None else 1e-3 * float(power[:, 0] @ lasts)
    thrust_names = _numbered(steps, "thrust_")
    thrusts = _maybe(steps, *thrust_names) if thrust_names else None
    out["sign_flips_per_s"] = sign_flips(thrusts) / duration if thrusts is not None and duration > 0 else None
    collision = _flags(steps, "collision")
    out["collisions"] = None if collision is None else rising_edges(collision)
    fell = None
    if "fallback" in steps.columns:
        fell = int(steps["fallback"].fill_null("").cast(pl.String).str.len_chars().gt(0).sum())
    out["fallbacks"] = fell
    return out


def sway_figures(steps: pl.DataFrame, exposing: BoolArray | None) -> dict[str, float | None]:
    """How far water moved a target that yields; all None of one that nothing moves.

    While the shutter is open, over all exposures alike: sway_rms_mm is the root mean square way of the surface from its
    shape at rest, sway_wash_mm that from where the same water without the vehicle would have it, which is all of the
    sway that a controller can change, sway_mean_mm how far the mean shape is from that at rest (the way of the
    surface's mean), and sway_about_mean_mm the root mean square of how far that mean way is from its own mean.
    """
    out: dict[str, float | None] = dict.fromkeys(SWAY_FIGURES)
    mean = _maybe(steps, "sway_x_m", "sway_y_m", "sway_z_m")
    values = _maybe(steps, "sway_m", "sway_peak_m", "target_stress_Pa", "shifted_m")
    if mean is None or values is None:
        return out
    out["sway_peak_mm"] = 1e3 * float(values[:, 1].max())
    out["target_stress_peak_Pa"] = float(values[:, 2].max())
    drag = _finite(steps, "target_drag_N")
    out["target_drag_peak_N"] = None if drag is None else float(drag.max())
    out["shifted_mm"] = 1e3 * float(values[-1, 3])
    if exposing is not None and exposing.any():
        seen = mean[exposing]
        out["sway_rms_mm"] = 1e3 * rms(values[exposing, 0])
        out["sway_mean_mm"] = 1e3 * float(np.linalg.norm(seen.mean(axis=0)))
        wash = _maybe(steps, "sway_wash_m")
        out["sway_wash_mm"] = None if wash is None else 1e3 * rms(wash[exposing])
        out["sway_about_mean_mm"] = 1e3 * rms(np.linalg.norm(seen - seen.mean(axis=0), axis=1))
    return out


def _tracking(steps: pl.DataFrame, time_s: Array) -> dict[str, float | int | None]:
    out: dict[str, float | int | None] = dict.fromkeys(
        (
            "position_rmse_mm",
            "path_rmse_mm",
            "estimate_rmse_mm",
            "tracking_rmse_mm",
            "velocity_deviation_pct",
            "roll_pitch_rms_deg",
            "roll_pitch_max_deg",
            "attitude_rmse_deg",
        )
    )
    place = {who: _maybe(steps, *(f"{who}_{k}_m" for k in "xyz")) for who in ("true", "goal", "est")}
    turn = {who: _maybe(steps, *(f"{who}_q{k}" for k in "wxyz")) for who in ("true", "goal")}
    speed = {who: _maybe(steps, *(f"{who}_{k}_m_s" for k in "uvw")) for who in ("true", "goal")}
    true, goal, est = place["true"], place["goal"], place["est"]
    if true is not None and goal is not None:
        out["position_rmse_mm"] = 1e3 * rms(np.linalg.norm(true - goal, axis=1))
        out["path_rmse_mm"] = 1e3 * rms(path_distance(true, goal, time_s))
    if true is not None and est is not None:
        out["estimate_rmse_mm"] = 1e3 * rms(np.linalg.norm(true - est, axis=1))
    if goal is not None and est is not None:
        out["tracking_rmse_mm"] = 1e3 * rms(np.linalg.norm(est - goal, axis=1))
    q_true, q_goal = turn["true"], turn["goal"]
    if q_true is not None and q_goal is not None:
        errors = roll_pitch_errors_deg(q_true, q_goal)
        out["roll_pitch_rms_deg"] = rms(errors)
        out["roll_pitch_max_deg"] = float(np.abs(errors).max())
        out["attitude_rmse_deg"] = attitude_rmse_deg(q_true, q_goal)
        if speed["true"] is not None and speed["goal"] is not None:
            out["velocity_deviation_pct"] = velocity_deviation_pct(q_true, speed["true"], q_goal, speed["goal"])
    return out


def _columns(steps: pl.DataFrame, *names: str) -> Array:
    return np.stack([steps[name].cast(pl.Float64).to_numpy() for name in names], axis=1)


def _maybe(steps: pl.DataFrame, *names: str) -> Array | None:
    """Columns side by side, shape (n, k); None if one is missing or not all finite."""
    if not set(names) <= set(steps.columns):
        return None
    values = _columns(steps, *names)
    return values if np.all(np.isfinite(values)) else None


def _finite(steps: pl.DataFrame, name: str) -> Array | None:
    """Values of a column that are finite, shape (n,); None if there is none."""
    if name not in steps.columns:
        return None
    values = _columns(steps, name)[:, 0]
    values = values[np.isfinite(values)]
    return values if len(values) else None


def _flags(steps: pl.DataFrame, name: str) -> BoolArray | None:
    if name not in steps.columns:
        return None
    return np.asarray(steps[name].cast(pl.Boolean).fill_null(False).to_numpy(), dtype=np.bool_)


def _mean(steps: pl.DataFrame, name: str, lasts: Array, rows: BoolArray) -> float | None:
    """Mean over time of a column on the given rows; steps without a value are left out, None if none has one."""
    if name not in steps.columns:
        return None
    values = _columns(steps, name)[:, 0]
    rows = rows & np.isfinite(values)
    weight = lasts[rows]
    if len(weight) == 0:
        return None
    return float(values[rows] @ weight / weight.sum()) if weight.sum() > 0 else float(values[rows].mean())


def _numbered(steps: pl.DataFrame, prefix: str) -> list[str]:
    """Columns thrust_1_N, thrust_2_N, ... that the table has."""
    names: list[str] = []
    while f"{prefix}{len(names) + 1}_N" in steps.columns:
        names.append(f"{prefix}{len(names) + 1}_N")
    return names
