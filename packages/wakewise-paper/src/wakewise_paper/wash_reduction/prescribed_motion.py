"""The tank's water for a vehicle on a prescribed path with prescribed thrusts: wash without a controller.

The jets do not act on the hull in the tank (except through `tank.jets.inflow_loss`, which is left out here). All
thrusts of one wrench therefore give the same flight, and the water alone gives the wash of other thrusts. Silt, sensors
and lags are left out: the thrusts are applied as given.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from wakewise.core.arrays import Array, freeze
from wakewise.core.geometry import matrix_from_quat
from wakewise.robot.vehicles import Vehicle, compile_body
from wakewise.scene.targets import Target
from wakewise.simulation.tank.ambient import tank_water
from wakewise.simulation.tank.settings import TankSettings
from wakewise.simulation.tank.water_truth import lengths
from wakewise.simulation.water import AmbientSum
from wakewise.simulation.water.hullwake import HullPush


@dataclass(frozen=True, kw_only=True, eq=False)
class PrescribedPath:
    """Where a body was: times, shape (k,), from 0 on and rising; places, shape (k, 3), attitudes (k, 4), twists (k, 6).

    Attitudes are unit quaternions X_WB, twists are in the body.
    """

    times_s: Array
    p_WB_m: Array
    q_WB: Array
    nu_B: Array

    def __post_init__(self) -> None:
        k = len(self.times_s)
        freeze(self, times_s=(k,), p_WB_m=(k, 3), q_WB=(k, 4), nu_B=(k, 6))

    def at(self, times_s: Array) -> PrescribedPath:
        """The same way at other times within it; in between it goes straight."""
        columns = np.hstack([self.p_WB_m, self.q_WB * _one_sided(self.q_WB)[:, None], self.nu_B])
        found = np.stack([np.interp(times_s, self.times_s, column) for column in columns.T], axis=1)
        q = found[:, 3:7] / np.linalg.norm(found[:, 3:7], axis=1, keepdims=True)
        return PrescribedPath(times_s=times_s, p_WB_m=found[:, :3], q_WB=q, nu_B=found[:, 7:])


@dataclass(frozen=True, kw_only=True, eq=False)
class PrescribedMotionTank:
    """A tank without its vehicle's freedom: who is led, which way, in which water, and where that is looked at.

    Parameters
    ----------
    vehicle : Vehicle
        As it truly is.
    target : Target
    settings : TankSettings
    ambient : AmbientSum
    way : PrescribedPath
        Kept at the water's own steps.
    points_W_m : ndarray, shape (n, 3)
        On the target's surface.
    """

    vehicle: Vehicle
    target: Target
    settings: TankSettings
    ambient: AmbientSum
    way: PrescribedPath
    points_W_m: Array

    def __post_init__(self) -> None:
        """Take the way at the water's own steps."""
        times, step_s = self.way.times_s, self.settings.flow_step_s
        steps = math.floor((times[-1] - times[0]) / step_s + 1e-9)
        object.__setattr__(self, "way", self.way.at(times[0] + step_s * np.arange(steps + 1)))

    @property
    def times_s(self) -> Array:
        """The water's steps, shape (k,)."""
        return self.way.times_s

    def wash_m_s(self, thrusts_N: Array, every: int, gusts: int) -> Array:
        """Mean speed over the points that is in excess of the same water without thrusters, after every so many steps.

        Parameters
        ----------
        thrusts_N : ndarray, shape (k, n)
            At the water's steps; in between they go straight.
        every : int
            Steps between two looks.
        gusts : int
            Seed of the jets' turbulence. Parcels are chaotic: where it is nothing, thrusts that differ by a thousandth
            give speeds that are a sixth apart at one look, after ten seconds.

        Returns
        -------
        ndarray, shape ((k - 1) // every,)
        """
        water = tank_water(self.vehicle, self.target, self.settings, self.ambient, np.random.default_rng([gusts, 37]))
        dt_s, way = self.settings.flow_step_s, self.way
        turns = [matrix_from_quat(q) for q in way.q_WB]
        arms, axes = self.vehicle.thruster_positions_B_m, self.vehicle.thruster_axes_B
        mean_N = 0.5 * (thrusts_N[1:] + thrusts_N[:-1])
        impulses = dt_s * np.stack([np.maximum(mean_N, 0.0), np.maximum(-mean_N, 0.0)], axis=2)
        drag = self._drag(turns)
        before, speeds = way.p_WB_m[0] + arms @ turns[0].T, []
        for k in range(1, len(turns)):
            R = turns[k]
            origins, hull = way.p_WB_m[k] + arms @ R.T, None
            if self.settings.hull_wake:
                hull = HullPush(
                    p_WB_m=way.p_WB_m[k],
                    R_WB=R,
                    size_m=self.vehicle.size_m,
                    velocity_W_m_s=R @ way.nu_B[k, :3],
                    through_W_m_s=drag[k][0],
                    impulse_W_N_s=0.5 * dt_s * (drag[k - 1][1] + drag[k][1]),
                )
            water.step(dt_s, before, origins, axes @ R.T, impulses[k - 1], hull)
            before = origins
            if k % every == 0:
                speeds.append(float(lengths(water.excess_velocity(self.points_W_m)).mean()))
        return np.array(speeds)

    def _drag(self, turns: list[Array]) -> list[tuple[Array, Array]]:
        """Velocity through the ambient water and the drag on the water at each step, shape (3,) each, in the world."""
        body, found = compile_body(self.vehicle, self.settings.density_kg_m3), []
        for time_s, p, R, twist in zip(self.way.times_s, self.way.p_WB_m, turns, self.way.nu_B, strict=True):
            nu = twist.copy()
            nu[:3] -= self.ambient.velocity(p[None], float(time_s))[0] @ R
            force_B = body.linear_damping[:3] @ nu + body.quadratic_damping[:3] * np.abs(nu[:3]) * nu[:3]
            found.append((R @ nu[:3], R @ force_B))
        return found


def _one_sided(q: Array) -> Array:
    """Signs, shape (k,), that keep unit quaternions, shape (k, 4), from jumping to their opposites."""
    turns = np.concatenate([[1.0], np.sum(q[1:] * q[:-1], axis=1)])
    return np.asarray(np.cumprod(np.where(turns < 0.0, -1.0, 1.0)), dtype=np.float64)
