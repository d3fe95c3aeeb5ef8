"""What a report says: the verdict in words, numbers with sensible digits, the unit and the group of every figure."""

from __future__ import annotations

import math
from dataclasses import dataclass

from wakewise.ui.reports.trial import Metrics, Trial
from wakewise.vision.evaluation.cloud_to_surface import SUCCESS_COMPLETENESS_PCT, SUCCESS_RMSE_MM

THIN_SPACE = "\u202f"
NONE = "–"
"""What stands in the place of a figure that there is none of."""

# Endings of keys, longest first where one contains another.
_UNITS = (
    ("_m_s", "m/s"), ("_per_m", "1/m"), ("_per_s", "1/s"), ("_mm", "mm"), ("_Pa", "Pa"), ("_pct", "%"), ("_deg", "deg"),
    ("_kJ", "kJ"), ("_px", "px"), ("_MB", "MB"), ("_N", "N"), ("_g", "g"), ("_ms", "ms"), ("_m", "m"), ("_s", "s"),
)  # fmt: skip

GROUPS: dict[str, tuple[str, ...]] = {
    "The model": (
        "success", "rmse_mm", "rmse_cap_mm", "accuracy", "completeness", "visible", "f_score", "icp", "outside",
        "cloud", "truth", "dense", "mesh",
    ),
    "The photographs": (
        "images", "registered", "features", "inlier", "reprojection", "cameras", "points", "sharpness", "sparse",
    ),
    "The water": (
        "target_speed", "exposure_speed", "ambient_speed", "bed_speed", "turbidity", "disturbance", "target_pressure",
        "exposure_pressure", "exposure_optical", "bed_shear", "grain_threshold", "tracer", "ray_optical", "silt_",
    ),
    "The flight": (
        "method", "seed", "duration", "position", "path", "estimate", "velocity", "roll", "energy", "sign",
        "collisions", "legs",
    ),
    "The computation": ("solve", "fallbacks", "wall", "cpu", "memory", "stages"),
}  # fmt: skip
OTHER = "Other figures"


@dataclass(frozen=True)
class TrialHeadline:
    """Headline of a trial: `good` is None where the trial could not be judged."""

    good: bool | None
    headline: str
    reasons: tuple[str, ...]


def verdict(trial: Trial, *, named: bool = False) -> TrialHeadline:
    """Say whether the scan succeeded and why, in words; `named` says in the headline which method flew."""
    who = f" with {trial.method}" if named else ""
    metrics = trial.metrics
    rmse, covered = metrics.number("rmse_mm"), metrics.number("completeness_pct")
    success = metrics.values.get("success")
    reasons = tuple(_reasons(trial, rmse, covered))
    if rmse is None or covered is None:
        made = trial.cloud_m is not None
        why = metrics.why.get("rmse_mm") or metrics.why.get("completeness_pct")
        headline = "The model was not measured." if made else "There is no model."
        headline += f" Flown{who}." if named else ""
        return TrialHeadline(
            False if success is False else None,
            headline,
            ((_sentence(why.removeprefix("no model: ")),) if why else ()) + reasons,
        )
    figures = f"{number(rmse)} mm RMSE, {number(covered)} % of the surface covered"
    good = success if isinstance(success, bool) else rmse < SUCCESS_RMSE_MM and covered > SUCCESS_COMPLETENESS_PCT
    return TrialHeadline(good, f"{'Success' if good else 'Not good enough'}{who}: {figures}.", reasons)


def _reasons(trial: Trial, rmse: float | None, covered: float | None) -> list[str]:
    metrics = trial.metrics
    lines: list[str] = []
    if rmse is not None and covered is not None:
        fine, whole = rmse < SUCCESS_RMSE_MM, covered > SUCCESS_COMPLETENESS_PCT
        limits = f"an RMSE below {SUCCESS_RMSE_MM:g} mm and more than {SUCCESS_COMPLETENESS_PCT:g} % of the surface"
        if fine and whole:
            lines.append(f"A scan succeeds with {limits} within 3 mm of the model; this one has both.")
        else:
            parts = [] if fine else [f"the RMSE is {number(rmse)} mm"]
            parts += [] if whole else [f"{number(covered)} % of the surface is covered"]
            lines.append(f"A scan succeeds with {limits} within 3 mm of the model; here {' and '.join(parts)}.")
    registered, images = metrics.number("registered_images"), metrics.number("images")
    if registered is not None and images:
        all_of = "All" if registered == images else f"{registered:.0f} of"
        lines.append(f"{all_of} {images:.0f} photographs found their place in the model.")
    speed, p95 = metrics.number("target_speed_mean_m_s"), metrics.number("target_speed_p95_m_s")
    if speed is not None:
        tail = "" if p95 is None else f" ({number(1e3 * p95)} mm/s at its 95th percentile)"
        lines.append(f"The thrusters moved the water at the target at {number(1e3 * speed)} mm/s on average{tail}.")
    collisions = metrics.number("collisions")
    if collisions:
        lines.append(f"The hull touched something {collisions:.0f} times.")
    return [" ".join(lines)] if lines else []


def capitalised(text: str) -> str:
    """Text with a capital first letter; the other letters stay."""
    return text[:1].upper() + text[1:]


def _sentence(text: str) -> str:
    text = text.strip()
    return capitalised(text) + ("" if text.endswith((".", "!", "?")) else ".")


def number(value: float | None, digits: int = 3, scale: float = 1.0) -> str:
    """`scale` times a number with three significant digits, thin spaces between thousands, no needless exponents.

    A dash where there is none: None, NaN or infinity.
    """
    if value is None or not math.isfinite(value):
        return NONE
    value = scale * value
    if value == 0:
        return "0"
    if float(value).is_integer() and abs(value) >= 1000:
        return f"{int(value):,}".replace(",", THIN_SPACE)
    size = abs(value)
    if size >= 10 ** (digits + 1):
        return f"{round(value):,}".replace(",", THIN_SPACE)
    if size < 1e-4:
        mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
        superscript = str(int(exponent)).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
        return f"{mantissa} × 10{superscript}"
    text = f"{value:#.{digits}g}"
    if "e" in text:
        text = f"{value:.0f}"
    text = text.rstrip(".")
    return f"{int(value)}" if float(value).is_integer() else text


def fixed(value: float | None, places: int, *, scale: float = 1.0, sign: bool = False) -> str:
    """`scale` times a number with so many decimals, and with its sign where `sign`; a dash where there is none."""
    if value is None or not math.isfinite(value):
        return NONE
    return f"{round(scale * value, places) + 0.0:{'+' if sign else ''}.{places}f}"


TIMES = 3.0
"""Factor beyond which a difference is given as a ratio, and no longer in percent: below a third, or above three."""
_ROUNDING = 1e-9


def percent(value: float | None, ends: tuple[float, float] | None = None, *, more: bool = False) -> tuple[str, str]:
    """A difference with its interval: "31 %" and "(26 to 35)"; beyond a factor of 3 "0.12 times as much" and its ends.

    `value` is how much less in percent, or how much more where `more`. Value and interval have one form: where one of
    them is beyond the factor, all are ratios.
    """
    if value is None:
        return NONE, ""
    known = [value, *(ends or ())]
    ratios = [1.0 + one / 100.0 if more else 1.0 - one / 100.0 for one in known]
    if min(ratios) >= 1.0 / TIMES - _ROUNDING and max(ratios) <= TIMES + _ROUNDING:
        return f"{number(value)} %", "" if ends is None else f"({number(ends[0])} to {number(ends[1])})"
    inside = "" if ends is None else f"({number(min(ratios[1:]))} to {number(max(ratios[1:]))} times)"
    return f"{number(ratios[0])} times as much", inside


def with_unit(ends: str) -> str:
    """The interval of a difference that stands by itself: in percent where it is no ratio."""
    return f"{ends} %" if ends and not ends.endswith("times") else ends


def duration(seconds: float | None) -> str:
    """A time in the unit that people would say: 40 s, 12 min, 3.5 h."""
    if seconds is None or not math.isfinite(seconds):
        return NONE
    if seconds < 100.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 5700.0 else f"{seconds / 3600.0:.1f} h"


def shown(value: object) -> str:
    """A figure as text: numbers by `number`, yes and no for truth values, a dash where there is none."""
    if value is None:
        return NONE
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, int | float):
        return number(value)
    return str(value)


def unit(metrics: Metrics, key: str) -> str:
    """Unit of a figure: as metrics.json says, else by the ending of its key."""
    if key in metrics.units:
        return str(metrics.units[key])
    for ending, name in _UNITS:
        if key.endswith(ending) or f"{ending}_" in key:
            return name
    return ""


def grouped(metrics: Metrics) -> dict[str, list[str]]:
    """Keys of all figures by group, in the order of metrics.json; none is left out."""
    groups: dict[str, list[str]] = {name: [] for name in (*GROUPS, OTHER)}
    for key in metrics.values:
        home = next((name for name, starts in GROUPS.items() if key.startswith(starts)), OTHER)
        groups[home].append(key)
    return {name: keys for name, keys in groups.items() if keys}
