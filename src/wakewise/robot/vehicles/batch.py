"""Many vehicles at once: one Runge-Kutta step of N states on all cores, for those who learn or sweep controllers.

Each vehicle is stepped as `step_rk4` steps one and as the tank steps its own, to the last bit, whatever the number of
threads: no vehicle knows another.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.core.jit.njit import assign, njit, prange
from wakewise.robot.vehicles.dynamics import RigidBody
from wakewise.robot.vehicles.kernels import rk4_stages

BLOCK = 64
"""Vehicles that one thread takes at a time, with one set of work arrays: small, so that few vehicles feed all cores."""


def pack_bodies(bodies: Sequence[RigidBody]) -> Array:
    """Parameters of several vehicles for `step_batch`, shape (n, 20, 6); pack once, step often.

    Raises InputError if there is none.
    """
    if not bodies:
        raise InputError("bodies: none, allowed one or more")
    return np.stack([body.packed for body in bodies])


def step_batch(
    bodies: RigidBody | Array,
    states: ArrayLike,
    wrenches_B: ArrayLike,
    dt_s: float,
    *,
    currents_W_m_s: ArrayLike | None = None,
    steps: int = 1,
    out: Array | None = None,
) -> Array:
    """Advance N vehicles by `steps` steps of `dt_s`, wrenches and currents held constant.

    With arrays of float64 in C order, and `out`, nothing of size N is made or copied but the states.

    `bodies`, shape (1, 20, 6): one for all, or a row for each vehicle from `pack_bodies`. `states`, shape (N, 13):
    position in W (m), unit quaternion q_WB, twist in B relative to the world (m/s, rad/s). `wrenches_B`, shape (N, 6):
    in N and N m. Of thrusts, shape (N, n), it is `thrusts_N @ vehicle.allocation_matrix.T`: thrusters follow at once
    here, without lag or dead zone. `dt_s`: unstable beyond 2.78 over the fastest rate of decay, as `step_rk4` is: mind
    it where bodies are drawn at random. `currents_W_m_s`, shape (N, 3): velocity of the water round each vehicle or all
    of them, constant in the world; still water if not given. `out`, shape (N, 13): where the new states go; may be
    `states`. Returns ndarray, shape (N, 13): `out` if it was given. Raises InputError if a shape disagrees, `dt_s` is
    not positive, or `out` cannot be written.
    """
    packed = bodies.packed[np.newaxis] if isinstance(bodies, RigidBody) else np.asarray(bodies, dtype=np.float64)
    start = np.asarray(states, dtype=np.float64)
    if start.ndim != 2 or start.shape[1] != 13:
        raise InputError(f"states: shape {start.shape}, allowed (N, 13): position, quaternion, twist")
    n = len(start)
    if packed.shape not in ((1, 20, 6), (n, 20, 6)):
        raise InputError(f"bodies: shape {packed.shape}, allowed (1, 20, 6) or ({n}, 20, 6) as pack_bodies makes it")
    wrench = _rows("wrenches_B", wrenches_B, (n, 6))
    current = _rows("currents_W_m_s", np.zeros(3) if currents_W_m_s is None else currents_W_m_s, (n, 3), (3,))
    current = current.reshape(-1, 3)
    if not (math.isfinite(dt_s) and dt_s > 0.0):
        raise InputError(f"dt_s: {dt_s:g}, must be finite and more than 0")
    if steps < 1:
        raise InputError(f"steps: {steps}, allowed 1 or more")
    if out is None:
        out = np.empty((n, 13))
    elif out.shape != (n, 13) or out.dtype != np.float64 or not (out.flags.c_contiguous and out.flags.writeable):
        raise InputError(f"out: {out.dtype} of shape {out.shape}, allowed float64 ({n}, 13), writable and in C order")
    if out is not start:
        out[:] = start
    batch_kernel(_plain(packed), out, wrench, current, float(dt_s), int(steps))
    return out


@njit(parallel=True)
def batch_kernel(packed: Array, states: Array, wrenches: Array, currents: Array, dt_s: float, steps: int) -> None:
    """Advance `states`, shape (N, 13), in place; `packed` and `currents` have N rows or one for all."""
    n = states.shape[0]
    for block in prange((n + BLOCK - 1) // BLOCK):
        stages, inputs = np.empty((5, 13)), np.empty(9)
        for k in range(block * BLOCK, min(n, (block + 1) * BLOCK)):
            body = packed[k if packed.shape[0] > 1 else 0]
            assign(inputs[:6], wrenches[k])
            assign(inputs[6:], currents[k if currents.shape[0] > 1 else 0])
            for _ in range(steps):
                rk4_stages(body, states[k], inputs, dt_s, stages)


def _rows(name: str, values: ArrayLike, *shapes: tuple[int, ...]) -> Array:
    array = np.asarray(values, dtype=np.float64)
    if array.shape not in shapes:
        raise InputError(f"{name}: shape {array.shape}, allowed {' or '.join(str(shape) for shape in shapes)}")
    return _plain(array)


def _plain(array: Array) -> Array:
    """In C order and writable, by a copy if need be: the kernel is compiled for that kind of array alone."""
    return np.require(array, requirements=("C", "W"))
