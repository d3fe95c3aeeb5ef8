"""How stiff a vehicle's position loop may be: margins of the sampled loop with thruster lag and estimator delay.

Each axis is taken alone: mass with added mass, linear drag and righting stiffness, a thruster with first-order lag,
thrust held between samples, an estimate that arrives late, and the PID. All of it is linear, so it is discretised
exactly (matrix exponential; K. J. Astrom and B. Wittenmark, Computer-Controlled Systems, 3rd ed., 1997, chapter 2)
and its open-loop response is read on the unit circle.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.linalg import expm

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.robot.vehicles import Vehicle, compile_body, restoring_wrench

GAIN_MARGIN = 2.0
"""Least factor (6 dB) by which the loop's gain may be wrong, up or down, before it is unstable."""

PHASE_MARGIN_RAD = float(np.radians(40.0))
"""Least phase reserve where the loop's gain is one."""


@dataclass(frozen=True, kw_only=True)
class Axis:
    """One degree of freedom: mass (kg or kg m2), drag (per m/s or rad/s) and stiffness (per m or rad) about level."""

    mass: float
    drag: float
    stiffness: float


@dataclass(frozen=True, kw_only=True)
class Gains:
    """PID gains of one axis: force per metre, per metre per second and per metre second (or their angular twins)."""

    kp: float
    kd: float
    ki: float

    def slowed(self, scale: float) -> Gains:
        """Same damping ratio and integral time at `scale` times the bandwidth."""
        return Gains(kp=self.kp * scale**2, kd=self.kd * scale, ki=self.ki * scale**2)


@dataclass(frozen=True, kw_only=True)
class Margins:
    """Reserves of a loop. `gain_up` and `gain_down` are factors (infinite if no gain destabilises), phase in rad."""

    stable: bool
    gain_up: float
    gain_down: float
    phase_rad: float

    @property
    def enough(self) -> bool:
        """Stable with at least `GAIN_MARGIN` and `PHASE_MARGIN_RAD`."""
        return (
            self.stable
            and self.gain_up >= GAIN_MARGIN
            and self.gain_down >= GAIN_MARGIN
            and self.phase_rad >= PHASE_MARGIN_RAD
        )


def vehicle_axes(vehicle: Vehicle) -> tuple[Axis, ...]:
    """The six axes of a vehicle at rest and level, each on its own (couplings are left out)."""
    body = compile_body(vehicle)
    level, angle = np.array([1.0, 0.0, 0.0, 0.0]), 1e-4
    axes = []
    for i in range(6):
        stiffness = 0.0
        if i >= 3:
            tilted = level.copy()
            tilted[i - 2] = 0.5 * angle
            stiffness = float(restoring_wrench(body, level)[i] - restoring_wrench(body, tilted)[i]) / angle
        axes.append(
            Axis(mass=float(body.mass_matrix[i, i]), drag=float(body.linear_damping[i, i]), stiffness=stiffness)
        )
    return tuple(axes)


def open_loop(
    axis: Axis, gains: Gains, dt_s: float, thruster_lag_s: float, estimate_delay_s: float
) -> tuple[Array, ...]:
    """Sampled loop cut at the command: x+ = A x + b u, and the PID's answer -y = c x, with matrices (A, b, c).

    The delay of the estimate is a whole number of samples and a remainder, exact for held inputs: it is lumped with
    the command, which is the same for a loop with one signal.
    """
    tau = max(thruster_lag_s, 1e-4)
    rate = np.array(
        [
            [0.0, 1.0, 0.0],
            [-axis.stiffness / axis.mass, -axis.drag / axis.mass, 1.0 / axis.mass],
            [0.0, 0.0, -1.0 / tau],
        ]
    )
    push = np.array([0.0, 0.0, 1.0 / tau])

    def held(duration: float) -> tuple[Array, Array]:
        whole = np.zeros((4, 4))
        whole[:3, :3], whole[:3, 3] = rate * duration, push * duration
        step = expm(whole)
        return step[:3, :3], step[:3, 3]

    samples, rest = divmod(estimate_delay_s, dt_s)
    Phi, _ = held(dt_s)
    Phi_late, new = held(dt_s - rest)
    _, early = held(rest)
    old = Phi_late @ early
    # States: position, velocity, thrust, integral of position error, then commands of 1, 2, ... samples ago.
    count = round(samples) + 1
    A, b = np.zeros((4 + count, 4 + count)), np.zeros(4 + count)
    A[:3, :3] = Phi
    A[3, 0], A[3, 3] = dt_s, 1.0
    whole_delay = count - 1
    if whole_delay == 0:
        b[:3] = new
    else:
        A[:3, 4 + whole_delay - 1] = new
    A[:3, 4 + whole_delay] = old
    b[4] = 1.0
    for i in range(1, count):
        A[4 + i, 4 + i - 1] = 1.0
    c = np.zeros(4 + count)
    c[:4] = gains.kp, gains.kd, 0.0, gains.ki
    if gains.ki == 0.0:
        # Nobody listens to the integral then; left in, it would count as a pole at 1.
        kept = np.arange(4 + count) != 3
        return A[np.ix_(kept, kept)], b[kept], c[kept]
    return A, b, c


def margins(axis: Axis, gains: Gains, dt_s: float, thruster_lag_s: float, estimate_delay_s: float) -> Margins:
    """Margins of one axis under PID with a late but otherwise perfect estimate."""
    return loop_margins(*open_loop(axis, gains, dt_s, thruster_lag_s, estimate_delay_s))


def loop_margins(A: Array, b: Array, c: Array) -> Margins:
    """Stability (eigenvalues of A - b c), gain margins both ways and phase margin of a sampled loop cut at one place.

    x+ = A x + b u with shapes (n, n) and (n,), and the loop closes with u = -c x.
    """
    closed = np.linalg.eigvals(A - np.outer(b, c))
    angle = np.geomspace(1e-3, np.pi, 600)
    z = np.exp(1j * angle)[:, None]
    # det(zI - A + bc) = det(zI - A) (1 + L(z)): the open loop's response from the eigenvalues alone.
    response = np.prod((z - closed) / (z - np.linalg.eigvals(A)), axis=1) - 1.0
    size = np.abs(response)
    crossing = np.flatnonzero(np.diff(np.sign(size - 1.0)) != 0.0)
    reserve = np.pi - np.abs(np.angle(response[crossing]))
    # The response meets the negative real axis where its imaginary part changes sign and its real part is below zero.
    turning = np.flatnonzero((np.diff(np.sign(response.imag)) != 0.0) & (response.real[:-1] < 0.0))
    at = size[turning]
    up, down = at[at < 1.0], at[at >= 1.0]
    return Margins(
        stable=bool(np.max(np.abs(closed)) < 1.0),
        gain_up=float(np.min(1.0 / up, initial=np.inf)),
        gain_down=float(np.min(down, initial=np.inf)),
        phase_rad=float(np.min(reserve, initial=np.pi)),
    )


REFERENCE_MASS_KG = 11.3
"""Mass with added mass, mean over surge, sway and heave, of the vehicle that the paper's gains are for."""


def desired_gains(axes: tuple[Axis, ...], forces: Gains) -> tuple[Gains, ...]:
    """Gains of all six axes, with the bandwidth of the given ones on the paper's vehicle.

    Forces are scaled by the vehicle's mean mass over that one's, moments further by (I + I_a)/(m + m_a) of the axis.
    """
    size = sum(axis.mass for axis in axes[:3]) / (3.0 * REFERENCE_MASS_KG)
    forces = Gains(kp=forces.kp * size, kd=forces.kd * size, ki=forces.ki * size)
    turning = [axes[3 + i].mass / axes[i].mass for i in range(3)]
    return (forces,) * 3 + tuple(Gains(kp=forces.kp * r, kd=forces.kd * r, ki=forces.ki * r) for r in turning)


def stable_gain_scale(
    vehicle: Vehicle, forces: Gains, dt_s: float, force_delay_s: float, moment_delay_s: float
) -> Array:
    """Largest bandwidth factor per axis, shape (6,), each in (0, 1], at which the margins hold.

    The delays are those of the estimates of position and velocity, and of attitude and rate.

    Raises
    ------
    InputError
        If no factor down to a hundredth gives the margins.
    """
    axes = vehicle_axes(vehicle)
    lag = float(np.max(vehicle.time_constants_s))
    scales = np.ones(6)
    for i, (axis, desired) in enumerate(zip(axes, desired_gains(axes, forces), strict=True)):
        delay_s = force_delay_s if i < 3 else moment_delay_s
        if max(desired.kp, desired.kd, desired.ki) <= 0.0:
            continue
        found = axis_scale(axis, desired, dt_s, lag, delay_s)
        if found is None:
            raise InputError(
                f"gains {forces.kp:g}/{forces.kd:g}/{forces.ki:g}: axis {'XYZKMN'[i]} of '{vehicle.name}' has no "
                f"stable bandwidth at dt {dt_s:g} s, thruster lag {lag:g} s, estimate delay {delay_s:g} s"
            )
        scales[i] = found
    return scales


@lru_cache(maxsize=256)
def axis_scale(axis: Axis, desired: Gains, dt_s: float, lag_s: float, delay_s: float) -> float | None:
    """Largest bandwidth factor of one axis with enough margin: a coarse search downwards, then halving."""

    def enough(scale: float) -> bool:
        return margins(axis, desired.slowed(scale), dt_s, lag_s, delay_s).enough

    tried = [float(s) for s in np.geomspace(1.0, 0.01, 25)]
    good = next((s for s in tried if enough(s)), None)
    if good is None or good == 1.0:
        return good
    low, high = good, good * tried[0] / tried[1]
    for _ in range(8):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if enough(middle) else (low, middle)
    return low
