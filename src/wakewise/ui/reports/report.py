"""Report of one trial: a single HTML page with verdict, model, flight, photographs, water, limits and all figures."""

from __future__ import annotations

import shlex
from pathlib import Path

from markupsafe import Markup

from wakewise.core.errors import InputError
from wakewise.core.files import write_text
from wakewise.operation.flight_trim import ballast_proposal
from wakewise.ui.reports import figures
from wakewise.ui.reports.media import colours_html, contact_sheet, film_html, found_html
from wakewise.ui.reports.model import before_colours, before_mesh, coverage_html, model_section
from wakewise.ui.reports.page import (
    PageParts,
    collapsible_section,
    framed_page,
    missing,
    missing_text,
    parts,
    plot,
    prose,
    section,
    template,
    tile,
)
from wakewise.ui.reports.references import limits_section, yardstick_html
from wakewise.ui.reports.scene3d import vehicle_of
from wakewise.ui.reports.text import NONE, capitalised, grouped, number, shown, unit, verdict
from wakewise.ui.reports.trial import Trial, read_trial
from wakewise.vision.evaluation.cloud_to_surface import SUCCESS_COMPLETENESS_PCT, SUCCESS_RMSE_MM


def trim_html(trial: Trial) -> str:
    """Proposed change of the ballast; empty if the hover shows none."""
    if trial.settings is None or trial.steps is None:
        return ""
    try:
        proposal = ballast_proposal(trial.settings.parts().vehicle, trial.steps)
    except InputError:  # the vehicle was given in Python
        return ""
    return "" if proposal is None else str(template("trial.html").flown_trim(proposal))


PARTS = (
    ("yardstick", "Yardstick"),
    ("model", "Model"),
    ("flown", "Flown"),
    ("seen", "Seen"),
    ("water", "Water"),
    ("limits", "Limits"),
    ("figures", "Figures"),
    ("again", "Reproduce"),
)


def begin_report(trial: Path, draft: PageParts, missing: str) -> None:
    """Make the parts of a report that can be made before its folder is complete, and keep them in `draft`.

    `missing` says what is still being made: "mesh" (mesh and colours) or "colours". Raises as `write_report`.
    """
    read = read_trial(trial)
    _seen_photographs(read, draft)
    coverage_html(read, draft)
    draft.once("flown", lambda: _flown(read))
    draft.once("water", lambda: _water(read))
    before_mesh(read, draft)
    if missing == "colours":
        before_colours(read, draft)
        draft.once("seen", lambda: colours_html(read))


def write_report(trial: Path, draft: PageParts | None = None) -> Path:
    """Write report.html into a trial folder and give its path; `draft` holds the parts that are made already.

    The page is one file that opens with no network. A part of the folder that is missing leaves a gap that says why.

    Raises InputError if `trial` is not a folder or holds nothing of a trial.
    """
    read = read_trial(trial)
    path = trial / "report.html"
    write_text(path, report_page(read, draft))
    return path


def report_page(trial: Trial, draft: PageParts | None = None) -> str:
    """HTML of the whole report; `draft` holds the parts that are made already."""
    draft = draft or PageParts()
    calm = yardstick_html(trial)
    sections = (
        calm,
        model_section(trial, draft),
        draft.once("flown", lambda: _flown(trial)),
        _seen(trial, draft),
        draft.once("water", lambda: _water(trial)),
        limits_section({trial.name: trial}),
        _figures(trial),
        _again(trial),
    )
    links = [part for part in PARTS if calm or part[0] != "yardstick"]
    return framed_page(f"{trial.name} · Wakewise", _header(trial), links, sections, _footer(trial))


def _header(trial: Trial) -> str:
    found = verdict(trial, named=True)
    facts = [("trial", trial.name), ("method", trial.method), ("seed", trial.seed)]
    facts += [(key, str(trial.scenario[key])) for key in ("vehicle",) if trial.scenario.get(key)]
    return str(
        parts().header(
            facts,
            found.headline,
            {True: "good", False: "bad", None: ""}[found.good],
            [prose(line) for line in found.reasons],
            [Markup(one) for one in _tiles(trial)],
            outside=capitalised(trial.outside),
        )
    )


def _tiles(trial: Trial) -> list[str]:
    metrics = trial.metrics

    def one(name: str, key: str, unit_name: str, note: str, scale: float = 1.0, ok: bool | None = None) -> str:
        value = metrics.number(key)
        if value is None:
            return tile(name, NONE, "", _short(metrics.why.get(key, "not recorded")))
        state = "" if ok is None else "ok" if ok else "off"
        return tile(name, number(scale * value), unit_name, note, state)

    rmse, covered = metrics.number("rmse_mm"), metrics.number("completeness_pct")
    registered, images = metrics.number("registered_images"), metrics.number("images")
    photos = tile("photographs placed", NONE, "", _short(metrics.why.get("registered_images", "not recorded")))
    if registered is not None:
        of = "" if images is None else f"of {images:.0f}"
        photos = tile("photographs placed", f"{registered:.0f}", of, "registered in the model")
    during, energy = metrics.number("exposure_speed_mean_m_s"), metrics.number("energy_kJ")
    wash = "wash, mean" if during is None else f"wash, mean; {number(1e3 * during)} while exposing"
    fine = None if rmse is None else rmse < SUCCESS_RMSE_MM
    whole = None if covered is None else covered > SUCCESS_COMPLETENESS_PCT
    return [
        one("RMSE", "rmse_mm", "mm", f"limit {SUCCESS_RMSE_MM:g} mm", ok=fine),
        one("surface within 3 mm", "completeness_pct", "%", f"limit {SUCCESS_COMPLETENESS_PCT:g} %", ok=whole),
        photos,
        one("water at the target", "target_speed_mean_m_s", "mm/s", wash, scale=1e3),
        one("position error", "position_rmse_mm", "mm", "rms, from the reference"),
        one("flight", "duration_s", "s", "duration" if energy is None else f"{number(energy)} kJ in the thrusters"),
    ]


def _short(why: str) -> str:
    """A reason for a tile: the header has said why there is no model."""
    return "no model" if why.startswith("no model") else why


def _flown(trial: Trial) -> str:
    legs = [name for name, _, _ in figures.legs(trial)]
    orbits = len({name for name in legs if name.startswith("orbit")})
    duration = trial.metrics.number("duration_s")
    lead = "The path that the vehicle really took and the photographs where they were really taken."
    if orbits:
        within = "" if duration is None else f" in {number(duration)} s"
        lead = f"{f'{orbits} orbits' if orbits > 1 else 'One orbit'}{within}. {lead}"
    return section(
        "flown",
        "What was flown",
        lead,
        trim_html(trial)
        + found_html(trial)
        + film_html(trial)
        + plot(
            figures.plan_and_side(trial),
            "flight from above and from the side",
            "Arrows point where the camera looked; crosses are the planned viewpoints.",
            missing_text(trial, "steps.parquet", "images.csv"),
            narrow=figures.plan_and_side(trial, narrow=True),
        ),
    )


def _leg_of(trial: Trial, time_s: float) -> str:
    """Leg on which a photograph was taken; shutters open just where an orbit begins and ends, so orbits go first."""
    near_s = 0.05
    names = [name for name, start, stop in figures.legs(trial) if start - near_s <= time_s <= stop + near_s]
    return next((name for name in names if name.startswith("orbit")), names[0] if names else "")


def _seen_photographs(trial: Trial, draft: PageParts) -> str:
    leg_of = {i: _leg_of(trial, shot.time_s) for i, shot in enumerate(trial.photographs)}
    return draft.once("photographs", lambda: contact_sheet(trial, leg_of))


def _seen(trial: Trial, draft: PageParts) -> str:
    if not trial.photographs:
        gap = missing("the photographs", missing_text(trial, "images.csv"))
        return section("seen", "What was seen", "No photographs are on record.", gap)
    lead = str(template("trial.html").seen_lead(len(trial.photographs)))
    return section(
        "seen",
        "What was seen",
        lead,
        _seen_photographs(trial, draft) + coverage_html(trial, draft) + draft.once("seen", lambda: colours_html(trial)),
    )


def _water(trial: Trial) -> str:
    gap = missing_text(trial, "steps.parquet")
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


def _figures(trial: Trial) -> str:
    metrics = trial.metrics
    if not metrics.values:
        gap = missing("the figures", missing_text(trial, "metrics.json"))
        return section("figures", "The figures", "No figures are on record.", gap)
    tables = []
    given: set[str] = set()
    for group, keys in grouped(metrics).items():
        rows = [_row(trial, key, given) for key in keys]
        heads, columns = ("key", "value", "unit", "definition"), ("key", "val", "unit", "")
        table = parts().table("knum", heads, rows, "figures", columns, wide=False)
        tables.append(collapsible_section(group, table, f"{len(keys)} figures"))
    lead = "Everything in metrics.json. A figure that could not be computed says why."
    return section("figures", "The figures", lead, "".join(tables))


def _row(trial: Trial, key: str, given: set[str]) -> tuple[str, ...]:
    """Cells of one figure; `given` are the reasons of the rows above, which are not repeated."""
    metrics = trial.metrics
    value, reason = metrics.values[key], ""
    if value is None:
        why = str(metrics.why.get(key, "no reason was given"))
        reason = "not computed, for the reason above" if why in given else f"not computed: {why}"
        given.add(why)
    macros = template("trial.html")
    text = macros.definition(str(metrics.definitions.get(key, "")), reason)
    return key, macros.dash() if value is None else shown(value), unit(metrics, key), text


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
    if trial.scenario.get("overrides"):
        command = f"ww.trial(parts.replace(...), {trial.name + '-again'!r})"
        how = (
            "Some parts were given in Python, which a scenario file cannot hold: run the script that gave them. The "
            "file has every other setting; the same seed and parts give the same flight."
        )
    facts = [("seed", trial.seed), ("method", trial.method), ("versions", ", ".join(known) or "not recorded")]
    content = str(template("trial.html").again(command, facts, trial.scenario_text))
    if not trial.scenario_text:
        content += missing("the scenario", missing_text(trial, "scenario.yaml"))
    if trial.missing:
        content += str(template("trial.html").gaps(trial.missing.items()))
    return section("again", "How to reproduce it", how, content)


def _footer(trial: Trial) -> str:
    origin = "Vehicle, water and photographs of this trial are simulated. " if "tank" in trial.scenario else ""
    return f"{origin}World axes are north, east, down; heights in pictures are above the bed. Made by Wakewise."
