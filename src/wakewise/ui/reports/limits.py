"""What the water of a trial gets wrong, told on the page of every flight in it: law by law for the tank's water, in a
sentence for the others.
"""

from __future__ import annotations

from collections.abc import Mapping
from html import escape

from wakewise.operation.worlds.lattice_world import CELL_M
from wakewise.operation.worlds.makers import WORLDS, flow_name
from wakewise.simulation.tank.validation_limits import ABSENT, limits_table
from wakewise.ui.reports.page import collapsible_section, missing, prose, section
from wakewise.ui.reports.trial import Trial

_OTHERS = {
    "paper": "This water is the paper's wake model and no water: a method that plans with that model is judged by its "
    "own belief, so what it gains here is circular and says nothing of a tank or a sea.",
    "lattice": f"This water is a large-eddy simulation in cells of {100 * CELL_M:g} cm, which are coarse for sheets on "
    "the bed and for the thin layer at the target's surface; the hull lets jets through, and there is no silt, no wave "
    "and no turbulence of the water's own.",
    "lattice-jets": "This water is the mean field of one jet, as the lattice computed it, laid at each thruster: it "
    "answers thrust at once, so no jet travels, drifts, lingers or strikes the bed.",
}


def limits_section(trials: Mapping[str, Trial]) -> str:
    """The part of a page, anchor "limits", that says what the water of these trials gets wrong.

    Parameters
    ----------
    trials : mapping
        Name of each trial, said where the trials of a page were not all flown in the same water.
    """
    waters: dict[str, list[str]] = {}
    for name, trial in trials.items():
        waters.setdefault(_water_html(trial), []).append(name)
    parts = [
        (f'<p class="sheet-leg">{escape(", ".join(names))}</p>' if len(waters) > 1 else "") + html
        for html, names in waters.items()
    ]
    title = f"What {'the tank' if _tank_html() in waters else 'this water'} gets wrong"
    lead = "A simulated flight is flown in a model of water. What that gets wrong limits what its figures can claim."
    return section("limits", title, lead, "".join(parts))


def _water_html(trial: Trial) -> str:
    """What is wrong with the water of one trial."""
    replaced = trial.scenario.get("replaced")
    if isinstance(replaced, Mapping) and "world" in replaced:
        return _from_outside(str(replaced["world"]))
    if trial.settings is None:
        return missing("what its water gets wrong", "no scenario that can be read says in which water it was flown")
    flow = flow_name(trial.settings)
    if flow == "tank":
        return _tank_html()
    return f"<p>{prose(_OTHERS[flow])}</p>" if flow in WORLDS else _from_outside(flow)


def _from_outside(said: str) -> str:
    return f"<p>The world came from outside ({escape(said)}): what it gets wrong, its maker has to say.</p>"


def _tank_html() -> str:
    """The tank's laws, missed ones first, and what it has not."""
    rows = limits_table()
    missed = sum(row["met"] == "no" for row in rows)
    table = (
        '<table class="limits"><thead><tr><th></th><th>law, source</th><th class="num">asked</th>'
        '<th class="num">reached</th><th>what it means for a claim</th></tr></thead>'
        f"<tbody>{''.join(map(_row, rows))}</tbody></table>"
    )
    absent = "".join(f"<li>{prose(line)}</li>" for line in ABSENT)
    return collapsible_section(
        "Laws it is held against", table, f"{missed} of {len(rows)} missed, these first"
    ) + collapsible_section("What it has not at all", f"<ul>{absent}</ul>", f"{len(ABSENT)} things")


def _row(row: Mapping[str, str]) -> str:
    said = '<span class="kept">kept</span>' if row["met"] == "yes" else '<strong class="missed">missed</strong>'
    return (
        f"<tr><td>{said}</td><td><b>{escape(row['name'])}</b><br>{prose(row['law'])} "
        f'<span class="null">({escape(row["source"])})</span></td><td class="num">{escape(row["asked"])}</td>'
        f'<td class="num">{escape(row["reached"])}</td><td class="text">{prose(row["means"])}</td></tr>'
    )
