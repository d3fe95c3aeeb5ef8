"""A data sheet: what a data set is, how it was made, what for, and what it is not.

Its questions are those of T. Gebru et al., Datasheets for Datasets (Communications of the ACM 64(12), 2021, doi
10.1145/3458723), section by section; its text is in `sheet.md`. What can be counted is counted; what only its makers
can say is marked as theirs.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from importlib.resources import files
from typing import Any

from wakewise.experiments.trials.dataset.part import TrialPart
from wakewise.experiments.trials.dataset.statement import QUESTIONS, DatasetStatement

UNSAID = "*For its makers to say.*"


def description_of(parts: Sequence[TrialPart]) -> str:
    """A few sentences for search engines."""
    photographs = sum(part.facts["photographs"] for part in parts)
    minutes = sum(part.facts["duration_s"] for part in parts) / 60.0
    simulated = sum(part.facts["simulated"] for part in parts)
    where = "simulated" if simulated == len(parts) else "real" if not simulated else "real and simulated"
    return (
        f"{_count(len(parts), 'flight')} of over-actuated underwater vehicles round delicate targets ({where}): states "
        f"at every control step, {_count(photographs, 'photograph')} with camera poses, and, apart from what a "
        f"controller could know, true states, the water at the target and the target's surface. {minutes:.1f} minutes "
        "in all."
    )


def data_sheet(
    words: DatasetStatement, parts: Sequence[TrialPart], left_out: Mapping[str, str], sizes: Mapping[str, int]
) -> str:
    """Text of DATASHEET.md."""
    facts = [part.facts for part in parts]
    simulated = sum(fact["simulated"] for fact in facts)
    lacking = Counter(what for part in parts for what in part.lacks)
    lacks = [f"{what} of {count} of {len(parts)} trials" for what, count in sorted(lacking.items())]
    reasons = "".join(f"\n- {name}: {why}" for name, why in sorted(left_out.items()))
    return (
        (files(__package__) / "sheet.md")
        .read_text(encoding="utf-8")
        .format_map(
            {
                "name": words.name,
                "version": words.version,
                "published": words.published,
                "creators": ", ".join(words.creators),
                "licence": words.licence,
                "where": words.url if words.url != "./" else UNSAID,
                **{question: words.answers.get(question, UNSAID) for question in QUESTIONS},
                "rows": "\n".join(f"| {what} | {value} |" for what, value in _rows(parts, sizes)),
                "missing": "; ".join(lacks) + "." if lacks else "No trial lacks a part.",
                "left_out": f"No; {len(left_out)} were left out:\n{reasons}"
                if left_out
                else "Yes, all that were there.",
                "noise": _noise(simulated, len(facts)),
                "acquired": _acquired(simulated, len(facts)),
                "not_concluded": (
                    "Simulated water is not the sea: what holds here holds in the tank's model, whose limits its "
                    "makers list. "
                    if simulated
                    else ""
                ),
            }
        )
    )


def _rows(parts: Sequence[TrialPart], sizes: Mapping[str, int]) -> list[tuple[str, str]]:
    facts = [part.facts for part in parts]
    with_truth = sum(any(path.endswith("/target.ply") for path in part.sums) for part in parts)
    return [
        ("trials", str(len(parts))),
        ("control steps", f"{sum(fact['steps'] for fact in facts):,}"),
        ("time in flight", f"{sum(fact['duration_s'] for fact in facts) / 60.0:.1f} min"),
        ("photographs", f"{sum(fact['photographs'] for fact in facts):,}"),
        ("surfaces of targets (ground truth)", str(with_truth)),
        *((f"{key}s", _counted(facts, key)) for key in ("vehicle", "method", "pilot", "world", "target")),
        ("different seeds", str(len({fact["seed"] for fact in facts if fact["seed"] is not None}))),
        ("flown by Wakewise", _counted(facts, "wakewise")),
        ("files of trials", f"{len(sizes):,}, {sum(sizes.values()) / 1e6:.1f} MB"),
    ]


def _acquired(simulated: int, trials: int) -> str:
    if not simulated:
        return "By a real vehicle; there is no truth to compare with."
    return (
        f"{simulated} of {trials} trials were flown in Wakewise's simulated tank, their photographs rendered; "
        "`scenario.yaml` says with what, and flies them again."
    )


def _noise(simulated: int, trials: int) -> str:
    if not simulated:
        return "Those of the vehicle's own sensors."
    some = "" if simulated == trials else f" of the {simulated} simulated trials"
    return (
        f"Sensors{some} have the noise, biases, delays and dropouts that `scenario.yaml` states. Photographs of one "
        "orbit overlap on purpose."
    )


def _counted(facts: Sequence[Mapping[str, Any]], key: str) -> str:
    counts = Counter(str(fact[key]) if fact[key] is not None else "unknown" for fact in facts)
    return ", ".join(f"{name} ({count})" for name, count in counts.most_common())


def _count(number: int, what: str) -> str:
    return f"{number:,} {what}{'' if number == 1 else 's'}"
