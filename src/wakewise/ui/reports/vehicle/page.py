"""A vehicle as one self-contained HTML page: drawing, what its thrusters can do, every parameter with its source."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from html import escape
from importlib import resources
from itertools import groupby
from typing import Any

import numpy as np

from wakewise.core.arrays import Array
from wakewise.robot.vehicles.check import WRENCH_AXES, AnyVehicle
from wakewise.robot.vehicles.describe import as_draft, describe, parameters
from wakewise.robot.vehicles.draft import VehicleDraft
from wakewise.ui.reports.text import NONE, shown
from wakewise.ui.reports.vehicle.drawing import drawing_svg


@dataclass(frozen=True)
class HtmlCell:
    """A table cell that is written as HTML already."""

    html: str


def vehicle_page(vehicle: AnyVehicle) -> str:
    """Write a vehicle, whole or not, as an HTML page that needs nothing from elsewhere."""
    draft = as_draft(vehicle)
    facts = describe(draft)
    style = (resources.files("wakewise.ui.reports.vehicle") / "page.css").read_text("utf-8")
    drawing = [_card("Drawing", "All views to one scale.", drawing_svg(draft, titled=False))] if draft.thrusters else []
    body = [
        _header(draft, facts),
        *drawing,
        '<div class="pair">',
        _card(
            "Achievable wrench",
            "Largest along each axis with the other five held at zero, within the thrust limits.",
            _wrench(facts),
        ),
        _card(
            "Null space",
            "Thrusts that fight each other and make no wrench; T1, T2 … are thrusters.",
            _null_space(facts),
        ),
        "</div>",
        _card(
            "If one thruster fails",
            "Percent left of the achievable wrench along each axis (the weaker of its two directions).",
            _legend("loss", "0 %: the axis is lost", "100 %: nothing is lost") + _failures(facts),
        ),
        _mixing(facts),
        _card(
            "Thrusters", "Places from the body origin; the force axis is the push on the vehicle.", _thrusters(facts)
        ),
        _card(
            "Allocation matrix",
            "Wrench about the body origin per newton of thrust: N/N, and N m/N below.",
            _legend("sign", "pushes against the axis", "along it") + _matrix(draft.allocation_matrix),
        ),
        _card("Parameters", "Every number with its unit and source.", _parameters(draft)),
        _full_matrices(draft),
    ]
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        '<meta name="color-scheme" content="light dark">'
        f"<title>{escape(draft.title)}</title><style>{style}</style></head><body><main>\n"
        + "\n".join(part for part in body if part)
        + "\n</main></body></html>\n"
    )


def _header(draft: VehicleDraft, facts: dict[str, Any]) -> str:
    n, rank = len(draft.thruster_names), facts["rank"]
    short = "warn" if rank is not None and rank < 6 else ""
    chips = [
        _chip(f"{n} thrusters"),
        _chip(f"rank {shown(rank)} of 6", short),
        _chip(facts["actuation"].split(":")[0], short),
        _chip("can fly", "good") if not draft.missing else _chip("incomplete, cannot fly", "warn"),
    ]
    parts = [
        f"<h1>{escape(draft.title)}</h1>",
        f'<p class="muted">Body frame: x forward, y right, z down. {escape(_sentence(facts["actuation"]))}</p>',
        f'<div class="chips">{"".join(chips)}</div>',
        f"<p><b>Source.</b> {escape(draft.source)}</p>",
        f"<p><b>Does not claim.</b> {escape(draft.does_not_claim)}</p>",
    ]
    if draft.missing:
        parts.append(f"<p><b>Missing.</b> {escape(', '.join(draft.missing))}.</p>")
    if draft.notes:
        parts.append(
            f"<p><b>Notes.</b></p><ul>{''.join(f'<li>{escape(_sentence(note))}</li>' for note in draft.notes)}</ul>"
        )
    return f"<header>{''.join(parts)}</header>"


def _wrench(facts: dict[str, Any]) -> str:
    wrench = facts["achievable_wrench"]
    if wrench is None:
        return f"<p>Not known: {escape(facts['why'].get('achievable_wrench', 'no reason was given'))}.</p>"
    largest = {
        unit: max(
            (max(-(w["lowest"] or 0.0), w["highest"] or 0.0) for w in wrench.values() if w["unit"] == unit), default=0.0
        )
        or 1.0
        for unit in ("N", "N m")
    }
    rows = []
    for axis, w in wrench.items():
        sides = (-(w["lowest"] or 0.0), w["highest"] or 0.0)
        left, right = (100.0 * value / largest[w["unit"]] for value in sides)
        rows.append(
            f'<b>{axis}</b><span class="num">{_told(w["lowest"])} {w["unit"]}</span>'
            f'<span class="left"><i style="width:{left:.1f}%"></i></span>'
            f'<span class="right"><i style="width:{right:.1f}%"></i></span>'
            f"<span>{_told(w['highest'], '+.4g')} {w['unit']}</span>"
        )
    return f'<div class="bars">{"".join(rows)}</div>'


def _null_space(facts: dict[str, Any]) -> str:
    if not facts["null_space"]:
        return "<p>None: no thrusts cancel each other.</p>"
    parts = []
    for vector in facts["null_space"]:
        cells = "".join(_fighter(number, thrust) for number, thrust in enumerate(vector["thrusts"], start=1))
        parts.append(
            f"<p><b>{escape(vector['name'])}</b><br><span class='muted'>{escape(_sentence(vector['words']))}</span></p>"
            f'<div class="fight">{cells}</div><br>'
        )
    return "".join(parts)


def _told(value: float | None, form: str = ".4g") -> str:
    return NONE if value is None else f"{value + 0.0:{form}}"


def _fighter(number: int, thrust: float | None) -> str:
    if thrust is None:
        return f"<span>T{number} {NONE}</span>"
    kind = "plus" if thrust > 1e-6 else "minus" if thrust < -1e-6 else ""
    shown = f"{thrust:+.2f}" if kind else "0"
    return f'<span class="{kind}">T{number} {shown}</span>'


def _failures(facts: dict[str, Any]) -> str:
    rows = []
    for failure in facts["failures"]:
        left = failure["left_pct"]
        cells = []
        for axis in WRENCH_AXES:
            values = [] if left is None else [v for v in left[axis] if v is not None]
            if not values:
                cells.append(HtmlCell('<td class="cell muted">–</td>'))
                continue
            worst = min(values)
            lost_share = 1.0 - min(max(worst, 0.0), 100.0) / 100.0
            cells.append(HtmlCell(f'<td class="cell lost" style="--share:{lost_share:.2f}">{worst:.0f}</td>'))
        lost = ", ".join(failure["lost"]) or "none"
        rows.append([shown(failure["thruster"]), failure["name"], shown(failure["rank"]), lost, *cells])
    heads = ["", "thruster", "rank left", "axes lost", *WRENCH_AXES]
    return _table(heads, rows)


def _mixing(facts: dict[str, Any]) -> str:
    found = facts["mixing"]
    if found is None:
        return ""
    lines = [f"<p>{shown(found['agree'])} of {shown(found['compared'])} entries agree.</p>"]
    if facts["mixing_disagreements"]:
        rows = [
            [
                d["row"],
                f"{shown(d['thruster'])} {d['name']}",
                _told(d["stated"], "+.4g"),
                _told(d["geometry"], "+.4g"),
                d["fault"],
            ]
            for d in facts["mixing_disagreements"]
        ]
        lines.append(_table(["row", "thruster", "file says", "geometry says", "fault"], rows))
    lines += [f"<p>{escape(_sentence(note))}</p>" for note in found["notes"]]
    return _card("Against a stated matrix", escape(found["stated_by"]), "".join(lines))


def _thrusters(facts: dict[str, Any]) -> str:
    rows = [
        [
            shown(t["number"]),
            t["name"],
            *(_told(value, "+.3f") for value in t["position_m"]),
            " ".join(_told(value, "+.3f") for value in t["axis"]),
            *("missing" if t[key] is None else f"{t[key]:g}" for key in ("max_forward_N", "max_reverse_N")),
            "missing" if t["disk_area_m2"] is None else f"{1e4 * t['disk_area_m2']:.3g}",
            "missing" if t["time_constant_s"] is None else f"{t['time_constant_s']:g}",
        ]
        for t in facts["thrusters"]
    ]
    heads = ["", "name", "x m", "y m", "z m", "force axis", "forward N", "reverse N", "disk cm2", "lag s"]
    return _table(heads, rows) if rows else "<p>The file holds a matrix only.</p>"


def _matrix(matrix: Array) -> str:
    rows: list[list[Any]] = []
    for i, axis in enumerate(WRENCH_AXES):
        largest = float(abs(matrix[3 * (i // 3) : 3 * (i // 3) + 3]).max()) or 1.0
        cells = []
        for value in matrix[i] + 0.0:
            kind, share = "plus" if value > 0 else "minus", abs(float(value)) / largest
            shown = f"{value:+.3f}" if abs(value) > 5e-4 else "0"
            cells.append(HtmlCell(f'<td class="cell {kind}" style="--share:{share:.2f}">{shown}</td>'))
        rows.append([axis, *cells])
    return _table(["", *(f"T{j}" for j in range(1, matrix.shape[1] + 1))], rows)


def _parameters(draft: VehicleDraft) -> str:
    """A source that several rows share is written once, beside all of them."""
    rows = []
    for source, group in groupby(parameters(draft), key=lambda p: p.source):
        alike = list(group)
        for number, p in enumerate(alike):
            mark = '<span class="badge">estimate</span>' if p.estimate else ""
            if p.value is None:
                mark = '<span class="badge warn">missing</span>'
            row = [
                HtmlCell(f'<td class="nowrap">{escape(p.quantity)}</td>'),
                HtmlCell(f'<td class="value">{escape(p.value or "")}</td>'),
                HtmlCell(f'<td class="nowrap">{escape(p.unit)}</td>'),
                HtmlCell(f"<td>{mark}</td>"),
            ]
            if number == 0:
                row.append(HtmlCell(f'<td class="source" rowspan="{len(alike)}">{escape(source)}</td>'))
            rows.append(row)
    return _table(["quantity", "value", "unit", "", "source"], rows)


def _full_matrices(draft: VehicleDraft) -> str:
    """Matrices with couplings, which the table of parameters only hints at."""
    parts = []
    for title, unit, matrix in (
        ("Added mass", "kg, kg m, kg m2", draft.added_mass),
        ("Linear damping", "N s/m, N s, N m s", draft.linear_damping),
    ):
        if matrix is None or np.array_equal(matrix, np.diag(np.diag(matrix))):
            continue
        rows = [[axis, *(f"{value + 0.0:.5g}" for value in matrix[i])] for i, axis in enumerate(WRENCH_AXES)]
        parts.append(_card(f"{title}, whole", unit, _table(["", *WRENCH_AXES], rows)))
    return "".join(parts)


def _table(heads: Iterable[str], rows: Iterable[Iterable[Any]]) -> str:
    """A table; anything but a `HtmlCell` is written as text."""
    top = "".join(f"<th>{escape(head)}</th>" for head in heads)
    lines = []
    for row in rows:
        cells = (c.html if isinstance(c, HtmlCell) else f"<td>{escape(str(c))}</td>" for c in row)
        lines.append(f"<tr>{''.join(cells)}</tr>")
    return f"<table><thead><tr>{top}</tr></thead><tbody>{''.join(lines)}</tbody></table>"


def _card(title: str, hint: str, content: str) -> str:
    return f'<section class="card"><h2>{escape(title)}</h2><p class="hint">{hint}</p>{content}</section>'


def _sentence(words: str) -> str:
    """A note as a sentence; the first word keeps its letters."""
    return f"{words[:1].upper()}{words[1:].rstrip('.')}."


def _legend(kind: str, left: str, right: str) -> str:
    """What the colours of the cells below mean, from end to end."""
    return f'<p class="legend"><span>{escape(left)}</span><i class="{kind}"></i><span>{escape(right)}</span></p>'


def _chip(words: str, kind: str = "") -> str:
    return f'<span class="chip {kind}">{escape(words)}</span>'
