"""Data for pages: the parts of a flight once, and its state ten times a second, as plain numbers for JSON.

Numbers are rounded to the visible precision; one that is not finite is null.

The wash at the target is that of the controller's wake model. The flown thrusts are compared with the least thrusts of
the same wrench at the same pose (direct allocation). The jets are advected by the estimated current, as for the
controller (see `wakewise.control.null_space_allocation`).
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from wakewise.allocation import disturbance_of, min_norm_allocation
from wakewise.control.null_space_allocation import AllocationContext, allocation_context
from wakewise.core.arrays import Array, freeze
from wakewise.core.geometry import Pose, euler_from_quat
from wakewise.core.interfaces import BodyState
from wakewise.operation import Parts
from wakewise.operation.teleop.target_tracking import TargetTracking
from wakewise.simulation.tank.water_truth import STILL_M_S, surface_points
from wakewise.ui.cockpit.flight_snapshot import SAMPLED_S, WINDOW_S, FlightSnapshot, SnapshotRecorder
from wakewise.wake import InfluenceModel, free_jet
from wakewise.wake.advected_jets import CrossFlow
from wakewise.wake.disturbance import advected_velocity
from wakewise.wake.jets import AxialJet

POINTS = 300
"""Points on the target's surface that are shown."""
_LEAST_N = 1e-3


@dataclass(frozen=True, kw_only=True, eq=False)
class WakeReadout:
    """Wash at a target by the wake model.

    `points_W_m`, shape (n, 3), are points on the surveyed target, evenly by area; `true_points_W_m` the same points at
    its true place.
    """

    view: InfluenceModel
    watch: AllocationContext
    points_W_m: Array
    true_points_W_m: Array

    def __post_init__(self) -> None:
        n = len(self.points_W_m)
        freeze(self, points_W_m=(n, 3), true_points_W_m=(n, 3))

    @classmethod
    def of(cls, parts: Parts) -> WakeReadout:
        """The readout of a flight."""
        true = surface_points(parts.target, POINTS, np.random.default_rng(parts.scenario.seed))
        off_m = parts.surveyed_target.centre_W_m - parts.target.centre_W_m
        made_of = (parts.vehicle, parts.region, parts.wake)
        return cls(
            view=InfluenceModel.of(*made_of, parts.control.superposition),
            watch=allocation_context(*made_of, parts.control),
            points_W_m=true + off_m,
            true_points_W_m=true,
        )

    def disturbances(self, estimate: BodyState, thrusts_N: Array) -> tuple[float, float]:
        """D of thrusts, shape (n,), and D of the least thrusts that make the same wrench, in (m/s)^2."""
        layout = self.watch.layout
        direct_N = min_norm_allocation(layout, layout.B @ thrusts_N).thrusts_N
        one, other = (disturbance_of(self.watch.gram(estimate, thrusts), thrusts) for thrusts in (thrusts_N, direct_N))
        return one, other

    def rms_m_s(self, disturbance: float) -> float:
        """Root mean square speed of the water at the target for a disturbance D in (m/s)^2."""
        return math.sqrt(disturbance / self.view.total_weight) if disturbance >= 0.0 else math.nan

    def predicted_m_s(self, estimate: BodyState, thrusts_N: Array) -> Array:
        """Speed that the jets of thrusts, shape (n,), have at `points_W_m` by the wake model, shape (points,)."""
        on = np.abs(thrusts_N) > _LEAST_N
        if not on.any():
            return np.zeros(len(self.points_W_m))
        X_WB, view, size_N = estimate.X_WB, self.view, np.abs(thrusts_N[on])
        jets_W = -np.sign(thrusts_N[on])[:, None] * (view.axes_B[on] @ X_WB.R.T)
        place = (self.points_W_m, X_WB.apply(view.positions_B_m[on]), jets_W, view.areas_m2[on])
        flow = self.watch.flow(estimate, thrusts_N)
        if flow is not None and isinstance(free_jet(view.wake), AxialJet):
            own = CrossFlow(
                current_W_m_s=flow.current_W_m_s, current_std_m_s=flow.current_std_m_s, thrusts_N=thrusts_N[on]
            )
            unit = advected_velocity(view.wake, *place, size_N, own)
        else:
            unit = view.wake.unit_velocity(*place)
        velocity = np.einsum("i,inx->nx", np.sqrt(size_N), unit)
        return np.asarray(np.linalg.norm(velocity, axis=1))


POINTS_EVERY, READOUT_EVERY = 5, 2
"""States between two evaluations of all points, and of D: with a current these cost most of the time."""


def static_description(parts: Parts, readout: WakeReadout) -> dict[str, Any]:
    """Scenario, vehicle and target, for a new client."""
    scenario, vehicle, target = parts.scenario, parts.vehicle, parts.surveyed_target
    return {
        "scenario": scenario_description(parts),
        "vehicle": {
            "name": vehicle.name,
            "thrusters": [
                {
                    "name": thruster.name,
                    "position_B_m": rounded(thruster.p_BT_m, 4),
                    "axis_B": rounded(thruster.axis_B, 4),
                    "limit_N": rounded((-thruster.max_reverse_N, thruster.max_forward_N), 2),
                }
                for thruster in vehicle.thrusters
            ],
        },
        "target": {
            "points_W_m": [rounded(point, 4) for point in readout.points_W_m],
            "centre_W_m": rounded(target.centre_W_m, 4),
            "radius_m": number(target.radius_m, 4),
            "bed_z_m": number(target.bed_z_m, 4),
            "depth_m": number(scenario.tank.size_m[2], 3),
        },
    }


def scenario_description(parts: Parts) -> dict[str, Any]:
    """Names of a scenario, known before any of its parts is made."""
    scenario = parts.scenario
    return {
        "name": scenario.name,
        "world": scenario.world,
        "method": scenario.method,
        "target": scenario.target.kind,
        "seed": scenario.seed,
    }


class StateEncoder:
    """Encodes the snapshots of one flight. `predicted_m_s` is the wash at the readout's points as last read."""

    def __init__(self, readout: WakeReadout, snapshots: SnapshotRecorder) -> None:
        self._readout, self._snapshots = readout, snapshots
        self._both: deque[tuple[float, float]] = deque(maxlen=round(WINDOW_S / SAMPLED_S / READOUT_EVERY))
        self.predicted_m_s = np.zeros(len(readout.points_W_m))
        self._now = (math.nan, math.nan)
        self._count = 0

    def read(self, now: FlightSnapshot) -> dict[str, Any]:
        """State of the flight without settings, controls, coverage and photographs."""
        step, estimate = now.step, now.step.estimate
        if self._count % READOUT_EVERY == 0:
            self._now = self._readout.disturbances(estimate, now.thrusts_N)
            if math.isfinite(sum(self._now)):
                self._both.append(self._now)
        flown, direct = self._now
        if self._count % POINTS_EVERY == 0:
            self.predicted_m_s = self._readout.predicted_m_s(estimate, now.thrusts_N)
        self._count += 1
        roll, pitch, heading = (math.degrees(angle) for angle in euler_from_quat(estimate.X_WB.q))
        R_BW = estimate.X_WB.R.T
        return {
            "time_s": number(step.time_s, 2),
            "thrusts_N": rounded(step.command.thrusts_N, 3),
            "commanded_m_s": rounded(R_BW @ now.asked_W_m_s, 4),
            "velocity_m_s": rounded(R_BW @ now.velocity_W_m_s, 4),
            "deviation_pct": number(self._snapshots.deviation_pct, 1),
            "disturbance": number(flown, 8),
            "direct_disturbance": number(direct, 8),
            "rms_m_s": number(self._readout.rms_m_s(flown), 6),
            "direct_rms_m_s": number(self._readout.rms_m_s(direct), 6),
            "saved_pct": number(self.saved_pct, 1),
            "predicted_m_s": rounded(self.predicted_m_s, 4),
            "true_m_s": None if now.true_m_s is None else rounded(now.true_m_s, 4),
            "depth_m": number(float(estimate.X_WB.p_m[2]), 3),
            "roll_deg": number(roll, 2),
            "pitch_deg": number(pitch, 2),
            "heading_deg": number(heading % 360.0, 2),
            "tilt_deg": number(math.degrees(step.tilt_rad), 2),
            "power_W": number(now.power_W, 1),
            "energy_J": number(now.energy_J, 1),
            "position_W_m": rounded(estimate.X_WB.p_m, 4),
            "goal_W_m": rounded(step.goal.X_WB.p_m, 4),
            "fallback": step.command.fallback,
        }

    @property
    def saved_pct(self) -> float | None:
        """Reduction of D by the flown thrusts against direct allocation over ten seconds, in percent.

        None if direct allocation moves the water by less than `STILL_M_S`.
        """
        if not self._both:
            return None
        flown, direct = np.mean(self._both, axis=0)
        still = self._readout.rms_m_s(float(direct)) < STILL_M_S
        return None if still else 100.0 * (1.0 - float(flown / direct))


def target_message(tracking: TargetTracking, now_s: float, X_WC: Pose) -> dict[str, Any] | None:
    """The designated target for the pages; None if none is designated.

    `now_s` is the time of the flight, and `X_WC` the estimated pose of the camera, for which the outline is drawn.
    """
    known = tracking.now(now_s)
    if known is None:
        return None
    target, outline = known.target, tracking.outline(X_WC)
    return {
        "status": known.status,
        "trouble": known.trouble,
        "outline": None if outline is None else {name: number(share, 4) for name, share in outline.items()},
        "distance_m": None if target is None else number(float(np.linalg.norm(target.centre_W_m - X_WC.p_m)), 3),
        "std_m": None if target is None else number(target.centre_std_m, 4),
        "age_ms": number(1e3 * (now_s - known.time_s), 0),
    }


def number(value: float | None, digits: int) -> float | None:
    """A number that JSON has, or None."""
    return None if value is None or not math.isfinite(value) else round(float(value), digits)


def rounded(values: Iterable[float] | Array, digits: int) -> list[float | None]:
    """Numbers that JSON has."""
    return [number(value, digits) for value in np.asarray(values, dtype=np.float64).tolist()]
