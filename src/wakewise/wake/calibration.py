"""Least-squares calibration of a wake model: parameters with uncertainty, cross-validated, and the file of a fit.

Minimised is the sum of squared errors of the axial speed over the square root of thrust, so that strong and weak
thrusts count alike. Scores are those of held-out rows.

Momentum check: the momentum flux through any plane across a free jet equals its thrust. Wrong units (kilograms-force
for newtons, feet for metres) change the ratio by a factor of four and more, and no residual shows it.

Calibrated wake models as files: settings that a scenario takes, with their uncertainty as comments. The module is long
because fit, check and file share the record of one calibration.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from wakewise.core.arrays import Array, BoolArray, IntArray
from wakewise.core.constants import FRESH_WATER_KG_M3
from wakewise.core.errors import InputError
from wakewise.core.files import write_text
from wakewise.wake.jets import AxialJet
from wakewise.wake.models import ModelName, WakeSettings, wake_model
from wakewise.wake.samples import JetRegion, JetSamples, WakeScores, score


@dataclass(frozen=True)
class FitParameter:
    """One number of a model, named as in `WakeSettings`. `shapes` is what it tells of: "level", "reach" or "angle"."""

    name: str
    start: float
    low: float
    high: float
    shapes: str


@dataclass(frozen=True)
class WakeFamily:
    """A wake model with its free parameters; none for a model that is never fitted."""

    name: ModelName
    parameters: tuple[FitParameter, ...] = ()

    @property
    def start(self) -> Array:
        """Where the search starts, shape (p,)."""
        return np.array([parameter.start for parameter in self.parameters])

    def settings(self, values: Array) -> WakeSettings:
        """Settings of the model with parameter values, shape (p,)."""
        numbers = {p.name: float(v) for p, v in zip(self.parameters, values, strict=True)}
        return WakeSettings.model_validate({"model": self.name, **numbers})

    def model(self, values: Array) -> AxialJet:
        """The free jet with parameter values, shape (p,)."""
        jet = wake_model(self.settings(values).model_copy(update={"floor": False}))
        if not isinstance(jet, AxialJet):
            raise InputError(f"wake model '{self.name}': has a floor term, only the free jet can be fitted")
        return jet


FAMILIES: dict[str, WakeFamily] = {
    family.name: family
    for family in (
        WakeFamily("paper"),
        WakeFamily("paper-calibrated", (FitParameter("gain", 0.036, 1e-4, 50.0, "level"),)),
        WakeFamily(
            "fitted",
            (
                FitParameter("gain", 0.6, 1e-4, 50.0, "level"),
                FitParameter("decay_power", 0.85, 0.0, 6.0, "reach"),
                FitParameter("cosine_power", 47.0, 0.0, 600.0, "angle"),
                # At most the core of a 60 mm disk's jet, 6.2 diameters; beyond, it only trades with the power.
                FitParameter("soft_radius_m", 0.02, 0.0, 0.37, "reach"),
            ),
        ),
        # Its one number sets width and decay together, through momentum: points on the axis are enough.
        WakeFamily("jet", (FitParameter("half_width_slope", 0.13, 0.05, 0.4, "level"),)),
        WakeFamily(
            "jet-fitted",
            (
                FitParameter("decay", 4.0, 0.05, 50.0, "level"),
                FitParameter("virtual_origin_diameters", 3.0, 0.01, 60.0, "reach"),
                FitParameter("start_width_diameters", 0.5, 0.0, 5.0, "angle"),
                FitParameter("half_width_slope", 0.13, 0.002, 0.8, "angle"),
            ),
        ),
        WakeFamily("linear"),
    )
}
"""Every wake model and what can be fitted of it. Without soft_radius_m the start of `fitted` is the model's default."""


def family(name: str) -> WakeFamily:
    """The family of a wake model that can be fitted.

    Raises InputError if there is no such model, or nothing of it can be fitted.
    """
    fittable = [each.name for each in FAMILIES.values() if each.parameters]
    if name not in fittable:
        why = "has no free parameters" if name in FAMILIES else "unknown"
        raise InputError(f"wake model '{name}': {why}, can be fitted: {', '.join(fittable)}")
    return FAMILIES[name]


AXIS_ANGLE_RAD = math.radians(2.0)
"""If no point lies farther off the axis, nothing can be said about angles."""
_ROWS_PER_PARAMETER = 3
_CELL_M = 0.01


@dataclass(frozen=True, kw_only=True, eq=False)
class WakeCalibration:
    """Result of `calibrate`.

    `values`, `standard_errors`, `lows` and `highs`, shape (p,): estimate, standard error from the Jacobian, and 95 %
    interval of the bootstrap; NaN for a parameter held at its start (`held`) or at a bound of what is allowed.
    """

    family: WakeFamily
    values: Array
    standard_errors: Array
    lows: Array
    highs: Array
    held: tuple[str, ...]
    warnings: tuple[str, ...]
    train: WakeScores
    test: WakeScores
    train_thrusts_N: tuple[float, ...]
    test_thrusts_N: tuple[float, ...]
    split: str
    residual_rms_m_s: float

    @property
    def parameters(self) -> dict[str, float]:
        """Parameter values by name."""
        return {p.name: float(v) for p, v in zip(self.family.parameters, self.values, strict=True)}


@dataclass(frozen=True, kw_only=True, eq=False)
class DataSplit:
    """Rows to fit on and rows to test on, both shape (n,), and in words how they were chosen."""

    train: BoolArray
    test: BoolArray
    words: str


def split_samples(
    samples: JetSamples, rng: np.random.Generator, *, test_thrusts_N: tuple[float, ...] = (), share: float = 0.3
) -> DataSplit:
    """Hold out thrusts and positions together: a test row has a thrust and a place that the fit has not seen.

    Positions are held out in cells of 1 cm, `share` of them, so that no test point has a neighbour in the training set
    closer than chance. Without `test_thrusts_N` a third of the thrusts is drawn, but never the weakest or strongest
    where there are four or more. With one thrust only positions are held out.
    """
    thrusts = samples.thrusts_N
    if len(test_thrusts_N) == 0 and len(thrusts) > 1:
        inner = thrusts[1:-1] if len(thrusts) >= 4 else thrusts
        test_thrusts_N = tuple(float(t) for t in rng.choice(inner, max(1, len(thrusts) // 3), replace=False))
    held_thrust = np.isin(samples.thrust_N, test_thrusts_N)
    if test_thrusts_N and (held_thrust.all() or not held_thrust.any()):
        raise InputError(f"{samples.title}: thrusts held out {test_thrusts_N}, must be some of {thrusts} and not all")
    cells = np.stack([np.floor(samples.x_m / _CELL_M), np.floor(samples.r_m / _CELL_M)])
    _, cell = np.unique(cells, axis=1, return_inverse=True)
    cell = cell.ravel()
    count = int(cell.max()) + 1
    if count < 4:
        raise InputError(f"{samples.title}: points in {count} places only, needs 4 or more apart by {_CELL_M:g} m")
    chosen = rng.permutation(count) < max(1, round(share * count))
    held_place = chosen[cell]
    words = f"{share:.0%} of the positions (cells of {100 * _CELL_M:g} cm, drawn at random) held out"
    if len(thrusts) == 1:
        return DataSplit(train=~held_place, test=held_place, words=words + "; one thrust, the same in both parts")
    named = ", ".join(f"{t:g}" for t in sorted(test_thrusts_N))
    return DataSplit(
        train=~held_place & ~held_thrust,
        test=held_place & held_thrust,
        words=f"thrusts {named} N and {words}; tested where both were held out",
    )


def calibrate(
    family: WakeFamily,
    samples: JetSamples,
    rng: np.random.Generator,
    *,
    split: DataSplit | None = None,
    region: JetRegion | None = None,
    bootstrap: int = 100,
) -> WakeCalibration:
    """Fit the free parameters of a model on training rows and score it on the others.

    - `rng`: draws the split (if none is given) and the bootstrap.
    - `region`: fit only on points in it; scores always use all rows.
    - `bootstrap`: resamples of thrusts and of cells of 1 cm (whole cells, since neighbouring points err together); 0
      for none.

    Raises InputError if rows are too few or the model has no free parameters.
    """
    if not family.parameters:
        raise InputError(f"wake model '{family.name}': has no free parameters, it cannot be fitted")
    parts = split or split_samples(samples, rng)
    fit_rows = parts.train & region.holds(samples) if region else parts.train
    train = samples.take(fit_rows)
    if not len(train) or not parts.test.any():
        part, region_words = ("test", "") if len(train) else ("fit", f" in region {region.name}" if region else "")
        raise InputError(
            f"{samples.title}: none of {len(samples)} rows is left to {part}{region_words} ({parts.words})"
        )
    warnings = list(samples.warnings)
    free, held = _identifiable(family, train, warnings)
    needed = max(10, _ROWS_PER_PARAMETER * int(free.sum()))
    if len(train) < needed:
        raise InputError(
            f"{samples.title}: {len(train)} rows to fit {int(free.sum())} parameters, needs {needed} or more "
            f"({len(samples)} rows in all, the rest are held out)"
        )
    if len(samples.thrusts_N) == 1:
        warnings.append(
            f"one thrust only ({samples.thrusts_N[0]:g} N): the law that speed grows with the square root of thrust "
            "is assumed, not tested"
        )
    values, jacobian, residual = _solve(family, train, family.start, free)
    errors = _standard_errors(jacobian, residual, free)
    lows, highs = _bootstrap(train, family, values, jacobian, residual, free, rng, bootstrap)
    for k, parameter in enumerate(family.parameters):
        span = parameter.high - parameter.low
        if free[k] and min(values[k] - parameter.low, parameter.high - values[k]) < 1e-4 * span:
            warnings.append(f"{parameter.name} stopped at the end of what is allowed ({round(values[k], 9):.4g})")
            errors[k] = lows[k] = highs[k] = np.nan
        elif free[k] and not errors[k] < max(abs(values[k]), 1e-3 * span):
            warnings.append(f"{parameter.name} is not determined by these data (standard error above its value)")
    return WakeCalibration(
        family=family,
        values=values,
        standard_errors=errors,
        lows=lows,
        highs=highs,
        held=held,
        warnings=tuple(warnings),
        train=score(family.model(values), samples.take(parts.train)),
        test=score(family.model(values), samples.take(parts.test)),
        train_thrusts_N=tuple(float(t) for t in train.thrusts_N),
        test_thrusts_N=tuple(float(t) for t in np.unique(samples.thrust_N[parts.test])),
        split=parts.words,
        residual_rms_m_s=float(np.sqrt(np.mean(residual**2 * train.thrust_N))),
    )


def calibrated_values(family: WakeFamily, samples: JetSamples) -> tuple[Array, tuple[str, ...]]:
    """Parameters fitted to all rows, shape (p,), without a test, and the names of those that were held.

    Raises InputError if the points tell none of them.
    """
    free, held = _identifiable(family, samples, [])
    values, _, _ = _solve(family, samples, family.start, free)
    return values, held


def _identifiable(family: WakeFamily, train: JetSamples, warnings: list[str]) -> tuple[BoolArray, tuple[str, ...]]:
    """Which parameters the data can tell, shape (p,); the others are held at their start, which is said."""
    free = np.ones(len(family.parameters), dtype=np.bool_)
    angle = float(train.angle_rad.max())
    distance = train.distance_m
    reach = float(distance.max() / distance.min())
    reasons = {
        "angle": (angle < AXIS_ANGLE_RAD, f"no point is farther than {math.degrees(angle):.1f} deg off the axis"),
        "reach": (
            reach < 1.2,
            f"all points are about as far from the disk ({distance.mean():.2g} m)",
        ),
    }
    for shapes, (unknown, reason) in reasons.items():
        names = [parameter.name for parameter in family.parameters if parameter.shapes == shapes]
        if unknown and names:
            free &= np.array([parameter.shapes != shapes for parameter in family.parameters])
            warnings.append(f"{', '.join(names)} held at the start value: {reason}")
        elif unknown:
            warnings.append(f"{reason}: what '{family.name}' says there follows from its form alone")
    if not free.any():
        raise InputError(f"{train.title}: none of the parameters of '{family.name}' can be told from these points")
    return free, tuple(p.name for p, f in zip(family.parameters, free, strict=True) if not f)


def _solve(family: WakeFamily, train: JetSamples, start: Array, free: BoolArray) -> tuple[Array, Array, Array]:
    """Best values (p,), Jacobian (n, free) and residuals (n,) in m/s/sqrt(N)."""
    low = np.array([p.low for p in family.parameters])[free]
    high = np.array([p.high for p in family.parameters])[free]
    measured = train.speed_m_s / np.sqrt(train.thrust_N)
    values = np.array(start)

    def residual(part: Array) -> Array:
        values[free] = part
        return np.asarray(_unit_speed(family, values, train) - measured)

    inside = np.clip(start[free], low + 1e-6 * (high - low), high - 1e-6 * (high - low))
    found = least_squares(residual, inside, bounds=(low, high), x_scale=np.maximum(np.abs(inside), 1e-3 * (high - low)))
    values[free] = found.x
    return values, np.asarray(found.jac), np.asarray(found.fun)


def _unit_speed(family: WakeFamily, values: Array, samples: JetSamples) -> Array:
    return family.model(values).speed(samples.x_m, samples.r_m, 1.0, samples.disk_area_m2)


def _standard_errors(jacobian: Array, residual: Array, free: BoolArray) -> Array:
    """Square roots of the diagonal of s^2 (J'J)^-1, shape (p,); infinite where the data do not tell."""
    errors = np.full(len(free), np.nan)
    n, p = jacobian.shape
    scale = np.linalg.norm(jacobian, axis=0)
    scale[scale == 0.0] = 1.0
    u, s, vt = np.linalg.svd(jacobian / scale, full_matrices=False)
    del u
    variance = float(residual @ residual) / max(n - p, 1)
    inverse = np.where(s > 1e-8 * s[0], 1.0 / np.maximum(s, 1e-300) ** 2, np.inf) if s[0] > 0 else np.full(p, np.inf)
    with np.errstate(invalid="ignore"):
        spread = np.nansum(np.where(vt.T**2 < 1e-12, 0.0, vt.T**2 * inverse), axis=1)
    errors[free] = np.sqrt(variance * spread) / scale
    return errors


def _bootstrap(
    train: JetSamples,
    family: WakeFamily,
    values: Array,
    jacobian: Array,
    residual: Array,
    free: BoolArray,
    rng: np.random.Generator,
    resamples: int,
) -> tuple[Array, Array]:
    """95 % interval of each free parameter, shapes (p,), from resampled thrusts and cells; NaN without resamples.

    Each resample takes one Gauss-Newton step from the solution, which for small changes is where a new fit would end.
    """
    low, high = np.full(len(free), np.nan), np.full(len(free), np.nan)
    if resamples < 2:
        return low, high
    cells = np.stack([np.floor(train.x_m / _CELL_M), np.floor(train.r_m / _CELL_M)])
    cell = np.unique(cells, axis=1, return_inverse=True)[1].ravel()
    thrust = np.unique(train.thrust_N, return_inverse=True)[1].ravel()
    scale = np.linalg.norm(jacobian, axis=0)
    scale[scale == 0.0] = 1.0
    J = jacobian / scale
    found = np.empty((resamples, int(free.sum())))
    for k in range(resamples):
        times = _drawn(cell, rng)
        if thrust.max() >= 2:  # with fewer thrusts a draw may leave out all but one
            times *= _drawn(thrust, rng)
        step = np.linalg.lstsq((J * times[:, None]).T @ J, -J.T @ (times * residual), rcond=1e-10)[0]
        found[k] = values[free] + step / scale
    bounds = np.array([(p.low, p.high) for p in family.parameters])[free]
    low[free], high[free] = np.percentile(np.clip(found, bounds[:, 0], bounds[:, 1]), [2.5, 97.5], axis=0)
    return low, high


def _drawn(group: IntArray, rng: np.random.Generator) -> Array:
    """How often each row counts when its groups, shape (n,), are drawn with replacement."""
    n = int(group.max()) + 1
    return np.asarray(rng.multinomial(n, np.full(n, 1.0 / n))[group], dtype=np.float64)


LIKELY = (0.5, 1.3)
"""Momentum flux over thrust that a jet of water may have: swirl, walls and the near field take from it, little adds."""
POSSIBLE = (0.25, 3.0)
"""Outside of this no jet lies: every confusion of units does."""
_RADII = 4000
_REACH = 6.0


@dataclass(frozen=True, kw_only=True)
class MomentumLaw:
    """Momentum flux over thrust: `measured`, of a Gaussian jet through all points, and `fitted`, of the fitted model.

    Both are medians over the planes in which points lie, from `nearest_m` to `farthest_m`. `measured` is None where no
    point lies off the axis, so that the flux cannot be determined.
    """

    measured: float | None
    fitted: float
    nearest_m: float
    farthest_m: float

    @property
    def words(self) -> str:
        """For people."""
        where = f"{self.nearest_m:.2g} to {self.farthest_m:.2g} m from the disk"
        points = "not told by points on the axis" if self.measured is None else f"{self.measured:.2f} by the points"
        marked = f"; units? a jet in water has {LIKELY[0]:g} to {LIKELY[1]:g}"
        doubt = any(not is_likely(value) for value in (self.measured, self.fitted) if value is not None)
        return f"{points}, {self.fitted:.2f} by the model, {where}; the law says 1{marked if doubt else ''}"


def is_likely(ratio: float) -> bool:
    """Whether a momentum flux over thrust is one of a jet in water."""
    return LIKELY[0] <= ratio <= LIKELY[1]


def flux_over_thrust(jet: AxialJet, along_m: Array, area_m2: float) -> Array:
    """Momentum flux through planes across a free jet over its thrust, in fresh water.

    `along_m`, shape (n,): distances of the planes from the disk, more than 0. `area_m2`: of the disk. Returns shape
    (n,).
    """
    edge = _REACH * (along_m[:, None] + np.sqrt(area_m2))
    # Finer near the axis, where the speed is.
    r = edge * np.linspace(0.0, 1.0, _RADII) ** 2
    speed = jet.speed(along_m[:, None], r, 1.0, area_m2)
    return np.asarray(2.0 * np.pi * FRESH_WATER_KG_M3 * np.trapezoid(speed**2 * r, r, axis=1))


def momentum_law(samples: JetSamples, model: AxialJet) -> MomentumLaw:
    """Momentum flux over thrust of measured speeds and of the model that was fitted to them.

    Raises InputError if that of the speeds lies where no jet's does: their unit or the thrusts' is another.
    """
    planes = np.quantile(samples.x_m, np.linspace(0.05, 0.95, 19))
    area = samples.disk_area_m2
    gaussian = family("jet-fitted")
    values, held = calibrated_values(gaussian, samples)
    reported = not any(p.shapes == "angle" and p.name in held for p in gaussian.parameters)
    measured = float(np.median(flux_over_thrust(gaussian.model(values), planes, area))) if reported else None
    if measured is not None and not POSSIBLE[0] <= measured <= POSSIBLE[1]:
        raise InputError(
            f"{samples.title}: units? the points' momentum flux in water is {measured:.2g} times the thrust, a jet has "
            f"{LIKELY[0]:g} to {LIKELY[1]:g}; thrusts must be in N (1 kgf is 9.81 N) of one thruster, speeds in m/s, "
            "radii from the axis in m"
        )
    return MomentumLaw(
        measured=measured,
        fitted=float(np.median(flux_over_thrust(model, planes, area))),
        nearest_m=float(planes[0]),
        farthest_m=float(planes[-1]),
    )


def fit_yaml(fit: WakeCalibration, source: str, disk_diameter_m: float, law: MomentumLaw | None = None) -> str:
    """YAML text with the fields of `WakeSettings` where a scenario has them, and the quality of the fit as comments."""
    scores = ((f"R2 in region {name}, test", value) for name, value in _tested(fit))
    lines = [
        f"# Wake model calibrated on {source}, disk diameter {disk_diameter_m:g} m.",
        f"# Split: {fit.split}.",
        *(f"# {name}: {'not known' if value is None else f'{value:.3f}'}" for name, value in scores),
        *([] if law is None else [f"# Momentum flux over thrust: {law.words}."]),
        *(f"# Note: {warning}." for warning in fit.warnings),
        "# A scenario as it stands: wakewise scan THIS_FILE; or put these lines into one of your own.",
        "control:",
        "  wake:",
        f"    model: {fit.family.name}",
    ]
    for k, (name, value) in enumerate(fit.parameters.items()):
        error, low, high = fit.standard_errors[k], fit.lows[k], fit.highs[k]
        words = "held" if name in fit.held else "" if not np.isfinite(error) else f"+- {error:.2g}"
        words += f", 95 % of resamples {low:.4g} to {high:.4g}" if np.isfinite(low) else ""
        lines.append(f"    {name}: {value:.6g}" + (f"  # {words}" if words else ""))
    return "\n".join(lines) + "\n"


def write_fit(
    path: Path, fit: WakeCalibration, source: str, disk_diameter_m: float, law: MomentumLaw | None = None
) -> None:
    """Write a calibrated model whole or not at all."""
    write_text(path, fit_yaml(fit, source, disk_diameter_m, law))


def fit_figures(fit: WakeCalibration) -> dict[str, Any]:
    """A calibration as plain values, ready for JSON; what is not known is None."""

    def known(value: float) -> float | None:
        return float(value) if np.isfinite(value) else None

    return {
        "model": fit.family.name,
        "parameters": {
            name: {
                "value": value,
                "standard_error": known(fit.standard_errors[k]),
                "low": known(fit.lows[k]),
                "high": known(fit.highs[k]),
                "held": name in fit.held,
            }
            for k, (name, value) in enumerate(fit.parameters.items())
        },
        "train": fit.train.plain(),
        "test": fit.test.plain(),
        "train_thrusts_N": list(fit.train_thrusts_N),
        "test_thrusts_N": list(fit.test_thrusts_N),
        "split": fit.split,
        "residual_rms_m_s": fit.residual_rms_m_s,
        "warnings": list(fit.warnings),
    }


def _tested(fit: WakeCalibration) -> tuple[tuple[str, float | None], ...]:
    return ("A (|theta| < 15 deg, 0.1-0.3 m)", fit.test.r2_core), ("B (|theta| < 30 deg, 0.1-0.5 m)", fit.test.r2_wake)
