"""The filter in the default tank: how wrong, how well it knows that, and what ten seconds without a camera cost.

Position from velocity over ground and attitude alone, as a Doppler log and a gyrocompass give it.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import chi2

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.core.geometry import matrix_from_quat, quat_conjugate, quat_from_euler, quat_multiply, rotvec_from_quat
from wakewise.core.interfaces import BodyState, Estimator, Measurement, TruthProvider
from wakewise.experiments.trials.timing import BenchOptions
from wakewise.operation import Parts, Scenario, fly
from wakewise.operation.loop import Step

_FLATTENING = 1.0 / 298.257223563
_EQUATOR_M = 6378137.0  # WGS 84 (NIMA TR8350.2)


def dead_reckoned(time_s: Array, q_WB: Array, v_B_m_s: Array) -> Array:
    """Positions from the first instant on, shape (n, 3), by the trapezoidal rule.

    Parameters
    ----------
    time_s : ndarray, shape (n,)
        Ascending.
    q_WB : ndarray, shape (n, 4)
    v_B_m_s : ndarray, shape (n, 3)
        Velocity over ground, in B.

    Raises
    ------
    InputError
        If times do not ascend or shapes do not match.
    """
    n = len(time_s)
    if q_WB.shape != (n, 4) or v_B_m_s.shape != (n, 3):
        raise InputError(f"dead reckoning: {n} times, attitudes {q_WB.shape}, velocities {v_B_m_s.shape}: must match")
    steps = np.diff(time_s)
    if n < 2 or np.any(~(steps > 0.0)):
        raise InputError("dead reckoning: times must ascend, and there must be at least two")
    v_W = np.einsum("nij,nj->ni", matrix_from_quat(q_WB), v_B_m_s)
    path = np.zeros((n, 3))
    path[1:] = np.cumsum(0.5 * (v_W[1:] + v_W[:-1]) * steps[:, None], axis=0)
    return path


def local_north_east_down(latitude_rad: Array, longitude_rad: Array, altitude_m: Array) -> Array:
    """Positions in the tangent plane of the first one, shape (n, 3), good to a metre over a few kilometres.

    Radii of curvature of the WGS 84 ellipsoid at the first point (P. D. Groves, Principles of GNSS, Inertial, and
    Multisensor Integrated Navigation Systems, 2nd ed. 2013, eq. 2.105 and 2.106).
    """
    e2 = _FLATTENING * (2.0 - _FLATTENING)
    sine = np.sin(latitude_rad[0])
    across_m = _EQUATOR_M / np.sqrt(1.0 - e2 * sine**2)
    along_m = across_m * (1.0 - e2) / (1.0 - e2 * sine**2)
    height_m = altitude_m[0]
    return np.column_stack(
        [
            (latitude_rad - latitude_rad[0]) * (along_m + height_m),
            (longitude_rad - longitude_rad[0]) * (across_m + height_m) * np.cos(latitude_rad[0]),
            height_m - altitude_m,
        ]
    )


SEEDS, SECONDS, SETTLED_S = 50, 10.0, 4.0
FEW = 20  # seeds of each row of the table of mismatches
# The camera is lost while the vehicle still hovers, and comes back when it has flown to its orbit and begun it.
LOSS_S, BACK_S = (10.0, 20.0), 2.0


def run(options: BenchOptions) -> dict[str, Any]:
    """Fly the start of the default mission with many seeds; the seeds are none that the settings were chosen with."""
    scenario = Scenario()
    parts = scenario.parts()
    _ = parts.preflight
    flights, currents, spent_s = [], [], 0.0
    for k in range(SEEDS):
        flown = _flight(_seeded(parts, scenario.model_copy(update={"seed": 3000 + k})), SECONDS)
        flights.append((flown.errors, flown.covariances))
        currents.append(flown.current_W_m_s)
        spent_s += flown.cpu_s
        options.progress(k + 1, 2 * SEEDS + 2 * FEW, f"flight {k + 1} of {SEEDS}")
    begin = round(SETTLED_S * scenario.control.rate_hz)
    errors = np.array([e[begin:] for e, _ in flights])
    # One instant of each flight: within a flight errors hang together, between seeds they do not.
    last = [(e[-1], P[-1]) for e, P in flights]
    pose = np.array([_nees(e[:6], P[:6, :6]) for e, P in last])
    whole = np.array([_nees(e, P) for e, P in last])
    twist = np.array([_nees(e[6:], P[6:, 6:]) for e, P in last])
    (low, high), (low12, high12) = _bounds(6), _bounds(12)
    why: dict[str, str] = {}
    drifts = dead_reckoning_drifts(options.data)
    drift = float(np.median(drifts)) if drifts else None
    if drift is None:
        why["dead_reckoning_drift_pct"] = "no auv_dvl in the data folder"
    return {
        "position_rmse_mm": 1e3 * _rms(errors[..., :3]),
        "attitude_rmse_deg": float(np.degrees(_rms(errors[..., 3:6]))),
        "velocity_rmse_mm_s": 1e3 * _rms(errors[..., 6:9]),
        "nees_in_bounds": bool(low <= pose.mean() <= high),
        "nees_pose_mean": float(pose.mean()),
        "nees_pose_bounds": [low, high],
        "nees_pose_and_twist_mean": float(whole.mean()),
        "nees_pose_and_twist_bounds": [low12, high12],
        "nees_twist_mean": float(twist.mean()),
        "nees_twist_in_bounds": bool(low <= twist.mean() <= high),
        "seeds": SEEDS,
        **_current_figures(np.array(currents), np.array(scenario.tank.current.velocity_m_s)),
        "mismatch": {"1": _claimed(errors, pose), **_mismatch(parts, options)},
        **_loss(parts, options),
        "dead_reckoning_drift_pct": drift,
        "step_cpu_us": 1e6 * spent_s / (SEEDS * SECONDS * scenario.control.rate_hz),
        "why": why,
    }


@dataclass(kw_only=True, eq=False)
class TimedEstimator:
    """An estimator and the thread CPU time that its steps took; implements `wakewise.core.interfaces.Estimator`."""

    inner: Estimator[Any]
    spent_s: float = 0.0

    def init(self, start: BodyState) -> Any:
        """State at the start."""
        return self.inner.init(start)

    def step(
        self, state: Any, dt_s: float, measurements: tuple[Measurement, ...], thrusts_N: Array
    ) -> tuple[Any, BodyState]:
        """Advance the estimator within."""
        began = time.thread_time()
        answer = self.inner.step(state, dt_s, measurements, thrusts_N)
        self.spent_s += time.thread_time() - began
        return answer


@dataclass(frozen=True, kw_only=True, eq=False)
class EstimatorErrors:
    """Of one flight after each step: errors, shape (k, 12), covariances, shape (k, 12, 12), the current, shape (k, 3).

    The current is NaN where it is not known yet; `cpu_s` is what the filter took.
    """

    errors: Array
    covariances: Array
    current_W_m_s: Array
    cpu_s: float


def _flight(parts: Parts, seconds: float) -> EstimatorErrors:
    """Fly the first seconds of a mission."""
    errors, covariances, currents = [], [], []

    def note(step: Step, _: TruthProvider | None) -> None:
        if step.truth is None or step.estimate.covariance is None:  # the first step: nothing is estimated yet
            return
        true, estimate = step.truth.state, step.estimate
        turn = rotvec_from_quat(quat_multiply(quat_conjugate(estimate.X_WB.q), true.X_WB.q))
        errors.append(np.concatenate([true.X_WB.p_m - estimate.X_WB.p_m, turn, true.nu_B - estimate.nu_B]))
        covariances.append(estimate.covariance)
        currents.append(np.full(3, np.nan) if estimate.current_W_m_s is None else estimate.current_W_m_s)

    timed = TimedEstimator(inner=parts.estimator)
    one_more_s = 1.0 / parts.scenario.control.rate_hz
    flown = parts.replace(estimator=timed)
    fly(flown, duration_s=seconds + one_more_s, checked=False, water_every_s=np.inf, watch=note)
    return EstimatorErrors(
        errors=np.array(errors),
        covariances=np.array(covariances),
        current_W_m_s=np.array(currents),
        cpu_s=timed.spent_s,
    )


def _current_figures(found_m_s: Array, true_m_s: Array) -> dict[str, float | None]:
    """How soon the level current is told, and how wrong it is at the end; `found_m_s` has shape (flights, k, 3)."""
    known = np.isfinite(found_m_s[..., 0])
    first = np.where(known.any(axis=1), known.argmax(axis=1), known.shape[1]) / Scenario().control.rate_hz
    last = found_m_s[known[:, -1], -1, :2]
    size = float(np.linalg.norm(true_m_s[:2]))
    cosine = last @ true_m_s[:2] / np.maximum(np.linalg.norm(last, axis=1) * size, 1e-12)
    angle = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
    return {
        "current_known_after_s": float(np.median(first)),
        "current_error_pct": 100.0 * float(np.sqrt(np.mean(np.sum((last - true_m_s[:2]) ** 2, axis=1)))) / size,
        "current_angle_deg": float(np.sqrt(np.mean(angle**2))),
    }


def _mismatch(parts: Parts, options: BenchOptions) -> dict[str, dict[str, float]]:
    """What the filter claims where the sensors' lasting errors are half and twice what it was made for."""
    answer, scenario = {}, parts.scenario
    for row, ratio in enumerate((0.5, 2.0)):
        sensors = scenario.tank.sensors
        lasting = {
            name: tuple(ratio * v for v in getattr(sensors, name))
            for name in ("pose_drift_m", "pose_drift_rad", "tracking_drift_m")
        }
        changed = sensors.model_copy(update=lasting | {"depth_bias_m": ratio * sensors.depth_bias_m})
        tank = scenario.tank.model_copy(update={"sensors": changed})
        errors, nees = [], []
        for k in range(FEW):
            flown = _flight(_seeded(parts, scenario.model_copy(update={"seed": 5000 + k, "tank": tank})), SECONDS)
            errors.append(flown.errors[round(SETTLED_S * scenario.control.rate_hz) :])
            nees.append(_nees(flown.errors[-1][:6], flown.covariances[-1][:6, :6]))
            done = SEEDS + FEW * row + k + 1
            options.progress(done, 2 * SEEDS + 2 * FEW, f"flight {k + 1} of {FEW} with errors x {ratio:g}")
        answer[f"{ratio:g}"] = _claimed(np.array(errors), np.array(nees))
    return answer


def _claimed(errors: Array, nees: Array) -> dict[str, float]:
    """Figures of one row of the table of mismatches."""
    return {
        "position_rmse_mm": 1e3 * _rms(errors[..., :3]),
        "attitude_rmse_deg": float(np.degrees(_rms(errors[..., 3:6]))),
        "nees_pose_mean": float(np.mean(nees)),
    }


def _seeded(parts: Parts, scenario: Scenario) -> Parts:
    """The parts with another scenario; the mission, which does not depend on the seed, is not planned anew."""
    return parts.replace(scenario=scenario, target=parts.target, region=parts.region, route=parts.route)


def _loss(parts: Parts, options: BenchOptions) -> dict[str, Any]:
    """What ten seconds without poses and tracking do, and whether the filter knows: NEES of the pose over all seeds.

    The water is clean and moves in steps of 0.1 s, which is cheaper and which neither vehicle nor sensors notice.
    """
    scenario = parts.scenario
    tank = scenario.tank
    sensors = tank.sensors.model_copy(update={"pose_outages_s": (LOSS_S,), "tracking_rate_hz": 0.0})
    clean = tank.silt.model_copy(update={"load_kg_m2": 0.0})
    blind = tank.model_copy(update={"sensors": sensors, "silt": clean, "flow_step_s": 0.1})
    rate_hz = scenario.control.rate_hz
    begin, middle, end = (round(t * rate_hz) - 1 for t in (LOSS_S[0], sum(LOSS_S) / 2, LOSS_S[1]))
    nees, worst_m, at_end, claimed, after = [], 0.0, [], [], []
    for k in range(SEEDS):
        lost = scenario.model_copy(update={"seed": 4000 + k, "tank": blind})
        flown = _flight(_seeded(parts, lost), LOSS_S[1] + BACK_S)
        errors, covariances = flown.errors, flown.covariances
        nees.append([_nees(errors[i, :6], covariances[i, :6, :6]) for i in (middle, end, -1)])
        worst_m = max(worst_m, float(np.linalg.norm(errors[begin:, :3], axis=1).max()))
        at_end.append(errors[end, :3])
        claimed.append(np.trace(covariances[end, :3, :3]))
        after.append(errors[-1, :3])
        options.progress(
            SEEDS + 2 * FEW + k + 1, 2 * SEEDS + 2 * FEW, f"flight {k + 1} of {SEEDS} that loses its camera"
        )
    during, last, back = (float(v) for v in np.mean(nees, axis=0))
    low, high = _bounds(6)
    return {
        "loss_in_bounds": bool(low <= during <= high and low <= last <= high),
        "loss_nees": last,
        "loss_nees_after_5_s": during,
        "loss_nees_2_s_later": back,
        "loss_nees_bounds": [low, high],
        "loss_rmse_mm": 1e3 * _rms(np.array(at_end)),
        "loss_sigma_mm": 1e3 * float(np.sqrt(np.mean(claimed))),
        "loss_worst_mm": 1e3 * worst_m,
        "loss_rmse_2_s_later_mm": 1e3 * _rms(np.array(after)),
    }


def dead_reckoning_drifts(data: Path | None) -> list[float]:
    """End error over distance run of each real Doppler log in `data`/auv_dvl, in percent; empty without logs.

    Files are those of N. Cohen and I. Klein 2025 (doi 10.1016/j.engappai.2025.110221).
    """
    folders = sorted((data / "auv_dvl").glob("Trajectory*")) if data is not None else []
    drifts = []
    for folder in folders:
        log = np.loadtxt(next(folder.glob("DVL*.csv")), delimiter=",", skiprows=1)
        truth = np.loadtxt(next(folder.glob("GT*.csv")), delimiter=",", skiprows=1)
        n = min(len(log), len(truth))
        q = np.array([quat_from_euler(*angles) for angles in truth[:n, 7:10]])
        path = dead_reckoned(log[:n, 0], q, log[:n, 1:4])
        place = local_north_east_down(truth[:n, 2], truth[:n, 1], truth[:n, 3])
        run_m = np.linalg.norm(np.diff(place, axis=0), axis=1).sum()
        drifts.append(float(100.0 * np.linalg.norm(path[-1] - place[-1]) / run_m))
    return drifts


def _bounds(components: int) -> tuple[float, float]:
    """Between these the mean NEES of independent flights lies in 95 % of cases, if the filter is right."""
    low, high = (float(chi2.ppf(p, components * SEEDS)) / SEEDS for p in (0.025, 0.975))
    return low, high


def _nees(error: Array, covariance: Array) -> float:
    return float(error @ np.linalg.solve(covariance, error))


def _rms(errors: Array) -> float:
    """Root mean square of the length of three-vectors."""
    return float(np.sqrt(np.mean(np.sum(errors**2, axis=-1))))
