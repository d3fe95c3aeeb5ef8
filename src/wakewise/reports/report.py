"""The report of one trial: a single HTML page for people who fly and people who measure."""

from __future__ import annotations

import shlex
from html import escape
from pathlib import Path

from wakewise.evaluation.surface import SUCCESS_COMPLETENESS_PCT, SUCCESS_RMSE_MM
from wakewise.files import write_text
from wakewise.reports import figures
from wakewise.reports.errors import ModelErrors, model_errors
from wakewise.reports.ink import NOT_COUNTED, NOT_COVERED, OVER_LIMIT, error_colours
from wakewise.reports.looks import coloured_model, colours_html, film_html
from wakewise.reports.page import (
    absence,
    chip,
    error_scale,
    fold,
    missing,
    panel,
    pictures,
    plot,
    scene_box,
    section,
    tile,
    whole_page,
)
from wakewise.reports.photos import contact_sheet
from wakewise.reports.scene3d import CAMERA_RGB, HULL_RGB, PATH_RGB, PLANNED_RGB, scene_html, vehicle_of
from wakewise.reports.trial import Trial, read_trial
from wakewise.reports.views import OUTLOOK, SIDES, Frame, coverage_colours, draw_cloud, draw_surface
from wakewise.reports.words import grouped, number, shown, unit, verdict
from wakewise.reports.yardstick import yardstick_html

VIEW_PIXELS = 360
PARTS = (
    ("yardstick", "Yardstick"),
    ("model", "Model"),
    ("flown", "Flown"),
    ("seen", "Seen"),
    ("water", "Water"),
    ("figures", "Figures"),
    ("again", "Reproduce"),
)


def write_report(trial: Path) -> Path:
    """Write report.html into a trial folder and give its path.

    The page is one file that opens with no network. A part of the folder that is missing leaves a gap that says why.

    Raises
    ------
    InputError
        If `trial` is not a folder or holds nothing of a trial.
    """
    read = read_trial(trial)
    path = trial / "report.html"
    write_text(path, report_page(read))
    return path


def report_page(trial: Trial) -> str:
    """HTML of the whole report."""
    errors = model_errors(trial)
    calm = yardstick_html(trial)
    parts = [part for part in PARTS if calm or part[0] != "yardstick"]
    links = "".join(f'<a href="#{anchor}">{title}</a>' for anchor, title in parts)
    body = (
        f'<header class="top">{_headline(trial)}</header><nav class="parts" aria-label="parts"><div>{links}</div></nav>'
        f"<main>{calm}{_model(trial, errors)}{_flown(trial)}{_seen(trial)}{_water(trial)}{_figures(trial)}"
        f"{_again(trial)}</main><footer>{_footer(trial)}</footer>"
    )
    return whole_page(f"{trial.name} · Wakewise", body)


def _headline(trial: Trial) -> str:
    said = verdict(trial, named=True)
    state = {True: "good", False: "bad", None: ""}[said.good]
    reasons = "".join(f'<p class="why">{escape(line)}</p>' for line in said.reasons)
    facts = [("trial", trial.name), ("method", trial.method), ("seed", trial.seed)]
    facts += [(key, str(trial.scenario[key])) for key in ("vehicle",) if trial.scenario.get(key)]
    eyebrow = "".join(f"<span>{name} <b>{escape(value)}</b></span>" for name, value in facts)
    foreign = f'<p class="outside">{escape(_capital(trial.outside))}.</p>' if trial.outside else ""
    return (
        f'<p class="eyebrow">{eyebrow}</p><h1 class="{state}"><span class="mark"></span>{escape(said.headline)}</h1>'
        f'{foreign}{reasons}<dl class="tiles">{_tiles(trial)}</dl>'
    )


def _tiles(trial: Trial) -> str:
    metrics = trial.metrics

    def one(name: str, key: str, unit_name: str, note: str, scale: float = 1.0, ok: bool | None = None) -> str:
        value = metrics.number(key)
        if value is None:
            return tile(name, "–", "", _short(metrics.why.get(key, "not recorded")))
        state = "" if ok is None else "ok" if ok else "off"
        return tile(name, number(scale * value), unit_name, note, state)

    rmse, covered = metrics.number("rmse_mm"), metrics.number("completeness_pct")
    registered, images = metrics.number("registered_images"), metrics.number("images")
    photos = tile("photographs placed", "–", "", _short(metrics.why.get("registered_images", "not recorded")))
    if registered is not None:
        of = "" if images is None else f"of {images:.0f}"
        photos = tile("photographs placed", f"{registered:.0f}", of, "registered in the model")
    during = metrics.number("exposure_speed_mean_m_s")
    return (
        one(
            "RMSE", "rmse_mm", "mm", f"limit {SUCCESS_RMSE_MM:g} mm",
            ok=None if rmse is None else rmse < SUCCESS_RMSE_MM,
        )
        + one(
            "surface within 3 mm", "completeness_pct", "%", f"limit {SUCCESS_COMPLETENESS_PCT:g} %",
            ok=None if covered is None else covered > SUCCESS_COMPLETENESS_PCT,
        )
        + photos
        + one(
            "water at the target", "target_speed_mean_m_s", "mm/s",
            "wash, mean" if during is None else f"wash, mean; {number(1e3 * during)} while exposing", scale=1e3,
        )
        + one("position error", "position_rmse_mm", "mm", "rms, from where it was wished to be")
        + one("flight", "duration_s", "s", _energy(trial))
    )  # fmt: skip


def _short(why: str) -> str:
    """A reason for a tile: the header has said why there is no model."""
    return "no model" if why.startswith("no model") else why


def _capital(words: str) -> str:
    return words[:1].upper() + words[1:]


def _energy(trial: Trial) -> str:
    energy = trial.metrics.number("energy_kJ")
    return "duration" if energy is None else f"{number(energy)} kJ in the thrusters"


def _flown(trial: Trial) -> str:
    legs = [name for name, _, _ in figures.legs(trial)]
    orbits = len({name for name in legs if name.startswith("orbit")})
    duration = trial.metrics.number("duration_s")
    lead = "The path that the vehicle really took and the photographs where they were really taken."
    if orbits:
        lead = (
            (f"{orbits} orbits" if orbits > 1 else "One orbit")
            + ("" if duration is None else f" in {number(duration)} s")
            + ". "
            + lead
        )
    return section(
        "flown",
        "What was flown",
        lead,
        film_html(trial)
        + plot(
            figures.plan_and_side(trial),
            "flight from above and from the side",
            "Arrows point where the camera looked; crosses are the planned viewpoints.",
            absence(trial, "steps.parquet", "images.csv"),
            narrow=figures.plan_and_side(trial, narrow=True),
        ),
    )


def _scene(trial: Trial, errors: ModelErrors | None, poster: str) -> str:
    """The 3D scene, opened on the model, and what its layers are."""
    html = scene_html(trial, errors)
    if html is None:
        return missing("the 3D scene", absence(trial, "steps.parquet", "images.csv", "truth.ply"))
    legend = "".join(
        chip("rgb({},{},{})".format(*colour), name)
        for colour, name in (
            (PATH_RGB, "path"),
            (CAMERA_RGB, "photographs"),
            (PLANNED_RGB, "planned viewpoints"),
            (HULL_RGB, "vehicle"),
        )
    )
    if errors is not None:
        legend = error_scale("model by error (mm)") + legend
    hint = (
        '<span class="hint">Drag to turn, scroll to come closer. The button at the lower right switches layers on and '
        "off: the model by its error, photographs, path, and the vehicle, which flies when you press play.</span>"
    )
    return scene_box(html, hint + legend, poster)


def _leg_of(trial: Trial, time_s: float) -> str:
    """Leg on which a photograph was taken; shutters open just where an orbit begins and ends, so orbits go first."""
    near_s = 0.05
    names = [name for name, start, stop in figures.legs(trial) if start - near_s <= time_s <= stop + near_s]
    return next((name for name in names if name.startswith("orbit")), names[0] if names else "")


def _seen(trial: Trial) -> str:
    if not trial.photographs:
        gap = missing("the photographs", absence(trial, "images.csv"))
        return section("seen", "What was seen", "No photographs are on record.", gap)
    leg_of = {i: _leg_of(trial, shot.time_s) for i, shot in enumerate(trial.photographs)}
    lead = (
        f"{len(trial.photographs)} photographs in the order they were taken"
        '<span class="on-screen">; a click enlarges</span>. Sharpness is that of the target as it '
        "appears in the picture (variance of the Laplacian), so compare it between photographs of the same orbit."
    )
    return section("seen", "What was seen", lead, contact_sheet(trial, leg_of) + colours_html(trial))


def _water(trial: Trial) -> str:
    gap = absence(trial, "steps.parquet")
    exposures = len(figures.exposure_times(trial))
    vehicle = vehicle_of(trial)
    names = [] if vehicle is None else [thruster.name for thruster in vehicle.thrusters]
    ticks = f" Orange ticks mark the {exposures} exposures." if exposures else ""
    return section(
        "water",
        "What the water did",
        "Speeds are the excess over the same flow without the vehicle: what its jets and its hull's wake did.",
        plot(
            figures.water_over_time(trial),
            "water and position over time",
            f"Shading separates the legs.{ticks} D is no measurement: it is the controller's own wake model, asked how "
            "fast the jets move the points that its method watches (weighted sum of squared speeds).",
            gap,
            narrow=figures.water_over_time(trial, narrow=True),
        )
        + plot(
            figures.thrust_strip(trial, names),
            "thrusts over time",
            "Orange pushes along the thruster's axis, blue against it; the stronger the colour, the harder. Bars: root "
            "mean square over the flight.",
            gap,
            narrow=figures.thrust_strip(trial, names, narrow=True),
        ),
    )


def _model(trial: Trial, errors: ModelErrors | None) -> str:
    scene = _scene(trial, errors, _poster(trial, errors))
    if errors is None or trial.truth is None:
        why = absence(trial, "dense.ply", "truth.ply")
        gap = missing("the model's error", why)
        return section("model", "The model", "There is nothing to measure.", scene + gap)
    frame = Frame.around(trial.truth.vertices_m[errors.counts])
    if errors.model is not None and errors.model_accuracy_m is not None:
        colours = error_colours(errors.model_accuracy_m)
        views = draw_surface(errors.model, colours, SIDES, frame, VIEW_PIXELS)
    else:
        views = draw_cloud(errors.points_m, error_colours(errors.accuracy_m), SIDES, frame, VIEW_PIXELS)
    covered = draw_surface(
        trial.truth, coverage_colours(errors.coverage_m, errors.counts), SIDES, frame, VIEW_PIXELS
    )  # fmt: skip
    aligned = "after rigid alignment to the truth" if errors.fine_aligned else "as it came, without fine alignment"
    return section(
        "model",
        "The model",
        f"How far the reconstruction is from the true surface, {aligned}. What stands less than 10 mm above the bed "
        "does not count: sand touches it.",
        scene
        + _in_colour(trial)
        + panel(
            "Accuracy",
            "The reconstruction, coloured by its distance to the true surface.",
            error_scale("error (mm)", ((OVER_LIMIT, "more"),)),
            pictures(views, SIDES, "model"),
        )
        + panel(
            "Completeness",
            "The true surface, coloured by its distance to the nearest reconstructed point.",
            error_scale("distance (mm)", ((NOT_COVERED, "not covered"), (NOT_COUNTED, "does not count"))),
            pictures(covered, SIDES, "true surface"),
        )
        + plot(
            figures.error_histogram(errors),
            "distribution of errors",
            f"From {number(len(errors.points_m))} points of the cloud, thinned to one per 0.8 mm. The last bar holds "
            "everything beyond.",
            narrow=figures.error_histogram(errors, narrow=True),
        ),
    )


def _poster(trial: Trial, errors: ModelErrors | None) -> str:
    """The model as the 3D scene opens on it, for as long as the scene loads; empty where there is none."""
    found = coloured_model(trial)
    if found is None and errors is not None and errors.model is not None and errors.model_accuracy_m is not None:
        found = errors.model, error_colours(errors.model_accuracy_m)
    if found is None or trial.truth is None:
        return ""
    surface, colours = found
    frame = Frame.around(trial.truth.vertices_m)
    return draw_surface(surface, colours, (OUTLOOK,), frame, VIEW_PIXELS)[0]


def _in_colour(trial: Trial) -> str:
    found = coloured_model(trial)
    if found is None:
        return ""
    surface, colours = found
    views = draw_surface(surface, colours, SIDES, Frame.around(surface.vertices_m), VIEW_PIXELS)
    text = "The model in the colours of its photographs, as mesh.glb has it for other programs."
    return panel("Likeness", text, "", pictures(views, SIDES, "model in colour"))


def _figures(trial: Trial) -> str:
    metrics = trial.metrics
    if not metrics.values:
        gap = missing("the figures", absence(trial, "metrics.json"))
        return section("figures", "The figures", "No figures are on record.", gap)
    tables = []
    told: set[str] = set()
    for group, keys in grouped(metrics).items():
        rows = "".join(_row(trial, key, told) for key in keys)
        table = (
            '<table class="figures"><colgroup><col class="key"><col class="val"><col class="unit"><col></colgroup>'
            '<thead><tr><th>key</th><th class="num">value</th><th>unit</th><th>definition</th></tr></thead>'
            f"<tbody>{rows}</tbody></table>"
        )
        tables.append(fold(group, table, f"{len(keys)} figures"))
    lead = "Everything in metrics.json. A figure that could not be computed says why."
    return section("figures", "The figures", lead, "".join(tables))


def _row(trial: Trial, key: str, told: set[str]) -> str:
    """One figure; `told` are the reasons that the rows above have given, which are not given again."""
    metrics = trial.metrics
    value, text = metrics.values[key], escape(str(metrics.definitions.get(key, "")))
    cell = '<span class="null">–</span>' if value is None else escape(shown(value))
    if value is None:
        why = str(metrics.why.get(key, "no reason was given"))
        said = "not computed, for the reason above" if why in told else f"not computed: {why}"
        told.add(why)
        text = f'{text}{"<br>" if text else ""}<span class="why-null">{escape(said)}</span>'
    return (
        f'<tr><td class="key">{escape(key)}</td><td class="num">{cell}</td><td class="unit">'
        f'{escape(unit(metrics, key))}</td><td class="text">{text}</td></tr>'
    )


def _again(trial: Trial) -> str:
    versions = trial.scenario.get("versions")
    known = [f"{name} {value}" for name, value in versions.items()] if isinstance(versions, dict) else []
    # The scenario's first lines name, as comments, the versions that ran it.
    for line in trial.scenario_text.splitlines():
        if not line.startswith("#"):
            break
        known.append(line.lstrip("# ").strip())
    command = f"wakewise scan {shlex.quote(f'{trial.name}/scenario.yaml')} --out {shlex.quote(f'{trial.name}-again')}"
    how = "The scenario file holds every setting; the same seed gives the same flight."
    if trial.scenario.get("replaced"):
        command = f"ww.trial(parts.replace(...), {trial.name + '-again'!r})"
        how = (
            "Some parts were given in Python, which a scenario file cannot hold: run the script that gave them. The "
            "file has every other setting; the same seed and parts give the same flight."
        )
    facts = [("seed", trial.seed), ("method", trial.method), ("versions", ", ".join(known) or "not recorded")]
    listed = "".join(f"<dt>{name}</dt><dd>{escape(value)}</dd>" for name, value in facts)
    scenario = missing("the scenario", absence(trial, "scenario.yaml"))
    if trial.scenario_text:
        scenario = (
            f"<details><summary>scenario.yaml, everything resolved</summary><pre>{escape(trial.scenario_text)}</pre>"
            "</details>"
        )
    gaps = "".join(f"<li><code>{escape(name)}</code> {escape(why)}</li>" for name, why in trial.missing.items())
    note = f"<h3>Parts that this report had to do without</h3><ul>{gaps}</ul>" if gaps else ""
    return section(
        "again",
        "How to reproduce it",
        how,
        f'<pre class="command">{escape(command)}</pre><dl class="facts">{listed}</dl>{scenario}{note}',
    )


def _footer(trial: Trial) -> str:
    simulated = "tank" in trial.scenario
    said = "Vehicle, water and photographs of this trial are simulated. " if simulated else ""
    return f"{said}World axes are north, east, down; heights in pictures are above the bed. Made by Wakewise."
