"""Page of a vehicle: drawing, capabilities of its thrusters, and every parameter with its source, in one HTML file."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from typing import Any

import numpy as np
from markupsafe import Markup

from wakewise.core.arrays import Array
from wakewise.robot.vehicles.check import WRENCH_AXES, AnyVehicle
from wakewise.robot.vehicles.describe import as_draft, describe, parameters
from wakewise.robot.vehicles.draft import VehicleDraft
from wakewise.ui.reports.page import html, template, whole_page
from wakewise.ui.reports.text import NONE, capitalised, shown
from wakewise.ui.reports.vehicle.drawing import drawing_svg

Cell = str | dict[str, Any]
"""Text, or text with the CSS class `kind`, a colour's `share`, a `rowspan` or a `badge`."""


def vehicle_page(vehicle: AnyVehicle) -> str:
    """HTML page of a vehicle, complete or a draft; it opens without a network."""
    draft = as_draft(vehicle)
    facts = describe(draft)
    drawing = Markup(drawing_svg(draft, titled=False)) if draft.thrusters else ""
    wrench_hint = "Largest along each axis with the other five held at zero, within the thrust limits."
    null_hint = "Thrusts that oppose each other and make no wrench; T1, T2 … are thrusters."
    failure_hint = "Percent left of the achievable wrench along each axis (the weaker of its two directions)."
    failure_key = ("loss", "0 %: the axis is lost", "100 %: nothing is lost")
    place_hint = "Places from the body origin; the force axis is the push on the vehicle."
    matrix_hint = "Wrench about the body origin per newton of thrust: N/N, and N m/N below."
    matrix_key = ("sign", "pushes against the axis", "along it")
    pair = (_card("Achievable wrench", wrench_hint, _wrench(facts)), _card("Null space", null_hint, _null_space(facts)))
    cards = [
        _header(draft, facts),
        _card("Drawing", "All views to one scale.", drawing) if drawing else "",
        _macros().pair(pair),
        _card("If one thruster fails", failure_hint, _failures(facts), failure_key),
        _mixing(facts),
        _card("Thrusters", place_hint, _thrusters(facts)),
        _card("Allocation matrix", matrix_hint, _matrix(draft.allocation_matrix), matrix_key),
        _card("Parameters", "Every number with its unit and source.", _parameters(draft)),
        *_full_matrices(draft),
    ]
    return whole_page(draft.title, Markup('<main class="vehicle">{}</main>').format(html(cards)), interactive=False)


def _macros() -> Any:
    return template("vehicle.html")


def _card(title: str, hint: str, content: str, key: tuple[str, str, str] | None = None) -> str:
    """A card; `key` is the colour scale of the cells: CSS class, left and right end."""
    made: str = _macros().card(title, hint, content, key)
    return made


def _table(heads: Sequence[str], rows: Sequence[Sequence[Cell]]) -> str:
    made: str = _macros().table(heads, rows)
    return made


def _header(draft: VehicleDraft, facts: dict[str, Any]) -> str:
    rank = facts["rank"]
    short = "warn" if rank is not None and rank < 6 else ""
    chips = (
        (f"{len(draft.thruster_names)} thrusters", ""),
        (f"rank {shown(rank)} of 6", short),
        (facts["actuation"].split(":")[0], short),
        ("incomplete, cannot fly", "warn") if draft.missing else ("can fly", "good"),
    )
    notes = [_sentence(note) for note in draft.notes]
    actuation = _sentence(facts["actuation"])
    texts = (draft.source, draft.does_not_claim, draft.missing, notes)
    made: str = _macros().header(draft.title, actuation, chips, *texts)
    return made


def _wrench(facts: dict[str, Any]) -> str:
    wrench = facts["achievable_wrench"]
    if wrench is None:
        return str(_macros().paragraph(f"Not known: {facts['why'].get('achievable_wrench', 'no reason was given')}."))
    sides = {axis: (-(w["lowest"] or 0.0), w["highest"] or 0.0) for axis, w in wrench.items()}
    largest = {
        unit: max((max(sides[axis]) for axis, w in wrench.items() if w["unit"] == unit), default=0.0) or 1.0
        for unit in ("N", "N m")
    }
    rows = [
        {
            "axis": axis,
            "unit": w["unit"],
            "lowest": _number(w["lowest"]),
            "highest": _number(w["highest"], "+.4g"),
            "left": f"{100.0 * sides[axis][0] / largest[w['unit']]:.1f}",
            "right": f"{100.0 * sides[axis][1] / largest[w['unit']]:.1f}",
        }
        for axis, w in wrench.items()
    ]
    made: str = _macros().wrench(rows)
    return made


def _null_space(facts: dict[str, Any]) -> str:
    if not facts["null_space"]:
        return str(_macros().paragraph("None: no thrusts cancel each other."))
    vectors = [
        {
            "name": vector["name"],
            "text": _sentence(vector["words"]),
            "thrusts": [_share(number, thrust) for number, thrust in enumerate(vector["thrusts"], start=1)],
        }
        for vector in facts["null_space"]
    ]
    made: str = _macros().null_space(vectors)
    return made


def _share(number: int, thrust: float | None) -> tuple[str, str]:
    """CSS class and text of one thruster's share of a null-space vector."""
    if thrust is None:
        return "", f"T{number} {NONE}"
    kind = "plus" if thrust > 1e-6 else "minus" if thrust < -1e-6 else ""
    return kind, f"T{number} {f'{thrust:+.2f}' if kind else '0'}"


def _number(value: float | None, form: str = ".4g") -> str:
    return NONE if value is None else f"{value + 0.0:{form}}"


def _failures(facts: dict[str, Any]) -> str:
    rows: list[list[Cell]] = []
    for failure in facts["failures"]:
        left = failure["left_pct"]
        cells: list[Cell] = []
        for axis in WRENCH_AXES:
            values = [] if left is None else [v for v in left[axis] if v is not None]
            if not values:
                cells.append({"kind": "cell muted", "text": NONE})
                continue
            worst = min(values)
            lost_share = 1.0 - min(max(worst, 0.0), 100.0) / 100.0
            cells.append({"kind": "cell lost", "share": f"{lost_share:.2f}", "text": f"{worst:.0f}"})
        lost = ", ".join(failure["lost"]) or "none"
        rows.append([shown(failure["thruster"]), failure["name"], shown(failure["rank"]), lost, *cells])
    heads = ["", "thruster", "rank left", "axes lost", *WRENCH_AXES]
    return _table(heads, rows)


def _mixing(facts: dict[str, Any]) -> str:
    found = facts["mixing"]
    if found is None:
        return ""
    macros = _macros()
    lines = [macros.paragraph(f"{shown(found['agree'])} of {shown(found['compared'])} entries agree.")]
    if facts["mixing_disagreements"]:
        rows = [
            [
                d["row"],
                f"{shown(d['thruster'])} {d['name']}",
                _number(d["stated"], "+.4g"),
                _number(d["geometry"], "+.4g"),
                d["fault"],
            ]
            for d in facts["mixing_disagreements"]
        ]
        lines.append(_table(["row", "thruster", "file says", "geometry says", "fault"], rows))
    lines += [macros.paragraph(_sentence(note)) for note in found["notes"]]
    return _card("Against a stated matrix", found["stated_by"], html(lines))


def _thrusters(facts: dict[str, Any]) -> str:
    rows = [
        [
            shown(t["number"]),
            t["name"],
            *(_number(value, "+.3f") for value in t["position_m"]),
            " ".join(_number(value, "+.3f") for value in t["axis"]),
            *("missing" if t[key] is None else f"{t[key]:g}" for key in ("max_forward_N", "max_reverse_N")),
            "missing" if t["disk_area_m2"] is None else f"{1e4 * t['disk_area_m2']:.3g}",
            "missing" if t["time_constant_s"] is None else f"{t['time_constant_s']:g}",
        ]
        for t in facts["thrusters"]
    ]
    heads = ["", "name", "x m", "y m", "z m", "force axis", "forward N", "reverse N", "disk cm2", "lag s"]
    return _table(heads, rows) if rows else str(_macros().paragraph("The file holds a matrix only."))


def _matrix(matrix: Array) -> str:
    rows: list[list[Cell]] = []
    for i, axis in enumerate(WRENCH_AXES):
        largest = float(abs(matrix[3 * (i // 3) : 3 * (i // 3) + 3]).max()) or 1.0
        cells: list[Cell] = []
        for value in matrix[i] + 0.0:
            kind, share = "plus" if value > 0 else "minus", abs(float(value)) / largest
            text = f"{value:+.3f}" if abs(value) > 5e-4 else "0"
            cells.append({"kind": f"cell {kind}", "share": f"{share:.2f}", "text": text})
        rows.append([axis, *cells])
    return _table(["", *(f"T{j}" for j in range(1, matrix.shape[1] + 1))], rows)


def _parameters(draft: VehicleDraft) -> str:
    """A source of several rows is written once, beside all of them."""
    rows: list[list[Cell]] = []
    for source, group in groupby(parameters(draft), key=lambda p: p.source):
        alike = list(group)
        for number, p in enumerate(alike):
            badge = "missing" if p.value is None else "estimate" if p.estimate else ""
            row: list[Cell] = [
                {"kind": "nowrap", "text": p.quantity},
                {"kind": "value", "text": p.value or ""},
                {"kind": "nowrap", "text": p.unit},
                {"kind": "", "badge": badge, "badge_kind": "warn" if badge == "missing" else ""},
            ]
            if number == 0:
                row.append({"kind": "source", "rowspan": len(alike), "text": source})
            rows.append(row)
    return _table(["quantity", "value", "unit", "", "source"], rows)


def _full_matrices(draft: VehicleDraft) -> list[str]:
    """Cards of the matrices with couplings, whose diagonals alone are in the table of parameters."""
    cards = []
    for title, unit, matrix in (
        ("Added mass", "kg, kg m, kg m2", draft.added_mass),
        ("Linear damping", "N s/m, N s, N m s", draft.linear_damping),
    ):
        if matrix is None or np.array_equal(matrix, np.diag(np.diag(matrix))):
            continue
        rows = [[axis, *(f"{value + 0.0:.5g}" for value in matrix[i])] for i, axis in enumerate(WRENCH_AXES)]
        cards.append(_card(f"{title}, whole", unit, _table(["", *WRENCH_AXES], rows)))
    return cards


def _sentence(text: str) -> str:
    """A note as a sentence; the first word keeps its letters."""
    return f"{capitalised(text).rstrip('.')}."
