"""References for the wash of a trial, and limits of its water model.

References: the motion of the water itself, a flight with `dp` in the same water, and the threshold of the bed's grains.
Limits: each validation law of the tank, or one sentence for other worlds.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from wakewise.core.errors import InputError
from wakewise.operation import differences, read_scenario
from wakewise.operation.worlds.lattice_world import CELL_M
from wakewise.operation.worlds.makers import WORLDS
from wakewise.scene.missions import SETTLING
from wakewise.simulation.tank.validation_limits import ABSENT, limits_table
from wakewise.ui.reports.page import collapsible_section, missing, parts, prose, section, template
from wakewise.ui.reports.text import number
from wakewise.ui.reports.trial import Trial

EQUAL_WITHIN = 0.03
"""Two figures this near to one another, relative, are called the same."""
UNIT, NO_BREAK = re.compile(r"(?<=\d) (?=[m%µP])"), "\u00a0"
"""The space before a unit, at which no line may end."""
SELDOM = 0.05
"""Grains that move for less than this share of the time are said to, and not held against the flight."""
SMALL = 0.25
"""Wash below this share of the water's own speed is called small."""


@dataclass(frozen=True)
class ReferenceBar:
    """One bar of a yardstick: what it is, its value in the unit of its neighbours and as text; `own` is this
    trial's.
    """

    name: str
    value: float
    text: str
    own: bool = False


@dataclass(frozen=True)
class ReferenceComparison:
    """One question, its answer in a few words, the sentence behind it, and bars to one scale.

    `good` is None where the answer is neither good nor bad.
    """

    question: str
    verdict: str
    good: bool | None
    sentence: str
    bars: tuple[ReferenceBar, ...]


def reference_comparisons(trial: Trial) -> list[ReferenceComparison]:
    """Those that the trial's figures allow, in the order of the page."""
    return [found for found in (against_water(trial), against_dp(trial), against_grains(trial)) if found is not None]


def yardstick_html(trial: Trial) -> str:
    """The section of a page; empty if nothing can be held against anything."""
    cards = [_card(found) for found in reference_comparisons(trial)]
    if not cards:
        return ""
    lead = (
        "What the wash at the target is to be held against. Wash is the water's speed beyond that of the same flow "
        "without thrusters."
    )
    return section("yardstick", "Is that calm?", lead, template("trial.html").yardsticks(cards))


def against_water(trial: Trial) -> ReferenceComparison | None:
    """The wash against still water and against the water's own motion."""
    wash, own = trial.metrics.number("target_speed_mean_m_s"), trial.metrics.number("ambient_speed_m_s")
    if wash is None:
        return None
    said = f"{number(1e3 * wash)} mm/s"
    still = f"Without thrusters this would be 0: the {said} are what they add to the water's own motion."
    bars: tuple[ReferenceBar, ...] = (ReferenceBar("this flight's wash", 1e3 * wash, said, own=True),)
    if own is None:
        return ReferenceComparison("Against still water", f"{said} of wash", None, still, bars)
    if own < 1e-4:
        words = f"{still} This water has no motion of its own, so all that moved at the target is wash."
        return ReferenceComparison("Against still water", f"{said} where nothing else moves", None, words, bars)
    share = wash / own
    verdict = (
        "small beside the water's own motion" if share < SMALL
        else "slower than the water itself" if share < 1.0
        else "faster than the water itself"
    )  # fmt: skip
    words = f"{still} That motion passes the target at {number(1e3 * own)} mm/s, so the wash is {_share(share)} of it."
    bars += (ReferenceBar("the water's own speed", 1e3 * own, f"{number(1e3 * own)} mm/s"),)
    return ReferenceComparison("Against the water itself", verdict, share < 1.0, words, bars)


def against_dp(trial: Trial) -> ReferenceComparison | None:
    """The thrusts flown against the least thrusts for the same wrenches, and a flight of `dp` beside this one."""
    metrics = trial.metrics
    flown, least = metrics.number("disturbance_flown"), metrics.number("disturbance_least_thrusts")
    wash = metrics.number("target_speed_mean_m_s")
    title = "Against dp, the method that does not know the target"
    measured = None if trial.method == "dp" else _measured_dp_m_s(trial)
    if trial.method == "dp":
        words = "dp is the yardstick: it makes every force with the least thrusts, wherever their jets go."
        return ReferenceComparison("Against dp", "this flight is dp's", None, words, ())
    if measured and wash is not None:
        words = "Flown by dp in the same water from the same seed, one draw against one draw."
        if flown and least:
            times = number(least / flown)
            words += f" By the wake model's estimate, dp's sharing of these forces would disturb {times} times as much."
        bars = (
            ReferenceBar("this flight's wash", 1e3 * wash, f"{number(1e3 * wash)} mm/s", own=True),
            ReferenceBar("dp's wash, measured", 1e3 * measured, f"{number(1e3 * measured)} mm/s"),
        )
        ratio = wash / measured
        return ReferenceComparison(title, f"{_against(ratio)} wash", _good(ratio), words, bars)
    if not flown or not least:
        return None
    words = (
        "How much less wash there is than with dp is told by a flight of dp in the same water (wakewise "
        "compare): the speed of the water at the target, of the same seed. Until then there is only the wake "
        "model's estimate of what dp's sharing of the very same forces would have done. D is the weighted sum of "
        "squared jet speeds at the target."
    )
    bars = (
        ReferenceBar("D as flown, estimated", flown, f"{number(flown)} m²/s²", own=True),
        ReferenceBar("D of dp's sharing, estimated", least, f"{number(least)} m²/s²"),
    )
    return ReferenceComparison(title, "not measured: dp has not flown in this water", None, words, bars)


def _measured_dp_m_s(trial: Trial) -> float | None:
    """Wash of a flight of `dp` that lies beside this one and differs from it in nothing but the method."""
    beside = trial.folder.resolve().parent / "dp"
    if trial.settings is None or trial.outside:
        return None
    try:
        other = read_scenario(beside / "scenario.yaml")
        found = json.loads((beside / "metrics.json").read_text(encoding="utf-8")).get("target_speed_mean_m_s")
    except (InputError, OSError, ValueError, AttributeError):
        return None
    same = [line for line in differences(other, trial.settings) if not line.startswith("method ")]
    return float(found) if not same and other.method == "dp" and isinstance(found, int | float) else None


def against_grains(trial: Trial) -> ReferenceComparison | None:
    """The pull of the water on the bed against the pull from which its grains move."""
    metrics = trial.metrics
    pull, moves = metrics.number("bed_shear_p95_Pa"), metrics.number("grain_threshold_Pa")
    if pull is None or not moves:
        return None
    over = _share_over(trial, moves)
    grains = "The bed's grains"
    if trial.settings is not None:
        grains = f"The bed's grains, {number(1e6 * trial.settings.tank.silt.grain_m)} µm across,"
    words = (
        f"{grains} move from a pull of {number(moves)} Pa on; where the water pulls hardest near the target (one place "
        f"in twenty) it is {number(pull)} Pa on average, {_share(pull / moves)} of that."
    )
    if over is not None:
        never = "It never was more" if over == 0.0 else f"It was more for {_share(over)} of the time"
        words += f" {never}."
    lifted = pull >= moves or bool(over)
    verdict = "grains move" if pull >= moves else "grains move now and then" if lifted else "the bed stays put"
    bars = (
        ReferenceBar("pull on the bed", pull, f"{number(pull)} Pa", own=True),
        ReferenceBar("grains move from", moves, f"{number(moves)} Pa"),
    )
    seldom = pull < moves and over is not None and 0.0 < over <= SELDOM
    return ReferenceComparison("Against the bed's grains", verdict, None if seldom else not lifted, words, bars)


def _share_over(trial: Trial, limit: float) -> float | None:
    """Share of the flight's steps on which the record of the bed's stress lies above a limit."""
    stress = trial.column("bed_shear_p95_Pa")
    if stress is None or trial.steps is None:
        return None
    counts = np.isfinite(stress)
    if "leg" in trial.steps.columns:
        counts &= trial.steps["leg"].fill_null("").to_numpy() != SETTLING
    return float((stress[counts] > limit).mean()) if counts.any() else None


def _against(ratio: float) -> str:
    if abs(ratio - 1.0) <= EQUAL_WITHIN:
        return "the same"
    return f"{number(100.0 * abs(ratio - 1.0), 2)} % {'less' if ratio < 1.0 else 'more'}"


def _good(ratio: float) -> bool | None:
    return None if abs(ratio - 1.0) <= EQUAL_WITHIN else ratio < 1.0


def _share(share: float) -> str:
    if share > 2.0:
        return f"{number(share)} times"
    return f"{number(100.0 * share, 2)} %"


def _card(found: ReferenceComparison) -> dict[str, Any]:
    """Values of the template; lengths of bars are relative to the longest."""
    top = max((bar.value for bar in found.bars), default=0.0) or 1.0
    return {
        "question": found.question,
        "verdict": found.verdict,
        "state": {True: "good", False: "bad", None: ""}[found.good],
        "bars": [(bar.name, bar.text, bar.own, f"{max(bar.value / top, 0.005):.3f}") for bar in found.bars],
        "sentence": UNIT.sub(NO_BREAK, found.sentence),
    }


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
    """Section "limits": what the water model of these trials gets wrong, by trial where their waters differ."""
    waters: dict[str, list[str]] = {}
    for name, trial in trials.items():
        waters.setdefault(_water_html(trial), []).append(name)
    sections = [
        (str(parts().row_title(", ".join(names))) if len(waters) > 1 else "") + html for html, names in waters.items()
    ]
    title = f"What {'the tank' if _tank_html() in waters else 'this water'} gets wrong"
    lead = "A simulated flight is flown in a model of water. What that gets wrong limits what its figures can claim."
    return section("limits", title, lead, "".join(sections))


def _water_html(trial: Trial) -> str:
    """What is wrong with the water of one trial."""
    replaced = trial.scenario.get("overrides")
    if isinstance(replaced, Mapping) and "world" in replaced:
        return _from_outside(str(replaced["world"]))
    if trial.settings is None:
        return missing("what its water gets wrong", "no scenario that can be read says in which water it was flown")
    flow = trial.settings.flow_name
    if flow == "tank":
        return _tank_html()
    return _paragraph(prose(_OTHERS[flow])) if flow in WORLDS else _from_outside(flow)


def _from_outside(name: str) -> str:
    return _paragraph(f"The world came from outside ({name}): what it gets wrong, its maker has to say.")


def _paragraph(text: str) -> str:
    return str(template("trial.html").paragraph(text))


def _tank_html() -> str:
    """Validation laws of the tank, missed ones first, and effects that it lacks."""
    rows = limits_table()
    missed = sum(row["met"] == "no" for row in rows)
    macros = template("trial.html")
    cells = [
        (
            macros.law(row["met"] == "yes"),
            macros.law_source(row),
            row["asked"],
            row["reached"],
            prose(row["means"]),
        )
        for row in rows
    ]
    heads = ("", "law, source", "asked", "reached", "what it means for a claim")
    table = parts().table("ttnnm", heads, cells, "limits", wide=False)
    absent = parts().items([prose(line) for line in ABSENT])
    return collapsible_section(
        "Laws it is held against", table, f"{missed} of {len(rows)} missed, these first"
    ) + collapsible_section("What it has not at all", absent, f"{len(ABSENT)} things")
