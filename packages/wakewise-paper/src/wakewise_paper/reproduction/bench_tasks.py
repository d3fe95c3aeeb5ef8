"""Work of a campaign that is no flight of a table's own: the operator's flights, wake models against flows.

(The planner's is `wakewise_benchmarks.solver`.)
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from wakewise.core.files import write_json
from wakewise.core.interfaces import Progress
from wakewise_paper.operator_study import paper
from wakewise_paper.operator_study.flight import OperatorTrial, fly_trial
from wakewise_paper.wake_validation import DEFINITIONS, ValidationOptions, figures, validate

_TOLD = ("velocity_deviation_pct", "disturbance", "target_speed_mean_m_s", "energy_kJ", "position_rmse_mm")


def operator_one(settings: Mapping[str, Any], folder: Path, progress: Progress) -> dict[str, float | None]:  # noqa: ARG001
    """Figures of one flight by an operator: `world` (of the library, or `paper`), `pilot`, `method`, `seed`,
    `w_track`; in the paper's world `course` in place of `pilot`.
    """
    told = dict(settings)
    if told.pop("world") == "paper":
        found = paper.fly_trial(paper.PaperOperatorTrial(**told))
    else:
        found = fly_trial(OperatorTrial(world=settings["world"], **told))
    return {key: found.get(key) for key in (*_TOLD, "cpu_s")}


def wake_one(settings: Mapping[str, Any], folder: Path, progress: Progress) -> dict[str, float | None]:
    """R2 and bias of every wake model against every flow, as "MODEL/FLOW/FIGURE"; `quick` samples more coarsely.

    All of it is left in wake.json.
    """
    told = figures(validate(ValidationOptions(quick=bool(settings.get("quick", True)), progress=progress)))
    write_json(folder / "wake.json", told)
    return {
        f"{model}/{flow}/{key}": cell[key]
        for model, flows in told["models"].items()
        for flow, cell in flows.items()
        for key in DEFINITIONS
    }
