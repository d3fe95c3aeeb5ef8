"""Soft or loose target in the tank's water: bending, swinging, sliding.

Load: drag of the whole water (current, waves, jets) relative to the surface, 1/4 rho Cd |S . r| r for a piece of area
vector S in water that passes at r; over a branch or blade this sums to 1/2 rho Cd times its frontal area. The flow is
that without the target, as drag coefficients are stated. Accelerated water adds pressure force and added mass (J. R.
Morison et al. 1950, Trans. AIME 189, 149, doi 10.2118/950149-G), for currents and waves only.

Integration: drag is linearised in the tip's velocity, the restoring force in its deflection, and the linear oscillator
is solved in closed form, so it is stable for any stiffness and drag. The water does not react to the target's motion.

A second set of stems moves in the ambient flow alone; the difference is the vehicle's effect.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from wakewise.core.arrays import Array, IntArray, freeze
from wakewise.core.errors import InputError
from wakewise.core.interfaces import Current, TargetDeformation
from wakewise.core.jit.njit import njit
from wakewise.scene.targets import BendingModes, Target
from wakewise.scene.targets.elasticity import MAX_DEFLECTION_SHARE, ways_m
from wakewise.simulation.tank.water_truth import surface_samples
from wakewise.simulation.water.water_snapshot import WaterSnapshot

_POINTS = 300
_PER_RADIAN = 4.0
"""Steps that the motion takes while its phase goes on by one radian."""
DRAG = 1.2
"""Drag coefficient of what is no soft tissue: a cylinder's (see `wakewise.scene.targets.elasticity`)."""
STOPS_AT = 0.8
"""Share of a stem's height at which a tip stops, beyond all that the theory of its bending holds for."""
_LEAST_KEPT = 0.1  # share of its height that a piece of a stem keeps at least


@dataclass(frozen=True, kw_only=True, eq=False)
class UnanchoredTarget:
    """A target that lies on the bed and is not held there.

    `weight_N` is its weight in water, `friction` the coefficient between it and the bed.
    """

    weight_N: float
    friction: float


@dataclass(frozen=True, kw_only=True, eq=False)
class TargetCompliance:
    """How a target gives way: `sway` if it bends, with the coefficient `drag`, and `loose` if it can slide."""

    drag: float
    sway: BendingModes | None = None
    loose: UnanchoredTarget | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class SurfaceElements:
    """Surface of a target in pieces: `points_W_m` (n, 3), outward `areas_m2` (n, 3), and the stem of each, `stem` (n,).

    `shape`, `slope` and `drop` (n, 2) are those of the stem's modes there (see `BendingModes.at`), zero where nothing
    moves.
    """

    points_W_m: Array
    areas_m2: Array
    stem: IntArray
    shape: Array
    slope: Array
    drop: Array

    def __post_init__(self) -> None:
        n = len(self.points_W_m)
        freeze(self, points_W_m=(n, 3), areas_m2=(n, 3), shape=(n, 2), slope=(n, 2), drop=(n, 2))

    @classmethod
    def of(cls, target: Target, sway: BendingModes | None) -> SurfaceElements:
        """Pieces of equal area of the part above the bed; the same target always gives the same."""
        points, areas, faces = surface_samples(target, _POINTS, np.random.default_rng(0))
        stem = np.full(len(points), -1, dtype=np.int64)
        tables = (np.zeros((len(points), 2)),) * 3
        if sway is not None:
            stem = np.ascontiguousarray(sway.stem[target.mesh.faces[faces]].max(axis=1))
            tables = sway.at(stem, points[:, 2])
        return cls(points_W_m=points, areas_m2=areas, stem=stem, shape=tables[0], slope=tables[1], drop=tables[2])


@dataclass(eq=False)
class TargetMotion:
    """Moves a target through the water's steps."""

    target: Target
    yielding: TargetCompliance
    density_kg_m3: float  # of the water
    ambient: Current  # the water's own motion
    tips_m: Array = field(init=False)
    speeds_m_s: Array = field(init=False)
    alone_m: Array = field(init=False)
    shift_m: Array = field(init=False)
    drag_N: float = field(init=False, default=0.0)
    _pieces: SurfaceElements = field(init=False)
    _before: Array | None = field(init=False, default=None)
    _ambient_before: Array | None = field(init=False, default=None)
    _alone_m_s: Array = field(init=False)
    _alone_before: Array | None = field(init=False, default=None)

    def __post_init__(self) -> None:
        self.sway, self.loose = self.yielding.sway, self.yielding.loose
        self.drag_kg_m3 = self.yielding.drag * self.density_kg_m3
        stems = 0 if self.sway is None else len(self.sway.height_m)
        self.tips_m, self.speeds_m_s, self.shift_m = np.zeros((stems, 2)), np.zeros((stems, 2)), np.zeros(2)
        self._pieces = SurfaceElements.of(self.target, self.sway)
        self._modes = _modes(self.sway)
        pieces = self._pieces
        self._middles_W_m = np.array([pieces.points_W_m[pieces.stem == k].mean(axis=0) for k in range(stems)])
        if self.sway is not None:  # it has stood in its current long before the flight
            water = self.ambient.velocity(pieces.points_W_m, 0.0)
            self.tips_m = static_deflection_m(pieces, self.sway, self.drag_kg_m3, water)
        self.alone_m, self._alone_m_s = self.tips_m, self.speeds_m_s

    def step(self, now: WaterSnapshot, dt_s: float) -> None:
        """Go on by the water's step that ends at this instant."""
        points = self._pieces.points_W_m + np.append(self.shift_m, 0.0)
        ambient = self.ambient.velocity(points, now.time_s)
        water = now.jets(points) + ambient
        before = water if self._before is None else self._before
        load = self._push(now.time_s, dt_s)
        self._before = water
        if self.sway is None:
            force = drag_N(water, self._pieces.areas_m2, self.drag_kg_m3)
        else:
            self.tips_m, self.speeds_m_s, force = self._swung(
                self.sway, self.tips_m, self.speeds_m_s, load, before, water, dt_s
            )
            alone_before = ambient if self._alone_before is None else self._alone_before
            self._alone_before = ambient
            self.alone_m, self._alone_m_s, _ = self._swung(
                self.sway, self.alone_m, self._alone_m_s, load, alone_before, ambient, dt_s
            )
        self.drag_N = float(np.linalg.norm(force))
        if self.loose is not None:
            slid = slide_m_s(force[:2], water[:, :2].mean(axis=0), self.loose.friction * self.loose.weight_N)
            self.shift_m = self.shift_m + dt_s * slid

    def _swung(
        self, sway: BendingModes, tips: Array, speeds: Array, load: Array, before: Array, water: Array, dt_s: float
    ) -> tuple[Array, Array, Array]:
        """Tips and their speeds after a step through water, shape (n, 3) each, and the drag on the whole, (3,)."""
        pieces, force = self._pieces, np.zeros(3)
        tips, speeds = tips.copy(), speeds.copy()
        integrate_modes(
            tips, speeds, force, self._modes, sway.axes_W, load, pieces.stem, pieces.areas_m2,
            pieces.shape, pieces.slope, pieces.drop, np.ascontiguousarray(before), np.ascontiguousarray(water),
            self.drag_kg_m3, dt_s, substeps(sway, dt_s),
        )  # fmt: skip
        return tips, speeds, force

    def posture(self) -> TargetDeformation:
        """Where the target is now, and how far its surface has come from its shape at rest."""
        away = alone = np.zeros((len(self._pieces.points_W_m), 3))
        stress = 0.0
        if self.sway is not None:
            stem, pieces = np.maximum(self._pieces.stem, 0), self._pieces
            away, alone = (
                ways_m(tips[stem], pieces.shape, pieces.drop, self.sway.axes_W[stem])
                for tips in (self.tips_m, self.alone_m)
            )
            stress = float(np.hypot.reduce(self.tips_m * self.sway.stress_Pa_m, axis=1).max())
        far = np.linalg.norm(away, axis=1)
        return TargetDeformation(
            tips_m=self.tips_m,
            tip_speeds_m_s=self.speeds_m_s,
            shift_m=self.shift_m,
            sway_m=float(np.sqrt(np.mean(far**2))),
            sway_peak_m=float(far.max()),
            sway_mean_W_m=away.mean(axis=0),
            target_stress_Pa=stress,
            sway_wash_m=float(np.sqrt(np.mean(np.sum((away - alone) ** 2, axis=1)))),
            drag_N=self.drag_N,
        )

    def _push(self, time_s: float, dt_s: float) -> Array:
        """Load on each mode from the acceleration of the water's own motion, shape (k, 2)."""
        if self.sway is None or getattr(self.ambient, "steady", False):
            return np.zeros_like(self.tips_m)
        here = self.ambient.velocity(self._middles_W_m, time_s)
        gained = np.zeros_like(here) if self._ambient_before is None else (here - self._ambient_before) / dt_s
        self._ambient_before = here
        return np.asarray(self.sway.moved_water_kg * np.einsum("kij,kj->ki", self.sway.axes_W, gained[:, :2]))


def substeps(sway: BendingModes, dt_s: float) -> int:
    """Into how many steps a step of the water is divided; modes faster than the water is known follow it at once."""
    fastest = min(float(sway.frequency_Hz.max()), fastest_Hz(dt_s))
    return max(2, math.ceil(_PER_RADIAN * 2.0 * math.pi * fastest * dt_s))


def fastest_Hz(flow_step_s: float) -> float:
    """Frequency up to which water that is known each step can drive anything (Nyquist's)."""
    return 0.5 / flow_step_s


def check_sway(
    target: Target, sway: BendingModes, drag: float, water_m_s: Array, density_kg_m3: float, step_s: float
) -> None:
    """Refuse a target that is too stiff or too soft to be moved by the water's steps.

    - `water_m_s`, shape (3,): the fastest current that it stands in.
    - `density_kg_m3`: of the water.
    - `step_s`: the water's.

    Raises InputError: with the figures: its slowest mode is faster than the water is known, or the current bends it
    beyond half.
    """
    slowest, known = float(sway.frequency_Hz[:, 0].min()), fastest_Hz(step_s)
    if slowest > known:
        raise InputError(
            f"target.elasticity: {target.name} swings at {slowest:.3g} Hz or more, but water known each "
            f"{1e3 * step_s:g} ms "
            f"moves what swings below {known:g} Hz; too stiff: let target.elasticity be none, or "
            "target.stiffness_Pa less"
        )
    tips = static_deflection_m(SurfaceElements.of(target, sway), sway, drag * density_kg_m3, water_m_s)
    share = float((np.linalg.norm(tips, axis=1) / sway.height_m).max())
    if share > MAX_DEFLECTION_SHARE:
        raise InputError(
            f"target.elasticity: a current of {np.linalg.norm(water_m_s):.2g} m/s bends {target.name} by "
            f"{share:.2g} of its "
            f"height, the theory of its bending holds to {MAX_DEFLECTION_SHARE:g}; too soft: "
            f"let target.stiffness_Pa be more"
        )


def check_loose(target: Target, yielding: TargetCompliance, water_m_s: Array, density_kg_m3: float) -> None:
    """Refuse a target that its current, (3,), carries away before any thruster turns.

    Raises InputError: with the drag and the friction.
    """
    if yielding.loose is None:
        return
    areas = SurfaceElements.of(target, None).areas_m2
    push_N = drag_N(np.broadcast_to(water_m_s, areas.shape), areas, yielding.drag * density_kg_m3)
    pushed, holds = float(np.hypot(push_N[0], push_N[1])), yielding.loose.friction * yielding.loose.weight_N
    if pushed > holds:
        raise InputError(
            f"target.unanchored: a current of {np.linalg.norm(water_m_s):.2g} m/s pushes {target.name} with "
            f"{pushed:.2g} N, "
            f"friction holds {holds:.2g} N; let target.unanchored.weight_N be more"
        )


def static_deflection_m(pieces: SurfaceElements, sway: BendingModes, drag_kg_m3: float, water_m_s: Array) -> Array:
    """Ways of the tips, shape (k, 2), in which a stream of even velocity, (3,), or (n, 3) at the pieces, holds them."""
    tips, speeds = np.zeros((len(sway.height_m), 2)), np.zeros((len(sway.height_m), 2))
    modes, none, force = _modes(sway), np.zeros((len(sway.height_m), 2)), np.zeros(3)
    # Damped more than critically, so that it comes to rest in a few periods of the slowest.
    modes[:, :, 3] = 4.0 * np.sqrt(modes[:, :, 0] * modes[:, :, 1])
    water = np.ascontiguousarray(np.broadcast_to(water_m_s, pieces.points_W_m.shape))
    lasts = 8.0 / float(sway.frequency_Hz.min())
    integrate_modes(
        tips, speeds, force, modes, sway.axes_W, none, pieces.stem, pieces.areas_m2, pieces.shape, pieces.slope,
        pieces.drop, water, water, drag_kg_m3, lasts, 400,
    )  # fmt: skip
    return tips


def drag_N(passing_m_s: Array, areas_m2: Array, drag_kg_m3: float) -> Array:
    """Drag, shape (3,), on pieces of area vectors (n, 3) that stand in water (n, 3); `drag_kg_m3` is rho Cd."""
    share = 0.25 * drag_kg_m3 * np.abs(np.einsum("nj,nj->n", areas_m2, passing_m_s))
    return np.asarray(share @ passing_m_s)


def slide_m_s(force_N: Array, water_m_s: Array, holds_N: float) -> Array:
    """Velocity, shape (2,), at which what is pushed by more than friction slides; zero where friction holds.

    Drag grows with the square of the water's speed past it, so what slides steadily lets the water pass at that share
    of its speed at which drag equals friction.
    """
    push = float(np.hypot(force_N[0], force_N[1]))
    if push <= holds_N:
        return np.zeros(2)
    along = force_N / push
    return np.asarray(along * abs(float(water_m_s @ along)) * (1.0 - math.sqrt(holds_N / push)))


def _modes(sway: BendingModes | None) -> Array:
    """Mass, stiffness, hardening, damping and farthest way of each mode, shape (k, 2, 5)."""
    if sway is None:
        return np.zeros((0, 2, 5))
    far = np.broadcast_to(STOPS_AT * sway.height_m[:, None], sway.mass_kg.shape)
    return np.stack([sway.mass_kg, sway.stiffness_N_m, sway.hardening_N_m3, sway.damping_N_s_m, far], axis=2)


@njit
def integrate_modes(
    tips: Array, speeds: Array, force: Array, modes: Array, axes: Array, load: Array, stem: IntArray, areas: Array,
    shape: Array, slope: Array, drop: Array, before: Array, after: Array, drag: float, dt: float, steps: int,
) -> None:  # fmt: skip
    """Move tips and their speeds, shape (k, 2), on by dt in `steps`; write the drag on the whole, shape (3,).

    Water at the pieces goes evenly from `before` to `after`, shape (n, 3); `load` (k, 2) is what else pushes the modes.
    """
    h = dt / steps
    stems = tips.shape[0]
    pushes, slows = np.empty((stems, 2)), np.empty((stems, 2))
    reach = np.empty((2, 3))
    for s in range(steps):
        share = (s + 0.5) / steps
        force[0], force[1], force[2] = 0.0, 0.0, 0.0
        for k in range(stems):
            for i in range(2):
                pushes[k, i], slows[k, i] = load[k, i], 0.0
        for n in range(stem.shape[0]):
            k = stem[n]
            rx = before[n, 0] + share * (after[n, 0] - before[n, 0])
            ry = before[n, 1] + share * (after[n, 1] - before[n, 1])
            rz = before[n, 2] + share * (after[n, 2] - before[n, 2])
            ax, ay, az = areas[n, 0], areas[n, 1], areas[n, 2]
            if k >= 0:
                wx, wy = 0.0, 0.0
                for i in range(2):
                    reach[i, 0], reach[i, 1] = axes[k, i, 0] * shape[n, i], axes[k, i, 1] * shape[n, i]
                    reach[i, 2] = 2.0 * tips[k, i] * drop[n, i]
                    rx -= speeds[k, i] * reach[i, 0]
                    ry -= speeds[k, i] * reach[i, 1]
                    rz -= speeds[k, i] * reach[i, 2]
                    wx += tips[k, i] * slope[n, i] * axes[k, i, 0]
                    wy += tips[k, i] * slope[n, i] * axes[k, i, 1]
                az += ax * wx + ay * wy
                keeps = max(1.0 - 0.5 * (wx * wx + wy * wy), _LEAST_KEPT)
                ax *= keeps
                ay *= keeps
            facing = ax * rx + ay * ry + az * rz
            c = 0.25 * drag * abs(facing)
            force[0] += c * rx
            force[1] += c * ry
            force[2] += c * rz
            if k >= 0:
                sign = 0.25 * drag * np.sign(facing)
                for i in range(2):
                    along = rx * reach[i, 0] + ry * reach[i, 1] + rz * reach[i, 2]
                    own = reach[i, 0] ** 2 + reach[i, 1] ** 2 + reach[i, 2] ** 2
                    turned = ax * reach[i, 0] + ay * reach[i, 1] + az * reach[i, 2]
                    pushes[k, i] += c * along
                    slows[k, i] += max(c * own + sign * along * turned, 0.0)
        for k in range(stems):
            for i in range(2):
                tips[k, i], speeds[k, i] = _oscillate(
                    tips[k, i], speeds[k, i], pushes[k, i], slows[k, i],
                    modes[k, i, 0], modes[k, i, 1], modes[k, i, 2], modes[k, i, 3], h,
                )  # fmt: skip
                if abs(tips[k, i]) > modes[k, i, 4]:
                    tips[k, i], speeds[k, i] = math.copysign(modes[k, i, 4], tips[k, i]), 0.0


@njit
def _oscillate(
    q: float, v: float, push: float, slow: float, mass: float, stiff: float, hard: float, damp: float, h: float
) -> tuple[float, float]:
    """Solve m q'' + c q' + k q + h q^3 = push - slow (q' - v) exactly over h with the cube made linear about q."""
    k = stiff + 3.0 * hard * q * q
    rest = (push + slow * v + 2.0 * hard * q * q * q) / k
    a, w2 = 0.5 * (damp + slow) / mass, k / mass
    y = q - rest
    spread = w2 - a * a
    if spread > 1e-12 * w2:
        w = math.sqrt(spread)
        fade = math.exp(-a * h)
        c, s = fade * math.cos(w * h), fade * math.sin(w * h) / w
    elif spread < -1e-12 * w2:
        w = math.sqrt(-spread)
        one, two = math.exp((w - a) * h), math.exp(-(w + a) * h)
        c, s = 0.5 * (one + two), 0.5 * (one - two) / w
    else:
        c = math.exp(-a * h)
        s = h * c
    return rest + c * y + s * (v + a * y), c * v - s * (w2 * y + a * v)
