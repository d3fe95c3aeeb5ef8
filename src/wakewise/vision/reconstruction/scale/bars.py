"""Scale bars: lengths between coded targets, a ChArUco board; their weighted mean, its uncertainty and residuals."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import Field, ValidationError

from wakewise.core.errors import InputError
from wakewise.core.safe_yaml import yaml_file
from wakewise.core.settings import Settings, describe_faults
from wakewise.vision.reconstruction.photos.calibration import CalibrationBoard

SIGMA_SHARE = 1e-3
"""Default relative standard deviation of a length: a steel rule read to half a mm."""
FAMILIES = {
    "apriltag_36h11": "DICT_APRILTAG_36h11",
    "apriltag_36h10": "DICT_APRILTAG_36h10",
    "apriltag_25h9": "DICT_APRILTAG_25h9",
    "apriltag_16h5": "DICT_APRILTAG_16h5",
    "aruco_4x4": "DICT_4X4_1000",
    "aruco_5x5": "DICT_5X5_1000",
    "aruco_6x6": "DICT_6X6_1000",
    "aruco_7x7": "DICT_7X7_1000",
    "aruco_original": "DICT_ARUCO_ORIGINAL",
    "aruco_mip_36h12": "DICT_ARUCO_MIP_36h12",
}
"""Names of target families and OpenCV's dictionaries; a smaller dictionary is the beginning of the larger one."""


@dataclass(frozen=True, kw_only=True)
class ScaleBar:
    """Distance between the middles of two targets, by number, in m, with its standard deviation."""

    ends: tuple[int, int]
    length_m: float
    sigma_m: float

    def __post_init__(self) -> None:
        one, two = self.ends
        if one == two or min(self.ends) < 0:
            raise InputError(f"bar {self.name}: its ends must be two different targets, numbered from 0")
        if not (math.isfinite(self.length_m) and self.length_m > 0.0):
            raise InputError(f"bar {self.name}: length {self.length_m:g} m, must be above 0")
        if not (math.isfinite(self.sigma_m) and 0.0 < self.sigma_m < self.length_m):
            raise InputError(
                f"bar {self.name}: uncertainty {self.sigma_m:g} m of a length of {self.length_m:g} m, must be above 0 "
                "and less than the length"
            )

    @property
    def name(self) -> str:
        """Both ends."""
        return f"{self.ends[0]}-{self.ends[1]}"


@dataclass(frozen=True, kw_only=True)
class ScaleBars:
    """Known lengths. family: of the targets, detected if None; tag_m: side of their black square."""

    bars: tuple[ScaleBar, ...] = ()
    family: str | None = None
    tag_m: float | None = None
    board: CalibrationBoard | None = None
    board_sigma: float = SIGMA_SHARE

    def __post_init__(self) -> None:
        if not self.bars and self.board is None:
            raise InputError("bars: none are given; a bar is A,B,LENGTH in m, or a board in the file of bars")
        if self.family is not None and self.family not in FAMILIES:
            raise InputError(f"bars: targets of '{self.family}', allowed are {', '.join(FAMILIES)}")
        if self.tag_m is not None and not (math.isfinite(self.tag_m) and self.tag_m > 0.0):
            raise InputError(f"bars: targets of {self.tag_m:g} m, must be above 0")
        pairs = [tuple(sorted(bar.ends)) for bar in self.bars]
        for pair in pairs:
            if pairs.count(pair) > 1:
                raise InputError(f"bars: {pair[0]}-{pair[1]} is given {pairs.count(pair)} times, must be once")

    @property
    def wanted(self) -> tuple[int, ...]:
        """Targets that bars end at, each once."""
        return tuple(sorted({end for bar in self.bars for end in bar.ends}))

    def key(self) -> list[Any]:
        """Plain values for a fingerprint."""
        board = self.board
        size = None if board is None else [board.columns, board.rows, board.square_m, board.marker_m, self.board_sigma]
        return [[[*bar.ends, bar.length_m, bar.sigma_m] for bar in self.bars], self.family, self.tag_m, size]


def parse_bar(words: str) -> ScaleBar:
    """A bar of `A,B,LENGTH[,SIGMA]`: numbers of two targets, and metres.

    Raises InputError if it is not of that form.
    """
    parts = [part.strip() for part in words.split(",")]
    try:
        if len(parts) not in (3, 4):
            raise ValueError
        ends, length = (int(parts[0]), int(parts[1])), float(parts[2])
        sigma = float(parts[3]) if len(parts) == 4 else SIGMA_SHARE * length
    except ValueError:
        raise InputError(
            f"bar '{words}': must be A,B,LENGTH or A,B,LENGTH,SIGMA: numbers of two targets, metres; such as "
            "3,7,0.500,0.0002"
        ) from None
    return ScaleBar(ends=ends, length_m=length, sigma_m=sigma)


class _BarEntry(Settings):
    ends: tuple[int, int]
    length_m: float
    sigma_m: float | None = None


class _BoardEntry(Settings):
    columns: int
    rows: int
    square_m: float
    marker_m: float
    sigma: float = Field(default=SIGMA_SHARE, gt=0.0, lt=0.5)


class _BarsFile(Settings):
    bars: tuple[_BarEntry, ...] = ()
    targets: str | None = None
    tag_m: float | None = None
    board: _BoardEntry | None = None


def read_bars(path: Path) -> ScaleBars:
    """Bars of a YAML file: `bars` (ends, length_m, sigma_m), `targets`, `tag_m`, `board`.

    Raises InputError if it cannot be read or has other contents.
    """
    value = yaml_file(path)
    if not isinstance(value, dict):
        raise InputError(f"{path}: must hold bars: a list of ends: [3, 7], length_m: 0.5, sigma_m: 0.0002")
    try:
        entries = _BarsFile.model_validate(value)
    except ValidationError as fault:
        faults = describe_faults(fault, _BarsFile, "bars")
        raise InputError(f"{path}: {faults}; a bar has ends: [3, 7], length_m, sigma_m") from None
    board = entries.board
    try:
        return ScaleBars(
            bars=tuple(
                ScaleBar(
                    ends=one.ends,
                    length_m=one.length_m,
                    sigma_m=SIGMA_SHARE * one.length_m if one.sigma_m is None else one.sigma_m,
                )
                for one in entries.bars
            ),
            family=entries.targets,
            tag_m=entries.tag_m,
            board=None if board is None else CalibrationBoard(**board.model_dump(exclude={"sigma"})),
            board_sigma=SIGMA_SHARE if board is None else board.sigma,
        )
    except InputError as fault:
        raise InputError(f"{path}: {fault}") from None


MOST_OFF_PCT, MOST_OFF_SIGMAS = 1.0, 3.0
"""A bar that differs from the others by more than both is refused: a wrong length, or mixed-up ends."""


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
    """A bar in the scaled model. off_*: its length there less the stated one; check_pct: the same at the scale of the
    other bars, None for the only one; photos: least number that sees one of its ends.
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

    The uncertainty is that of the mean, enlarged if bars scatter by more than their own (R. T. Birge, Physical Review
    40, 1932, doi 10.1103/PhysRev.40.207).

    Raises InputError if a bar differs too much from the scale of the others.
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
            f"bars: {what} ({MOST_OFF_PCT:g} % is accepted); measure again, or look whether the numbers of its "
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
