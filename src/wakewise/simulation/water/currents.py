"""Ambient flow: steady current, series, Airy waves, jet of a pump, background turbulence as Fourier modes.

Each is a velocity field `velocity(points_W_m, time_s)`; they add up. Ambient flow moves vehicle, jets and silt;
"excess" velocities leave it out. It is not disturbed by vehicle or target.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from wakewise.core.arrays import Array, freeze, frozen
from wakewise.core.checks import has_methods
from wakewise.core.constants import GRAVITY_M_S2
from wakewise.core.errors import InputError
from wakewise.core.interfaces import Current
from wakewise.core.jit.njit import njit
from wakewise.core.plugins import reason_of
from wakewise.simulation.water.faces import TankFaces
from wakewise.simulation.water.induction import impulse_velocity
from wakewise.simulation.water.round_jet_closure import PLAIN

_TURN = 2.0 * math.pi
_PER_TURN = 1.0 / _TURN


@njit(apart=True, nogil=True, fastmath=True)
def add_modes(points: Array, waves: Array, turned: Array, cosines: Array, sines: Array, out: Array) -> None:
    """Add sum_j a_j cos(k_j . x + p_j) + b_j sin(k_j . x + p_j) to `out`, shape (n, 3), at points x, shape (n, 3).

    `waves` k, `cosines` a and `sines` b have shape (3, m), `turned` p shape (m,).

    Sine and cosine of half the angle come from their power series about zero, which at a quarter of a turn leave out
    5e-14; so the loop has no branch, and does several modes at once.
    """
    for i in range(points.shape[0]):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        u = v = w = 0.0
        for j in range(turned.shape[0]):
            angle = waves[0, j] * x + waves[1, j] * y + waves[2, j] * z + turned[j]
            turns = angle * _PER_TURN
            h = 0.5 * _TURN * (turns - math.floor(turns + 0.5))
            q = h * h
            s = 1.0 - q / 272.0
            s = 1.0 - q / 210.0 * s
            s = 1.0 - q / 156.0 * s
            s = 1.0 - q / 110.0 * s
            s = 1.0 - q / 72.0 * s
            s = 1.0 - q / 42.0 * s
            s = 1.0 - q / 20.0 * s
            s = h * (1.0 - q / 6.0 * s)
            c = 1.0 - q / 306.0
            c = 1.0 - q / 240.0 * c
            c = 1.0 - q / 182.0 * c
            c = 1.0 - q / 132.0 * c
            c = 1.0 - q / 90.0 * c
            c = 1.0 - q / 56.0 * c
            c = 1.0 - q / 30.0 * c
            c = 1.0 - q / 12.0 * c
            c = 1.0 - q / 2.0 * c
            sine, cosine = 2.0 * s * c, 1.0 - 2.0 * s * s
            u += cosine * cosines[0, j] + sine * sines[0, j]
            v += cosine * cosines[1, j] + sine * sines[1, j]
            w += cosine * cosines[2, j] + sine * sines[2, j]
        out[i, 0] += u
        out[i, 1] += v
        out[i, 2] += w


_ROW_SPACING = 0.6  # of sigma: a row of Gaussians this dense is smooth to 1e-6
_MODES = 48


@dataclass(frozen=True, kw_only=True, eq=False)
class SteadyCurrent:
    """The same velocity, shape (3,), everywhere and always."""

    velocity_W_m_s: Array
    steady: ClassVar[bool] = True
    uniform: ClassVar[bool] = True

    def __post_init__(self) -> None:
        freeze(self, velocity_W_m_s=(3,))

    def velocity(self, points_W_m: Array, time_s: float) -> Array:
        """Velocity of the water, shape (n, 3), the same at all times."""
        del time_s
        out = np.empty((len(points_W_m), 3))
        out[:] = self.velocity_W_m_s
        return out


def wave_number_per_m(period_s: float, depth_m: float) -> float:
    """Solve Airy's dispersion relation omega^2 = g k tanh(k h) for k, to rounding."""
    omega2 = (2 * math.pi / period_s) ** 2 / GRAVITY_M_S2
    # Start of Eckart 1952, good to 5 %; Newton then doubles the digits each round.
    k = omega2 / math.sqrt(math.tanh(omega2 * depth_m))
    for _ in range(6):
        t = math.tanh(k * depth_m)
        k -= (k * t - omega2) / (t + k * depth_m * (1 - t * t))
    return k


@dataclass(frozen=True, kw_only=True, eq=False)
class AiryWave:
    """Orbital velocity of a linear progressive wave over a flat bed.

    Along the heading u = a w cosh(k (h - z)) / sinh(k h) cos(k s - w t), upwards a w sinh(k (h - z)) / sinh(k h)
    sin(k s - w t), at depth z below the still surface and distance s along the heading (R. G. Dean and R. A. Dalrymple,
    Water Wave Mechanics for Engineers and Scientists, World Scientific 1991, chapter 3). No drift, no breaking.
    """

    amplitude_m: float
    period_s: float
    heading_rad: float
    depth_m: float

    @property
    def number_per_m(self) -> float:
        """Wave number k."""
        return wave_number_per_m(self.period_s, self.depth_m)

    def velocity(self, points_W_m: Array, time_s: float) -> Array:
        """Velocity of the water, shape (n, 3)."""
        omega, k = 2 * math.pi / self.period_s, self.number_per_m
        ahead = np.array([math.cos(self.heading_rad), math.sin(self.heading_rad)])
        phase = k * (points_W_m[:, :2] @ ahead) - omega * time_s
        height = k * np.clip(self.depth_m - points_W_m[:, 2], 0.0, self.depth_m)
        scale = self.amplitude_m * omega / math.sinh(k * self.depth_m)
        along = scale * np.cosh(height) * np.cos(phase)
        up = scale * np.sinh(height) * np.sin(phase)
        return np.column_stack([along * ahead[0], along * ahead[1], -up])


@dataclass(frozen=True, kw_only=True, eq=False)
class PumpJet:
    """A steady round jet from a fixed outlet: a standing row of the impulse parcels that thrusters' jets are made of.

    It therefore has their speed on the axis, width, entrainment and image in the bed, and is free of divergence. The
    row ends where it leaves the tank; a jet that runs into the bed bends along it, but makes no wall jet.
    """

    outlet_W_m: Array
    towards_W: Array
    speed_m_s: float
    diameter_m: float
    bed_z_m: float
    reach_m: float
    steady: ClassVar[bool] = True
    _row: tuple[Array, Array] = field(init=False, repr=False)
    _sources: tuple[Array, Array, Array] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        freeze(self, outlet_W_m=(3,), towards_W=(3,))
        length = float(np.linalg.norm(self.towards_W))
        if length < 1e-9:
            raise InputError("tank.pump.towards: a direction of no length, must point somewhere")
        momentum = 0.25 * math.pi * self.diameter_m**2 * self.speed_m_s**2
        core_m = PLAIN.core_D * self.diameter_m
        x, places, sigmas, impulses = 0.0, [], [], []
        while x < self.reach_m:
            core = x < core_m
            widening = PLAIN.core_spread if core else PLAIN.spread
            sigma = (self.diameter_m / math.sqrt(8) if core else 0.0) + widening * x
            speed = self.speed_m_s * min(1.0, core_m / max(x, 1e-9))
            advected = (self.diameter_m / math.sqrt(8) / sigma) ** 2 if core else 0.5
            step = _ROW_SPACING * sigma
            # A parcel stays in its stretch of the row for step / (carried speed) and holds the jet's impulse of then.
            impulses.append(momentum * step / (advected * speed))
            places.append(x + step / 2)
            sigmas.append(sigma + widening * step / 2)
            x += step
        unit = self.towards_W / length
        row = self.outlet_W_m + np.array(places)[:, None] * unit
        row[:, 2] = np.minimum(row[:, 2], 2 * self.bed_z_m - row[:, 2])
        inside = row[:, 2] >= 0.0
        impulse = np.array(impulses)[:, None] * unit
        row, impulse, size = row[inside], impulse[inside], np.array(sigmas)[inside]
        room = TankFaces.of(self.bed_z_m, (math.inf, math.inf), surface=False)
        object.__setattr__(self, "_row", (row, size))
        object.__setattr__(self, "_sources", room.with_images(row, impulse, size))

    def velocity(self, points_W_m: Array, time_s: float) -> Array:
        """Velocity of the water, shape (n, 3), the same at all times."""
        del time_s
        u = impulse_velocity(points_W_m, *self._sources)
        u[points_W_m[:, 2] == self.bed_z_m, 2] = 0.0  # there is only rounding
        return u

    def stirred_bed(self) -> Array:
        """Circles (x, y, radius), shape (n, 3), in which the jet sweeps the bed."""
        row, sigmas = self._row
        near = self.bed_z_m - row[:, 2] < 4 * sigmas
        return np.column_stack([row[near, :2], 4 * sigmas[near]])


@dataclass(frozen=True, kw_only=True, eq=False)
class BackgroundTurbulence:
    """Isotropic, divergence-free, homogeneous fluctuation: a sum of random Fourier modes.

    R. H. Kraichnan 1970, Phys. Fluids 13, 22 (doi 10.1063/1.1692799): u = sum over modes of a x k_hat cos(k.x + w t) +
    b x k_hat sin(k.x + w t), of equal energy, with k normal with 1/L per axis (a spectrum E ~ k^2 exp(-(k L)^2 / 2))
    and w normal with |k| times the rms. It is statistical water: no wall, bed or surface shapes it.
    """

    wave_numbers_per_m: Array  # shape (m, 3)
    # cosines_m_s, sines_m_s: shape (m, 3)
    cosines_m_s: Array
    sines_m_s: Array
    frequencies_rad_s: Array  # shape (m,)
    _columns: tuple[Array, Array, Array] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        m = len(self.frequencies_rad_s)
        freeze(self, wave_numbers_per_m=(m, 3), cosines_m_s=(m, 3), sines_m_s=(m, 3), frequencies_rad_s=(m,))
        rows = self.wave_numbers_per_m, self.cosines_m_s, self.sines_m_s
        object.__setattr__(self, "_columns", tuple(np.ascontiguousarray(one.T) for one in rows))

    @classmethod
    def drawn(cls, rms_m_s: float, length_m: float, rng: np.random.Generator) -> BackgroundTurbulence:
        """Draw modes for a root mean square per component and a length of the energetic eddies."""
        # k from a Maxwell distribution of three normals has the density k^2 exp(-k^2 / 2 s^2) of isotropic modes.
        k = rng.standard_normal((_MODES, 3)) / length_m
        size = np.linalg.norm(k, axis=1)
        unit = k / size[:, None]
        a, b = np.cross(rng.standard_normal((2, _MODES, 3)), unit)
        # Each mode's a has two of three components left, so its mean square per axis is 2/3.
        scale = rms_m_s / math.sqrt(_MODES * 2 / 3)
        return cls(
            wave_numbers_per_m=k,
            cosines_m_s=scale * a,
            sines_m_s=scale * b,
            frequencies_rad_s=rng.standard_normal(_MODES) * size * rms_m_s,
        )

    def velocity(self, points_W_m: Array, time_s: float) -> Array:
        """Velocity of the water, shape (n, 3)."""
        u = np.zeros((len(points_W_m), 3))
        self.add_velocity(points_W_m, time_s, u)
        return u

    def add_velocity(self, points_W_m: Array, time_s: float, out: Array) -> None:
        """Add the velocity of the water to `out`, shape (n, 3)."""
        waves, cosines, sines = self._columns
        add_modes(np.ascontiguousarray(points_W_m), waves, self.frequencies_rad_s * time_s, cosines, sines, out)


class NamedCurrent:
    """A current from outside: what it answers is checked, and InputError gives its name and the reason."""

    def __init__(self, current: Current, name: str) -> None:
        self._current, self._name = has_methods(current, ("velocity",), "what it gave", "current"), name
        self.steady, self.uniform = (bool(getattr(current, word, False)) for word in ("steady", "uniform"))
        self.end_s = float(getattr(current, "end_s", math.inf))

    def velocity(self, points_W_m: Array, time_s: float) -> Array:
        """Velocity of the water, shape (n, 3)."""
        return self._asked("velocity", len(points_W_m), points_W_m, time_s)

    def stirred_bed(self) -> Array:
        """Circles, shape (n, 3), as `Current`; none where it says nothing of them."""
        return self._asked("stirred_bed", None) if hasattr(self._current, "stirred_bed") else np.zeros((0, 3))

    def _asked(self, method: str, rows: int | None, *given: Any) -> Array:
        try:
            return frozen(getattr(self._current, method)(*given), (rows, 3), "what it gave")
        except MemoryError:
            raise
        except Exception as fault:
            words = fault if isinstance(fault, InputError) else f"raised {reason_of(fault)}"
            raise InputError(f"current '{self._name}': {method}: {words}") from fault


@dataclass(frozen=True, kw_only=True, eq=False)
class AmbientSum:
    """Several motions at once; none at all is still water."""

    parts: tuple[Current, ...] = ()

    @cached_property
    def steady(self) -> bool:
        """Whether nothing in it changes with time."""
        return all(getattr(part, "steady", False) for part in self.parts)

    @cached_property
    def uniform(self) -> bool:
        """Whether it is the same everywhere."""
        return all(getattr(part, "uniform", False) for part in self.parts)

    @property
    def end_s(self) -> float:
        """Last instant that it is known for; infinite without a series."""
        return min((float(getattr(part, "end_s", math.inf)) for part in self.parts), default=math.inf)

    def velocity(self, points_W_m: Array, time_s: float) -> Array:
        """Velocity of the water, shape (n, 3)."""
        total = np.empty((len(points_W_m), 3))
        total[:] = self._even_m_s
        for part in self._uneven:
            # Turbulence, which is asked for most, adds to what is there: of a few points a new array costs as much.
            if isinstance(part, BackgroundTurbulence):
                part.add_velocity(points_W_m, time_s, total)
            else:
                total += part.velocity(points_W_m, time_s)
        return total

    @cached_property
    def _even_m_s(self) -> Array:
        """Sum of the steady currents, shape (3,)."""
        even = [part.velocity_W_m_s for part in self.parts if isinstance(part, SteadyCurrent)]
        return np.asarray(sum(even, np.zeros(3)))

    @cached_property
    def _uneven(self) -> tuple[Current, ...]:
        return tuple(part for part in self.parts if not isinstance(part, SteadyCurrent))

    def stirred_bed(self) -> Array:
        """Circles (x, y, radius), shape (n, 3), in which it sweeps the bed faster than it does elsewhere."""
        circles = [part.stirred_bed() for part in self.parts if hasattr(part, "stirred_bed")]
        return np.concatenate([np.zeros((0, 3)), *circles])
