"""Several methods side by side on one page: figures, water, photographs from the same viewpoint, models."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from markupsafe import Markup, escape

from wakewise.core.errors import InputError
from wakewise.core.files import write_text
from wakewise.experiments.trials.metrics import BETTER
from wakewise.ui.reports import figures
from wakewise.ui.reports.errors import ModelErrors, model_errors
from wakewise.ui.reports.media import coloured_model, embed, jpeg_uri
from wakewise.ui.reports.page import (
    collapsible_section,
    error_scale,
    framed_page,
    missing,
    missing_text,
    panel,
    parts,
    pictures,
    plot,
    section,
    template,
)
from wakewise.ui.reports.references import limits_section
from wakewise.ui.reports.svg_style import NOT_COUNTED, NOT_COVERED, OVER_LIMIT, error_colours
from wakewise.ui.reports.text import grouped, number, shown, unit, verdict
from wakewise.ui.reports.trial import Trial, read_trial
from wakewise.ui.reports.views import SIDES, ViewBounds, coverage_colours, draw_cloud, draw_surface
from wakewise.vision.image_decoding import read_picture

VIEW_PIXELS = 300
PHOTO_WIDTH = 720
VIEWPOINTS = 3
ROWS = ("rows.png", "rows.jpg", "rows.webp")
_PLAIN = 0.01  # a smaller difference, relative to the larger value, is none
# What a person asks of a scan: label, key, unit, factor to that unit.
MAIN = (
    ("wash at the target", "target_speed_mean_m_s", "mm/s", 1e3),
    ("wash while the shutter is open", "exposure_speed_mean_m_s", "mm/s", 1e3),
    ("wash at the bed, strongest twentieth", "bed_speed_p95_m_s", "mm/s", 1e3),
    ("silt in the water, by attenuation", "turbidity_mean_per_m", "1/m", 1.0),
    ("model's error (RMSE)", "rmse_mm", "mm", 1.0),
    ("surface covered within 3 mm", "completeness_pct", "%", 1.0),
    ("photographs placed", "registered_images", "", 1.0),
    ("position error, rms", "position_rmse_mm", "mm", 1.0),
    ("energy of the thrusters", "energy_kJ", "kJ", 1.0),
    ("disturbance_flown: D at the target, the wake model's estimate", "disturbance_flown", "m²/s²", 1.0),
)
# A ratio of these says nothing: the same by nature, or a sum over the points that each method watches, which differ.
_NO_RATIO = ("seed", "rmse_cap_mm", "disturbance")


def write_comparison(trials: Mapping[str, Path], out: Path) -> Path:
    """Write the page that compares trials, method name to trial folder, and return its path.

    Ratios are relative to the first trial. `out` is the file, or a folder for comparison.html.

    Raises InputError if there are no trials or one of the folders holds none.
    """
    if not trials:
        raise InputError("comparison: no trials, needs at least one")
    path = out if out.suffix == ".html" else out / "comparison.html"
    rows = next((file for file in (path.parent / name for name in ROWS) if file.is_file()), None)
    write_text(path, comparison_page({name: read_trial(folder) for name, folder in trials.items()}, rows))
    return path


def comparison_page(trials: Mapping[str, Trial], rows: Path | None = None) -> str:
    """HTML of the comparison; `rows` is a picture with a row per method, as `wakewise film --rows` makes it."""
    errors = {name: model_errors(trial) for name, trial in trials.items()}
    links = (
        ("main", "Main figures"),
        ("model", "Models"),
        ("seen", "Seen"),
        ("water", "Water"),
        ("limits", "Limits"),
        ("figures", "All figures"),
    )
    sections = (
        _main(trials),
        _models(trials, errors),
        _rows(rows),
        _seen(trials),
        _water(trials),
        limits_section(trials),
        _figures(trials),
    )
    footer = "Ratios are to the first method. Made by Wakewise."
    return framed_page(f"{' and '.join(trials)} · Wakewise", _header(trials), links, sections, footer)


def _header(trials: Mapping[str, Trial]) -> str:
    first, *others = trials
    seeds = {trial.seed for trial in trials.values()}
    title = f"{first} against {' and '.join(others)}" if others else first
    lines = [line for name in others if (line := _water_in_words(trials, name))]
    top = lines.pop(0) if lines else title
    lines += [line for name in others if (line := _odd_disturbance(trials, name))]
    lines += [f"{name}: {verdict(trial).headline}" for name, trial in trials.items()]
    lines += [f"{name}, {trial.outside}." for name, trial in trials.items() if trial.outside]
    macros, seed = template("comparison.html"), next(iter(seeds)) if len(seeds) == 1 else ""
    # One flight per method says nothing of how much the next ones would differ.
    cautions = [macros.one_draw(f"from seed {seed}" if seed else "from different seeds")] if len(trials) > 1 else []
    eyebrow = ("comparison", title, macros.seeds(seed))
    return str(parts().header((), top, notes=lines, mark=False, cautions=cautions, eyebrow=eyebrow))


def _water_in_words(trials: Mapping[str, Trial], name: str) -> str:
    first, ratio = next(iter(trials)), _ratio(trials, name, "target_speed_mean_m_s")
    if ratio is None:
        return ""
    if abs(ratio - 1.0) <= _PLAIN:
        return f"With {name} the water at the target moved as fast as with {first}."
    return f"With {name} the water at the target moved at {number(ratio)} times its speed with {first}."


def _odd_disturbance(trials: Mapping[str, Trial], name: str) -> str:
    """Why D can be worse where the water is calmer; empty where it is not so."""
    speed = _ratio(trials, name, "target_speed_mean_m_s")
    D = _ratio(trials, name, "disturbance_flown")
    if speed is not None and D is not None and speed < 1.0 - _PLAIN and D > 1.0 + _PLAIN:
        return (
            f"disturbance_flown of {name} is {number(D)} times as high although its water is calmer: D is no "
            "measurement but the wake model's estimate of the jets."
        )
    return ""


def _main(trials: Mapping[str, Trial]) -> str:
    """The figures that a person asks for, under names that a person uses."""
    rows = [row for entry in MAIN if (row := _main_row(trials, *entry))]
    if not rows:
        return section("main", "Main figures", "", missing("the main figures", "none recorded"))
    lead = "The better value of a row is bold where it is better by more than 1 %."
    return section("main", "Main figures", lead, template("comparison.html").main(list(trials), rows))


def _main_row(trials: Mapping[str, Trial], label: str, key: str, unit_name: str, scale: float) -> dict[str, Any] | None:
    known = {name: trial.metrics.number(key) for name, trial in trials.items()}
    if all(value is None for value in known.values()):
        return None
    texts = {name: None if value is None else number(scale * value) for name, value in known.items()}
    return {"name": label, "unit": unit_name, "cells": _cells(trials, key, texts)}


def _ratio(trials: Mapping[str, Trial], name: str, key: str) -> float | None:
    first = next(iter(trials))
    value, base = trials[name].metrics.number(key), trials[first].metrics.number(key)
    return None if value is None or not base else value / base


def _figures(trials: Mapping[str, Trial]) -> str:
    tables = []
    keys: dict[str, list[str]] = {}
    for trial in trials.values():
        for group, found in grouped(trial.metrics).items():
            known = keys.setdefault(group, [])
            known += [key for key in found if key not in known]
    for group, found in keys.items():
        table = template("comparison.html").figures(list(trials), [_row(trials, key) for key in found])
        tables.append(collapsible_section(group, table, f"{len(found)} figures"))
    content = "".join(tables) or missing("the figures", "none recorded")
    lead = f"Everything in metrics.json. Ratios are to {escape(next(iter(trials)))}; bold is better by more than 1 %."
    return section("figures", "All figures", lead, content)


def _row(trials: Mapping[str, Trial], key: str) -> dict[str, Any]:
    texts = {
        name: None if (value := trial.metrics.values.get(key)) is None else shown(value)
        for name, trial in trials.items()
    }
    units = next((u for trial in trials.values() if (u := unit(trial.metrics, key))), "")
    return {"name": key, "unit": units, "cells": _cells(trials, key, texts)}


def _cells(trials: Mapping[str, Trial], key: str, texts: Mapping[str, str | None]) -> list[dict[str, Any]]:
    """Value of each trial as text, why there is none, and its ratio to the first trial."""
    best = _best(trials, key)
    return [
        {
            "text": texts[name],
            "why": str(trial.metrics.why.get(key, "not recorded")),
            "best": name in best,
            "ratio": None if key in _NO_RATIO else _ratio(trials, name, key),
        }
        for name, trial in trials.items()
    ]


def _best(trials: Mapping[str, Trial], key: str) -> set[str]:
    """Trials with the better value of a figure; empty where they are alike or neither side is better."""
    side = BETTER.get(key, "none")
    known: dict[str, float] = {}
    for name, trial in trials.items():
        value = trial.metrics.values.get(key)
        if isinstance(value, int | float):  # success, which is yes or no, is one of them
            known[name] = float(value)
    values = list(known.values())
    if side == "none" or not values or max(values) - min(values) <= _PLAIN * max(map(abs, values)):
        return set()
    best = min(values) if side == "less" else max(values)
    return {name for name, value in known.items() if value == best}


def _water(trials: Mapping[str, Trial]) -> str:
    return section(
        "water",
        "What the water did",
        "Mean excess speed of the water at the target, on one clock, and the share of the time it was below a speed.",
        plot(
            figures.overlaid_speeds(dict(trials)),
            "speed at the target of every method",
            "Both sides share the colours.",
            "no trial recorded the speed at the target",
            narrow=figures.overlaid_speeds(dict(trials), narrow=True),
        ),
    )


def _rows(picture: Path | None) -> str:
    image = None if picture is None else read_picture(picture)
    if image is None:
        return ""
    caption = "each method at three times, by the camera and from outside"
    return section(
        "rows",
        "At the same times",
        "Each method at the same times after its first photograph: what its camera saw, and the vehicle and its wash.",
        parts().photo(jpeg_uri(image, 86), caption, caption),
    )


def _seen(trials: Mapping[str, Trial]) -> str:
    by_name = {name: {shot.name: shot for shot in trial.photographs} for name, trial in trials.items()}
    common = [name for name in next(iter(by_name.values())) if all(name in shots for shots in by_name.values())]
    if not common:
        gap = missing("photographs from the same viewpoint", "the trials share none")
        return section("seen", "What was seen", "The same viewpoint, photographed with every method.", gap)
    picks = sorted({round((i + 0.5) / VIEWPOINTS * (len(common) - 1)) for i in range(VIEWPOINTS)})
    rows = []
    for i in picks:
        figures = []
        for name in trials:
            shot = by_name[name][common[i]]
            sharpness = "" if shot.sharpness is None else f", sharpness {number(shot.sharpness)}"
            turbidity = "" if shot.turbidity_per_m is None else f", turbidity {number(shot.turbidity_per_m, 2)} /m"
            caption = f"{name}: {shot.time_s:.1f} s{sharpness}{turbidity}"
            photo = parts().photo(embed(shot, PHOTO_WIDTH), shot.name, caption)
            figures.append(parts().captioned(photo, caption))
        rows.append(parts().row_title(common[i]) + parts().columns(figures))
    lead = "The same viewpoint, photographed with every method; a click enlarges."
    return section("seen", "What was seen", lead, Markup("").join(rows))


def _models(trials: Mapping[str, Trial], errors: Mapping[str, ModelErrors | None]) -> str:
    near = error_scale("error (mm)", ((OVER_LIMIT, "more"),))
    far = error_scale("distance (mm)", ((NOT_COVERED, "not covered"), (NOT_COUNTED, "does not count")))
    accuracy, coverage = [], []
    for name, trial in trials.items():
        found = errors[name]
        if found is None or trial.truth is None:
            gap = missing(f"the model of {name}", missing_text(trial, "dense.ply", "truth.ply"))
            accuracy.append(gap)
            coverage.append(gap)
            continue
        frame = ViewBounds.around(trial.truth.vertices_m[found.counts])
        if found.model is not None and found.model_accuracy_m is not None:
            drawn = draw_surface(found.model, error_colours(found.model_accuracy_m), SIDES, frame, VIEW_PIXELS)
        else:
            drawn = draw_cloud(found.points_m, error_colours(found.accuracy_m), SIDES, frame, VIEW_PIXELS)
        seen = coverage_colours(found.coverage_m, found.counts)
        covered = draw_surface(trial.truth, seen, SIDES, frame, VIEW_PIXELS)
        title = str(parts().row_title(name))
        accuracy.append(title + pictures(drawn, SIDES, f"model of {name}"))
        coverage.append(title + pictures(covered, SIDES, f"true surface, {name}"))
    return section(
        "model",
        "The models",
        "Every model from the same sides, in the same colours.",
        _in_colour(trials)
        + panel("Accuracy", "Reconstructions, coloured by distance to the true surface.", near, "".join(accuracy))
        + panel("Completeness", "The true surface, coloured by distance to the model.", far, "".join(coverage)),
    )


def _in_colour(trials: Mapping[str, Trial]) -> str:
    """The models in the colours of their photographs, one row each; empty if none has any."""
    rows = []
    for name, trial in trials.items():
        found = coloured_model(trial)
        if found is not None:
            surface, colours = found
            drawn = draw_surface(surface, colours, SIDES, ViewBounds.around(surface.vertices_m), VIEW_PIXELS)
            rows.append(str(parts().row_title(name)) + pictures(drawn, SIDES, f"model of {name} in colour"))
    return panel("Likeness", "The models in the colours of their photographs.", "", "".join(rows)) if rows else ""
