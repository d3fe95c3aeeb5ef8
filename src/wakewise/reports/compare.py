"""Several methods side by side on one page: figures, water, photographs from the same viewpoint, models."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from pathlib import Path

import cv2

from wakewise.errors import InputError
from wakewise.files import write_text
from wakewise.reports import figures
from wakewise.reports.errors import ModelErrors, model_errors
from wakewise.reports.ink import NOT_COUNTED, NOT_COVERED, OVER_LIMIT, data_uri, error_colours
from wakewise.reports.page import absence, error_scale, missing, panel, pictures, plot, section, whole_page
from wakewise.reports.photos import embed
from wakewise.reports.trial import Trial, read_trial
from wakewise.reports.views import SIDES, Frame, coverage_colours, draw_cloud, draw_surface
from wakewise.reports.words import grouped, number, shown, unit, verdict

VIEW_PIXELS = 300
PHOTO_WIDTH = 720
VIEWPOINTS = 3
ROWS = ("rows.png", "rows.jpg", "rows.webp")
_PLAIN = 0.01  # a smaller difference, relative to the larger value, is none
# Where less is better, where more is; for the rest a difference is neither.
_LESS = (
    "rmse_mm", "accuracy_median_mm", "accuracy_mean_mm", "accuracy_p90_mm", "completeness_mean_mm", "cameras_rmse_mm",
    "reprojection_px", "target_speed_mean_m_s", "target_speed_p95_m_s", "exposure_speed_mean_m_s", "bed_speed_p95_m_s",
    "turbidity_mean_per_m", "disturbance", "position_rmse_mm", "path_rmse_mm", "velocity_deviation_pct",
    "roll_pitch_rms_deg", "energy_kJ", "sign_flips_per_s", "fallbacks", "collisions",
)  # fmt: skip
_MORE = (
    "completeness_pct", "completeness_visible_pct", "completeness_1mm_pct", "completeness_2mm_pct", "f_score",
    "features_per_image", "inlier_matches", "registered_images",
)  # fmt: skip


def write_comparison(trials: Mapping[str, Path], out: Path) -> Path:
    """Write one page that lays trials side by side, and give its path.

    Parameters
    ----------
    trials : mapping
        Name of the method to its trial folder; ratios are to the first.
    out : Path
        The file to write; in a folder, it is called comparison.html.

    Raises
    ------
    InputError
        If there are no trials or one of the folders holds none.
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
    parts = (
        ("figures", "Figures"),
        ("water", "Water"),
        ("seen", "Seen"),
        ("model", "Models"),
    )
    links = "".join(f'<a href="#{anchor}">{title}</a>' for anchor, title in parts)
    body = (
        f'<header class="top">{_headline(trials)}</header>'
        f'<nav class="parts" aria-label="parts"><div>{links}</div></nav>'
        f"<main>{_figures(trials)}{_water(trials)}{_rows(rows)}{_seen(trials)}{_models(trials, errors)}</main>"
        "<footer>Ratios are to the first method. One trial per method is one draw: only many seeds say how large a "
        "difference is. Made by Wakewise.</footer>"
    )
    return whole_page(f"{' and '.join(trials)} · Wakewise", body)


def _headline(trials: Mapping[str, Trial]) -> str:
    first, *others = trials
    seeds = {trial.seed for trial in trials.values()}
    same = f"seed <b>{escape(seeds.pop())}</b>" if len(seeds) == 1 else "<b>different seeds</b>"
    title = f"{first} against {' and '.join(others)}" if others else first
    lines = []
    for name in others:
        ratio = _ratio(trials, name, "target_speed_mean_m_s")
        if ratio is not None and abs(ratio - 1.0) <= _PLAIN:
            lines.append(f"With {name} the water at the target moved as fast as with {first}.")
        elif ratio is not None:
            lines.append(f"With {name} the water at the target moved at {number(ratio)} times its speed with {first}.")
    for name, trial in trials.items():
        lines.append(f"{name}: {verdict(trial).headline}")
    said = "".join(f'<p class="why">{escape(line)}</p>' for line in lines)
    return f'<p class="eyebrow"><span>comparison</span><span>{same}</span></p><h1>{escape(title)}</h1>{said}'


def _ratio(trials: Mapping[str, Trial], name: str, key: str) -> float | None:
    first = next(iter(trials))
    value, base = trials[name].metrics.number(key), trials[first].metrics.number(key)
    return None if value is None or not base else value / base


def _figures(trials: Mapping[str, Trial]) -> str:
    first = next(iter(trials))
    heads = "".join(
        f'<th class="num">{escape(name)}</th>' + ("" if name == first else '<th class="num">ratio</th>')
        for name in trials
    )
    tables = []
    keys: dict[str, list[str]] = {}
    for trial in trials.values():
        for group, found in grouped(trial.metrics).items():
            known = keys.setdefault(group, [])
            known += [key for key in found if key not in known]
    for group, found in keys.items():
        rows = "".join(_row(trials, key) for key in found)
        tables.append(
            f'<table class="compare"><caption>{group}</caption><colgroup><col class="key"><col class="unit"></colgroup>'
            f"<thead><tr><th>key</th><th>unit</th>{heads}</tr></thead>"
            f"<tbody>{rows}</tbody></table>"
        )
    content = f'<div class="wide">{"".join(tables)}</div>' if tables else missing("the figures", "none recorded")
    lead = f"Ratios are to {escape(first)}. The better value of a row is bold where it is better by more than 1 %."
    return section("figures", "The figures", lead, content)


def _row(trials: Mapping[str, Trial], key: str) -> str:
    known = {name: value for name, trial in trials.items() if (value := trial.metrics.number(key)) is not None}
    best = None
    values = list(known.values())
    if values and max(values) - min(values) > _PLAIN * max(map(abs, values)) and key in _LESS + _MORE:
        best = min(known.values()) if key in _LESS else max(known.values())
    cells = []
    for i, (name, trial) in enumerate(trials.items()):
        value = trial.metrics.values.get(key)
        text = escape(shown(value))
        if value is None:
            why = escape(str(trial.metrics.why.get(key, "not recorded")), quote=True)
            text = f'<span class="null" title="{why}">–</span>'
        style = "num better" if best is not None and known.get(name) == best else "num"
        cells.append(f'<td class="{style}">{text}</td>')
        if i:
            ratio = None if key in ("seed", "rmse_cap_mm") else _ratio(trials, name, key)
            cells.append(f'<td class="num unit">{"" if ratio is None else "× " + number(ratio)}</td>')
    units = next((u for trial in trials.values() if (u := unit(trial.metrics, key))), "")
    return f'<tr><td class="key">{escape(key)}</td><td class="unit">{escape(units)}</td>{"".join(cells)}</tr>'


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
        ),
    )


def _rows(picture: Path | None) -> str:
    if picture is None:
        return ""
    image = cv2.imread(str(picture), cv2.IMREAD_COLOR)
    if image is None:
        return ""
    jpeg = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, 86])[1]
    said = "each method at three times, by the camera and from outside"
    return section(
        "rows",
        "At the same times",
        "Each method at the same times after its first photograph: what its camera saw, and the vehicle and its wash.",
        f'<button type="button" class="photo" data-facts="{said}"><img alt="{said}" '
        f'src="{data_uri(jpeg.tobytes(), "image/jpeg")}"></button>',
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
        cells = []
        for name in trials:
            shot = by_name[name][common[i]]
            source = embed(shot, PHOTO_WIDTH)
            sharpness = "" if shot.sharpness is None else f", sharpness {number(shot.sharpness)}"
            turbidity = "" if shot.turbidity_per_m is None else f", turbidity {number(shot.turbidity_per_m, 2)} /m"
            said = f"{name}: {shot.time_s:.1f} s{sharpness}{turbidity}"
            picture = '<div class="empty">no image file</div>'
            if source is not None:
                picture = f'<img alt="{escape(shot.name, quote=True)}" src="{source}">'
            kind = "photo" if source is not None else "photo gone"
            cells.append(
                f'<figure><button type="button" class="{kind}" data-facts="{escape(said, quote=True)}">'
                f"{picture}</button>"
                f"<figcaption>{escape(said)}</figcaption></figure>"
            )
        rows.append(f'<p class="sheet-leg">{escape(common[i])}</p><div class="columns">{"".join(cells)}</div>')
    lead = "The same viewpoint, photographed with every method; a click enlarges."
    return section("seen", "What was seen", lead, "".join(rows))


def _models(trials: Mapping[str, Trial], errors: Mapping[str, ModelErrors | None]) -> str:
    near = error_scale("error (mm)", ((OVER_LIMIT, "more"),))
    far = error_scale("distance (mm)", ((NOT_COVERED, "not covered"), (NOT_COUNTED, "does not count")))
    accuracy, coverage = [], []
    for name, trial in trials.items():
        found = errors[name]
        if found is None or trial.truth is None:
            gap = missing(f"the model of {name}", absence(trial, "dense.ply", "truth.ply"))
            accuracy.append(gap)
            coverage.append(gap)
            continue
        frame = Frame.around(trial.truth.vertices_m[found.counts])
        if found.model is not None and found.model_accuracy_m is not None:
            drawn = draw_surface(found.model, error_colours(found.model_accuracy_m), SIDES, frame, VIEW_PIXELS)
        else:
            drawn = draw_cloud(found.points_m, error_colours(found.accuracy_m), SIDES, frame, VIEW_PIXELS)
        seen = coverage_colours(found.coverage_m, found.counts)
        covered = draw_surface(trial.truth, seen, SIDES, frame, VIEW_PIXELS)
        title = f'<p class="sheet-leg">{escape(name)}</p>'
        accuracy.append(title + pictures(drawn, SIDES, f"model of {name}"))
        coverage.append(title + pictures(covered, SIDES, f"true surface, {name}"))
    return section(
        "model",
        "The models",
        "Every model from the same sides, in the same colours.",
        panel("Accuracy", "Reconstructions, coloured by distance to the true surface.", near, "".join(accuracy))
        + panel("Completeness", "The true surface, coloured by distance to the model.", far, "".join(coverage)),
    )
