"""Scale of a model from several bars: their weighted mean, how sure it is, and how far each bar is from the others."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from wakewise.core.errors import InputError

MOST_OFF_PCT, MOST_OFF_SIGMAS = 1.0, 3.0
"""A bar that differs from the others by more than both is refused: a wrong length, or ends that were mixed up."""


@dataclass(frozen=True, kw_only=True)
class BarMeasurement:
    """A bar as stated, in m, and as the model has it, in its own units, each with its standard deviation."""

    name: str
    length_m: float
    sigma_m: float
    found: float
    found_sigma: float
    photos: int

    @property
    def scale(self) -> float:
        """Metres per unit of the model."""
        return self.length_m / self.found

    @property
    def share(self) -> float:
        """Relative standard deviation of the scale."""
        return float(np.hypot(self.sigma_m / self.length_m, self.found_sigma / self.found))


@dataclass(frozen=True, kw_only=True)
class BarResidual:
    """What a bar is in the scaled model. off_*: its length there less the stated one; check_pct: the same if the scale
    came from the other bars alone, None for the only one; photos: fewest that one of its ends is seen in.
    """

    name: str
    length_m: float
    sigma_m: float
    found_m: float
    off_mm: float
    off_pct: float
    check_pct: float | None
    photos: int


@dataclass(frozen=True, kw_only=True)
class ScaleFit:
    """Metres per unit of the model, relative standard deviation in percent, and each bar's residual."""

    scale: float
    uncertainty_pct: float
    bars: tuple[BarResidual, ...]

    def figures(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {"uncertainty_pct": self.uncertainty_pct, "bars": [asdict(bar) for bar in self.bars]}


def fit_scale(bars: list[BarMeasurement], keep: bool = False) -> ScaleFit:
    """Weighted mean of the bars' scales; residuals are those at that scale, or if it is to `keep` its own, at that.

    The uncertainty is that of the mean, enlarged where bars scatter by more than they say (R. T. Birge, Physical Review
    40, 1932, doi 10.1103/PhysRev.40.207).

    Raises
    ------
    InputError
        If a bar differs from what the others say by more than can be believed.
    """
    scales = np.array([bar.scale for bar in bars])
    weights = np.array([1.0 / (bar.share * bar.scale) ** 2 for bar in bars])
    mean = float((weights * scales).sum() / weights.sum())
    share = float(np.sqrt(1.0 / weights.sum())) / mean
    scatter = float((weights * (scales - mean) ** 2).sum()) / (len(bars) - 1) if len(bars) > 1 else 1.0
    checks: list[float | None] = []
    sigmas = []
    for k, bar in enumerate(bars):
        others = np.delete(weights, k)
        if not len(others):
            checks.append(None)
            continue
        rest = float((others * np.delete(scales, k)).sum() / others.sum())
        share_off = bar.found * rest / bar.length_m - 1.0
        checks.append(100.0 * share_off)
        sigmas.append(abs(share_off) / float(np.hypot(bar.share, np.sqrt(1.0 / others.sum()) / rest)))
    known = [abs(check) for check in checks if check is not None]
    if known and max(known) > MOST_OFF_PCT and max(sigmas) > MOST_OFF_SIGMAS:
        worst = int(np.argmax(sigmas))
        off = checks[worst]
        what = f"bar {bars[worst].name} comes out {off:+.1f} % from what the other bars say"
        if len(bars) == 2:
            what = f"bars {bars[0].name} and {bars[1].name} differ by {abs(off or 0.0):.1f} %"
        raise InputError(
            f"bars: {what} ({MOST_OFF_PCT:g} % would be believed); measure again, or look whether the numbers of its "
            "ends are right and its targets stayed where they were"
        )
    applied = 1.0 if keep else mean
    return ScaleFit(
        scale=mean,
        uncertainty_pct=100.0 * share * max(1.0, float(np.sqrt(scatter))),
        bars=tuple(
            BarResidual(
                name=bar.name,
                length_m=bar.length_m,
                sigma_m=bar.sigma_m,
                found_m=bar.found * applied,
                off_mm=1e3 * (bar.found * applied - bar.length_m),
                off_pct=100.0 * (bar.found * applied / bar.length_m - 1.0),
                check_pct=check,
                photos=bar.photos,
            )
            for bar, check in zip(bars, checks, strict=True)
        ),
    )
