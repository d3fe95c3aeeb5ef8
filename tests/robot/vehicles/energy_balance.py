"""Energy of a vehicle in the water, and the power that changes it.

In the frame of the water, with nu_r the velocity relative to it, the equations of T. I. Fossen, Handbook of Marine
Craft Hydrodynamics and Motion Control, 2nd ed., Wiley 2021 (chapters 3, 4, 6 and 10) give

    d/dt (nu_r' (M_RB + M_A) nu_r / 2 + U) = nu_r' tau - nu_r' D(nu_r) nu_r - (W - B) v_c,z,

since C does no work. The last term, the work of the water on a vehicle that is not neutral, vanishes in still water and
in a level current.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.geometry import matrix_from_quat
from wakewise.robot.vehicles.dynamics import RigidBody, damping_wrench

STILL = np.zeros(3)
STILL.setflags(write=False)


class Energy(NamedTuple):
    """Energy in joules: motion of the body itself, of the water that it moves, and height of weight and buoyancy."""

    rigid_J: float
    added_mass_J: float
    potential_J: float

    @property
    def kinetic_J(self) -> float:
        """Kinetic energy of body and water."""
        return self.rigid_J + self.added_mass_J

    @property
    def total_J(self) -> float:
        """Kinetic and potential energy."""
        return self.kinetic_J + self.potential_J


class Power(NamedTuple):
    """What changes the energy, in watts: the wrench, drag (never negative), and a current that rises or sinks."""

    wrench_W: float
    dissipated_W: float
    current_W: float

    @property
    def net_W(self) -> float:
        """Rate of the total energy."""
        return self.wrench_W - self.dissipated_W + self.current_W


def mechanical_energy(body: RigidBody, p_WB_m: Array, q_WB: Array, nu_B: Array, current_W_m_s: Array = STILL) -> Energy:
    """Energy in the frame of the water; potential energy is zero with both centres at the surface.

    Parameters
    ----------
    p_WB_m : ndarray, shape (3,)
    q_WB : ndarray, shape (4,)
    nu_B : ndarray, shape (6,)
        Twist relative to the world.
    current_W_m_s : ndarray, shape (3,)
        Velocity of the water.
    """
    R_WB = matrix_from_quat(q_WB)
    nu_r = relative_twist(q_WB, nu_B, current_W_m_s)
    added_J = 0.5 * float(nu_r @ body.added_mass @ nu_r)
    depth_G_m, depth_B_m = p_WB_m[2] + R_WB[2] @ body.p_BG_m, p_WB_m[2] + R_WB[2] @ body.p_BB_m
    return Energy(
        rigid_J=0.5 * float(nu_r @ body.mass_matrix @ nu_r) - added_J,
        added_mass_J=added_J,
        potential_J=float(body.buoyancy_N * depth_B_m - body.weight_N * depth_G_m),
    )


def mechanical_power(body: RigidBody, q_WB: Array, nu_B: Array, wrench_B: Array, current_W_m_s: Array = STILL) -> Power:
    """Rates at which wrench, shape (6,), drag and current change the `mechanical_energy`; other arguments as there."""
    nu_r = relative_twist(q_WB, nu_B, current_W_m_s)
    return Power(
        wrench_W=float(nu_r @ wrench_B),
        dissipated_W=-float(nu_r @ damping_wrench(body, nu_r)),
        current_W=-float((body.weight_N - body.buoyancy_N) * current_W_m_s[2]),
    )


def relative_twist(q_WB: Array, nu_B: Array, current_W_m_s: Array) -> Array:
    """Twist relative to water that moves with a velocity of shape (3,) in W: nu_r, shape (6,), in B."""
    return nu_B - np.concatenate([matrix_from_quat(q_WB).T @ current_W_m_s, np.zeros(3)])
