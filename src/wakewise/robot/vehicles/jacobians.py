"""Exact derivatives of the motion: of the acceleration, and of one discrete step.

The error of an attitude is the rotation vector delta, in radians, of a small further turn *expressed in the body*:
q_true = q exp(delta), a perturbation on the right. The error state is (position in W, delta, twist in B), shape (12,).
Nothing is differenced: a step's derivatives are those of the step as it is computed, stages and normalisation included.
Quadratic drag, with its abs(u) u, has a continuous first derivative, so these are exact at rest, too.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.geometry import matrix_from_quat, skew
from wakewise.robot.vehicles.dynamics import RigidBody, pack
from wakewise.robot.vehicles.kernels import INVERSE, rate_jacobian_kernel, rk4_jacobian_kernel
from wakewise.robot.vehicles.semi_implicit import semi_implicit_jacobian_kernel


class AccelerationJacobians(NamedTuple):
    """Derivatives of dnu_B/dt.

    by_attitude : (6, 3), per radian of a turn expressed in B; by_twist : (6, 6); by_wrench : (6, 6), the inverse of the
    mass matrix; by_current : (6, 3), the current expressed in W.
    """

    by_attitude: Array
    by_twist: Array
    by_wrench: Array
    by_current: Array


class LinearisedStep(NamedTuple):
    """State after one step, and its derivatives.

    p_WB_m : (3,); q_WB : (4,); nu_B : (6,); by_state : (12, 12), error state after by error state before;
    by_wrench : (12, 6), error state after by the wrench held during the step.
    """

    p_WB_m: Array
    q_WB: Array
    nu_B: Array
    by_state: Array
    by_wrench: Array


def acceleration_jacobians(
    body: RigidBody, q_WB: Array, nu_B: Array, wrench_B: Array, current_W_m_s: Array
) -> AccelerationJacobians:
    """Derivatives of `acceleration` at the same arguments."""
    state, inputs = pack(np.zeros(3), q_WB, nu_B, wrench_B, current_W_m_s)
    F, W = np.zeros((13, 12)), np.zeros((6, 12))
    rate_jacobian_kernel(body.packed, state, inputs, F, W)
    w, v = state[3], state[4:7]
    # A turn by delta changes the quaternion by q (0, delta) / 2.
    quat_by_turn = 0.5 * np.vstack([-v, w * np.eye(3) + skew(v)])
    by_twist, R_BW = F[7:, 4:10], matrix_from_quat(q_WB).T
    # The linear velocity and the current's -R_BW v_c enter the water's wrenches alike; turning, the current does more.
    by_current = -by_twist[:, :3] @ R_BW
    by_current[:3] -= skew(state[10:13]) @ R_BW
    return AccelerationJacobians(
        by_attitude=F[7:, :4] @ quat_by_turn,
        by_twist=by_twist.copy(),
        by_wrench=body.packed[INVERSE : INVERSE + 6].copy(),
        by_current=by_current,
    )


def step_rk4_jacobians(
    body: RigidBody, p_WB_m: Array, q_WB: Array, nu_B: Array, wrench_B: Array, current_W_m_s: Array, dt_s: float
) -> LinearisedStep:
    """Step as `step_rk4`, with its derivatives carried through the four stages."""
    state, inputs = pack(p_WB_m, q_WB, nu_B, wrench_B, current_W_m_s)
    by_state, by_wrench = np.empty((12, 12)), np.empty((12, 6))
    rk4_jacobian_kernel(body.packed, state, inputs, float(dt_s), by_state, by_wrench)
    return LinearisedStep(state[:3], state[3:7], state[7:], by_state, by_wrench)


def step_semi_implicit_jacobians(
    body: RigidBody, p_WB_m: Array, q_WB: Array, nu_B: Array, wrench_B: Array, current_W_m_s: Array, dt_s: float
) -> LinearisedStep:
    """Step as `step_semi_implicit`, with its derivatives, those of the implicit matrices included."""
    state, inputs = pack(p_WB_m, q_WB, nu_B, wrench_B, current_W_m_s)
    by_state, by_wrench = np.empty((12, 12)), np.empty((12, 6))
    semi_implicit_jacobian_kernel(body.packed, state, inputs, float(dt_s), by_state, by_wrench)
    return LinearisedStep(state[:3], state[3:7], state[7:], by_state, by_wrench)
