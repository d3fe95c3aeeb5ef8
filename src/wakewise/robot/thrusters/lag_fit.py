"""Identify a thruster's lag from a measured step of thrust.

What readings that are correlated in time are worth.

Read a measured step of a thruster.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import least_squares

from wakewise.core.arrays import Array, frozen
from wakewise.core.csv_separators import csv_rows
from wakewise.core.errors import InputError
from wakewise.robot.thrusters.rotor_lag import FirstOrderLag, LagModel, RotorLag, SecondOrderLag, SplitLag


def samples_per_reading(residual: Array) -> float:
    """Samples of a series, shape (m,), that count as one independent reading, at least 1.

    1 + 2 x the sum of autocorrelations over a window of the root of m, with Bartlett's weights.
    """
    window = max(1, round(math.sqrt(residual.size)))
    centred = residual - residual.mean()
    variance = float(centred @ centred)
    if variance == 0.0:
        return 1.0
    total = sum(
        (1.0 - lag / (window + 1)) * float(centred[lag:] @ centred[:-lag]) / variance for lag in range(1, window + 1)
    )
    return max(1.0, 1.0 + 2.0 * total)


def newey_west_errors(jacobian: Array, residual: Array) -> Array:
    """Standard errors, shape (p,), of least squares with Jacobian, shape (m, p), and residuals, shape (m,), in time.

    W. Newey, K. West, Econometrica 55, 1987, 703, with a window of the root of m; infinite where nothing depends on a
    parameter.
    """
    scores = jacobian * residual[:, None]
    middle = scores.T @ scores
    window = max(1, round(math.sqrt(residual.size)))
    for lag in range(1, window + 1):
        cross = scores[lag:].T @ scores[:-lag]
        middle += (1.0 - lag / (window + 1)) * (cross + cross.T)
    # Columns differ by orders of magnitude; scaled, the inverse keeps its digits.
    size = np.linalg.norm(jacobian, axis=0)
    size[size == 0.0] = math.inf
    bread = np.linalg.pinv((jacobian / size).T @ (jacobian / size))
    covariance = bread @ (middle / np.outer(size, size)) @ bread
    spare = max(residual.size - jacobian.shape[1], 1)
    errors = np.sqrt(np.maximum(np.diag(covariance), 0.0) * residual.size / spare) / size
    return np.where(np.isinf(size), math.inf, errors)


FEWEST_SAMPLES = 20
MOST_SAMPLES = 20_000
MOST_TRIALS = 60
"""Noisy records settle within about 20; one without noise would go on improving digits that mean nothing."""

RIPPLE_SHARE = 0.3
"""A line in the spectrum is called ripple if it holds this share of what a lag leaves unexplained."""


@dataclass(frozen=True, kw_only=True)
class FittedParameter:
    """A fitted parameter; `standard_error` is None where the data do not bound it."""

    name: str
    unit: str
    value: float
    standard_error: float | None


@dataclass(frozen=True, kw_only=True)
class LagCandidate:
    """How well one model did."""

    name: str
    r2: float
    bic: float
    mean_delay_s: float


@dataclass(frozen=True, kw_only=True)
class LagFit:
    """A lag with dead time, thrust = offset + gain * lagged command, and how well it repeats what was measured.

    `r2` compares averages over `average_s` of model and measurement, over the whole record; `r2_raw` compares every
    sample as measured. `r2_ceiling` is the R2 that the measurement's own averages reach against its raw samples: no
    model that is steady over `average_s` gets a higher `r2_raw`. Standard errors allow for residuals that are
    correlated in time.

    `measured_delay_s` needs no model: the area between command and thrust over the height of the step, up to the end of
    the record, whose last fifth gives the final level. It is None unless the command rests before and there. Least
    squares follows the bulk of a response, so a small slow tail moves this delay more than it moves the fit's.
    """

    model: LagModel
    delay_s: float
    gain: float
    offset_N: float
    estimates: tuple[FittedParameter, ...]
    r2: float
    r2_raw: float
    r2_ceiling: float
    residual_rms_N: float
    measured_delay_s: float | None
    measured_delay_error_s: float | None
    average_s: float
    window_s: tuple[float, float]
    candidates: tuple[LagCandidate, ...]

    @property
    def mean_delay_s(self) -> float:
        """Dead time and the lag's own mean delay together."""
        return self.delay_s + self.model.mean_delay_s


@dataclass(frozen=True, kw_only=True)
class LagFamily:
    """A kind of lag: how free parameters become a model, and where a search for them may start."""

    name: str
    fields: tuple[tuple[str, str], ...]
    model: Callable[[Sequence[float]], LagModel]
    starts: Callable[[float], tuple[tuple[float, ...], ...]]


FAMILIES = (
    LagFamily(
        name=FirstOrderLag.name,
        fields=(("time_constant_s", "s"),),
        model=lambda p: FirstOrderLag(time_constant_s=p[0]),
        starts=lambda scale_s: ((scale_s,),),
    ),
    LagFamily(
        name=RotorLag.name,
        fields=(("time_constant_s", "s"),),
        model=lambda p: RotorLag(time_constant_s=p[0]),
        starts=lambda scale_s: ((scale_s,),),
    ),
    LagFamily(
        name=SecondOrderLag.name,
        fields=(("natural_rad_s", "rad/s"), ("damping_ratio", "1")),
        model=lambda p: SecondOrderLag(natural_rad_s=p[0], damping_ratio=p[1]),
        starts=lambda scale_s: tuple((2.0 * z / scale_s, z) for z in (0.3, 0.7, 1.5)),
    ),
    LagFamily(
        name=SplitLag.name,
        fields=(("time_constant_s", "s"), ("direct_share", "1")),
        model=lambda p: SplitLag(time_constant_s=p[0], direct_share=p[1]),
        starts=lambda scale_s: tuple((scale_s, share) for share in (0.3, 0.7, 1.4)),
    ),
)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Record:
    """A measured step on an even grid, and the blocks that are compared."""

    time_s: Array
    command: Array
    thrust_N: Array
    dt_s: float
    block: int

    def averages(self, values: Array) -> Array:
        """Mean of each whole block, shape (samples // block,)."""
        count = values.size // self.block
        return np.asarray(values[: count * self.block].reshape(count, self.block).mean(axis=1))


def identify_lag(
    time_s: ArrayLike, command: ArrayLike, thrust_N: ArrayLike, *, average_s: float | None = None
) -> LagFit:
    """Fit each lag model with dead time to a measured step by least squares and keep the one the data ask for.

    `time_s`, shape (m,): increasing; resampled evenly if it is not even. `command`, shape (m,): what was asked for, in
    any unit to which steady thrust is proportional: a commanded thrust, or the square of a commanded speed or voltage.
    A value holds until the next sample. It must change in the record, and should rest before; the sign of the ratio is
    free. `thrust_N`, shape (m,): measured force; a constant bias is fitted. `average_s`: model and measurement are
    compared as averages over this time. Left out, it is one period of the strongest line in what a lag leaves
    unexplained, if that line is faster than the lag and holds 30 % of it (the propeller's blades passing), and
    otherwise no averaging. Returns the model of the lowest Bayesian information criterion (G. Schwarz, Ann. Statist. 6,
    1978, 461), with the count of independent readings, not of samples, in it. Standard errors are Newey and West's
    (Econometrica 55, 1987, 703), whose window is the root of the number of averages. Raises InputError if shapes
    differ, a value is not finite, time does not increase, there are fewer than 20 samples or averages, or command or
    thrust never changes.
    """
    record = _record(time_s, command, thrust_N, average_s)
    fits = [_fit(family, record) for family in FAMILIES]
    if average_s is None:
        best = min(fits, key=lambda fit: fit.cost)
        block = _ripple_block(record, best)
        if block > 1 and record.time_s.size // block >= FEWEST_SAMPLES:
            record = replace(record, block=block)
            fits = [_fit(family, record) for family in FAMILIES]
    measured = record.averages(record.thrust_N)
    spread = float(np.sum((measured - measured.mean()) ** 2))
    # One count of independent readings for all models, from the one that leaves the least.
    independent = measured.size / samples_per_reading(min(fits, key=lambda fit: fit.cost).residual)
    bics = [independent * math.log(max(f.cost, 1e-300)) + f.values.size * math.log(independent) for f in fits]
    chosen = fits[int(np.argmin(bics))]
    delay_s, delay_error_s = _measured_delay(record)
    smooth = np.repeat(measured, record.block)
    raw = record.thrust_N[: smooth.size]
    raw_spread = float(np.sum((raw - raw.mean()) ** 2))
    return LagFit(
        model=chosen.model,
        delay_s=float(chosen.values[2]),
        gain=float(chosen.values[1]),
        offset_N=float(chosen.values[0]),
        estimates=chosen.estimates(),
        r2=1.0 - chosen.cost / spread,
        r2_raw=1.0 - float(np.sum((raw - chosen.predicted[: raw.size]) ** 2)) / raw_spread,
        r2_ceiling=1.0 - float(np.sum((raw - smooth) ** 2)) / raw_spread,
        residual_rms_N=math.sqrt(chosen.cost / measured.size),
        measured_delay_s=delay_s,
        measured_delay_error_s=delay_error_s,
        average_s=record.block * record.dt_s if record.block > 1 else 0.0,
        window_s=(float(record.time_s[0]), float(record.time_s[-1])),
        candidates=tuple(
            LagCandidate(
                name=fit.family.name,
                r2=1.0 - fit.cost / spread,
                bic=bic,
                mean_delay_s=float(fit.values[2]) + fit.model.mean_delay_s,
            )
            for fit, bic in zip(fits, bics, strict=True)
        ),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class _Fit:
    """One family fitted: `values` are offset, gain, delay and the model's own, `residual` measured - model averages."""

    family: LagFamily
    model: LagModel
    values: Array
    predicted: Array
    residual: Array
    jacobian: Array
    cost: float
    dt_s: float

    def estimates(self) -> tuple[FittedParameter, ...]:
        """Parameters with Newey-West standard errors."""
        names = (("offset_N", "N"), ("gain", "N per unit of command"), ("delay_s", "s"), *self.family.fields)
        errors = newey_west_errors(self.jacobian, self.residual)
        # A dead time of zero lies on its bound, and a time constant below the sampling is not seen.
        unseen = {"delay_s"} if self.values[2] < 1e-3 * self.dt_s else set()
        unseen |= {"time_constant_s"} if self.values[3] < self.dt_s and len(self.values) == 4 else set()
        return tuple(
            FittedParameter(
                name=name,
                unit=unit,
                value=float(value),
                standard_error=None if name in unseen or not math.isfinite(error) else float(error),
            )
            for (name, unit), value, error in zip(names, self.values, errors, strict=True)
        )


def _record(time_s: ArrayLike, command: ArrayLike, thrust_N: ArrayLike, average_s: float | None) -> _Record:
    time = frozen(time_s, (None,), "time_s")
    asked = frozen(command, (time.size,), "command")
    thrust = frozen(thrust_N, (time.size,), "thrust_N")
    if time.size < FEWEST_SAMPLES:
        raise InputError(f"lag: {time.size} samples, at least {FEWEST_SAMPLES} are needed")
    gaps = np.diff(time)
    if np.any(gaps <= 0.0):
        raise InputError(f"lag: time_s must increase, sample {int(np.argmax(gaps <= 0.0)) + 2} does not")
    for name, values in (("command", asked), ("thrust_N", thrust)):
        if float(np.ptp(values)) == 0.0:
            raise InputError(f"lag: {name} is {values[0]:g} throughout, it must change")
    if average_s is not None and not 0.0 <= average_s <= float(time[-1] - time[0]) / FEWEST_SAMPLES:
        longest = float(time[-1] - time[0]) / FEWEST_SAMPLES
        raise InputError(f"lag: average_s = {average_s:g}, allowed 0 to {longest:.3g} (20 averages in the record)")
    count = min(time.size, MOST_SAMPLES)
    even = np.linspace(time[0], time[-1], count)
    dt_s = float(even[-1] - even[0]) / (count - 1)
    if count < time.size:
        # Averages, not single samples, so that nothing faster folds into the band of the lag.
        edges = np.clip(np.searchsorted(time, even - 0.5 * dt_s), 0, time.size - 1)
        counts = np.diff(np.append(edges, time.size))
        asked, thrust = (np.add.reduceat(values, edges) / np.maximum(counts, 1) for values in (asked, thrust))
    elif not np.allclose(gaps, dt_s, rtol=0.01, atol=0.0):
        asked, thrust = np.interp(even, time, asked), np.interp(even, time, thrust)
    block = 1 if average_s is None else max(1, round(average_s / dt_s))
    return _Record(time_s=even, command=asked, thrust_N=thrust, dt_s=dt_s, block=block)


def _lagged(model: LagModel, delay_s: float, command: Array, dt_s: float) -> Array:
    # Means over each interval of the delayed command, exactly: differences of its integral, which is linear between
    # samples since a command holds until the next one.
    integral = np.concatenate([[0.0], np.cumsum(command) * dt_s])
    at = np.arange(command.size + 1) - delay_s / dt_s
    before = np.minimum(at, 0.0) * command[0] * dt_s
    held = np.diff(np.interp(at, np.arange(command.size + 1), integral) + before) / dt_s
    return model.response(held, dt_s)


def _fit(family: LagFamily, record: _Record) -> _Fit:
    measured = record.averages(record.thrust_N)
    after_s = record.time_s[-1] - record.time_s[int(np.argmax(np.diff(record.command) != 0.0))]
    longest_s = max(float(after_s), 10.0 * record.dt_s)
    scale = np.array([float(np.ptp(measured)), float(np.ptp(measured) / np.ptp(record.command)), 0.1 * longest_s])

    def lagged(theta: Array) -> Array:
        model = family.model([float(value) for value in np.exp(theta[1:])])
        return _lagged(model, float(theta[0]), record.command, record.dt_s)

    def projected(theta: Array) -> tuple[float, Array]:
        basis = np.stack([np.ones(measured.size), record.averages(lagged(theta))], axis=1)
        linear = np.linalg.lstsq(basis, measured, rcond=None)[0]
        return float(np.sum((measured - basis @ linear) ** 2)), np.asarray(linear, dtype=np.float64)

    def residual(x: Array) -> Array:
        return record.averages(x[0] + x[1] * lagged(x[2:])) - measured

    shares = (0.003, 0.01, 0.03, 0.1, 0.3)
    starts = [
        np.array([delay * longest_s, *np.log(own)])
        for delay, share in product((0.0, 0.01, 0.03, 0.1), shares)
        for own in family.starts(max(share * longest_s, record.dt_s))
    ]
    # The two best of the coarse search, since a second-order lag can settle beside the best.
    starts.sort(key=lambda theta: projected(theta)[0])
    own = len(family.fields)
    lower = np.array([-np.inf, -np.inf, 0.0, *[math.log(1e-3)] * own])
    upper = np.array([np.inf, np.inf, 0.9 * longest_s, *[math.log(1e4)] * own])
    # What is faster than the sampling or slower than ten records is not in the data.
    slow, fast = math.log(10.0 * longest_s), math.log(0.1 * record.dt_s)
    lower[3], upper[3] = (-slow, -fast) if family.name == SecondOrderLag.name else (fast, slow)
    solutions = []
    for start in starts[:2]:
        guess = np.clip(np.concatenate([projected(start)[1], start]), lower, upper)
        solutions.append(
            least_squares(
                residual, guess, bounds=(lower, upper), x_scale=np.array([*scale, *[1.0] * own]), max_nfev=MOST_TRIALS
            )
        )
    best = min(solutions, key=lambda solution: float(solution.cost))
    x = np.asarray(best.x)
    values = np.concatenate([x[:3], np.exp(x[3:])])
    # From the logarithm of a parameter to the parameter itself.
    jacobian = np.asarray(best.jac) / np.concatenate([np.ones(3), values[3:]])
    return _Fit(
        family=family,
        model=family.model([float(value) for value in values[3:]]),
        values=values,
        predicted=x[0] + x[1] * lagged(x[2:]),
        residual=-np.asarray(best.fun),
        jacobian=jacobian,
        cost=float(np.sum(np.asarray(best.fun) ** 2)),
        dt_s=record.dt_s,
    )


def _ripple_block(record: _Record, fit: _Fit) -> int:
    """Samples in one period of the strongest fast line of what is unexplained, or 1."""
    from scipy.signal import welch

    left = record.thrust_N - fit.predicted
    frequency, power = welch(left, fs=1.0 / record.dt_s, nperseg=min(4096, left.size))
    way = np.abs(fit.predicted - fit.predicted[0]) / np.abs(fit.predicted - fit.predicted[0]).max()
    rise_s = max(float(np.argmax(way > 0.9) - np.argmax(way > 0.1)) * record.dt_s, record.dt_s)
    fast = np.flatnonzero(frequency > 2.0 / rise_s)
    if not fast.size or not np.any(power[fast] > 0.0):
        return 1
    line = float(frequency[fast[int(np.argmax(power[fast]))]])
    near = np.abs(frequency - line) <= 0.1 * line
    return round(1.0 / (line * record.dt_s)) if power[near].sum() >= RIPPLE_SHARE * power.sum() else 1


def _measured_delay(record: _Record) -> tuple[float | None, float | None]:
    """Mean delay by area and its standard error from the two levels', or None where a level is not at rest."""
    changes = np.flatnonzero(np.diff(record.command) != 0.0)
    first, final = int(changes[0]) + 1, int(0.8 * record.time_s.size)
    before, after = record.thrust_N[:first], record.thrust_N[final:]
    if first < 5 or changes[-1] + 1 >= final or after.size < 5:
        return None, None
    height = float(after.mean() - before.mean())
    asked = float(record.command[-1] - record.command[0])
    if height == 0.0 or asked == 0.0:
        return None, None
    risen = (record.thrust_N[first:] - before.mean()) / height
    wanted = (record.command[first:] - record.command[0]) / asked
    # As in the fit, a command holds until the next sample; thrust is a straight line between samples.
    area_s = float(np.sum(wanted[:-1]) - np.sum(0.5 * (risen[:-1] + risen[1:]))) * record.dt_s
    variance = sum(float(np.var(level)) * samples_per_reading(level) / level.size for level in (before, after))
    return area_s, math.sqrt(variance) / abs(height) * risen.size * record.dt_s


COLUMNS = ("time_s", "command", "thrust_N")
LARGEST_FILE_BYTES = 200_000_000


def read_step(path: Path | str) -> tuple[Array, Array, Array]:
    """Read a measured step from a CSV with the columns `time_s`, `command` and `thrust_N`; others are not read.

    Raises InputError if the file cannot be read, a column is missing or a cell is no finite number; the message names
    the line.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(f"step {path}: no such file")
    if path.stat().st_size > LARGEST_FILE_BYTES:
        raise InputError(f"step {path}: {path.stat().st_size} bytes, at most {LARGEST_FILE_BYTES}")
    rows = []
    for where, row in csv_rows(path, COLUMNS, f"a step with the columns {', '.join(COLUMNS)}"):
        try:
            values = [float(row[name] or "") for name in COLUMNS]
        except ValueError:
            values = [math.nan]
        if not all(map(math.isfinite, values)):
            raise InputError(f"step {where}: {', '.join(COLUMNS)} must be finite numbers")
        rows.append(values)
    if not rows:
        raise InputError(f"step {path}: no rows")
    time_s, command, thrust_N = np.array(rows).T
    return time_s, command, thrust_N
