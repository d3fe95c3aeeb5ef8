"""What the paper says (`published.yaml`), what each of its tables is judged by, and how many of its figures are met.

A number that the paper does not give, or that is not quoted, is None and said so, never guessed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from typing import Any, Literal

from wakewise.core.safe_yaml import read_yaml
from wakewise.experiments.campaigns.summary import MethodSummary, Place, summarize
from wakewise.experiments.campaigns.table import ComparisonMetric

Reading = Literal["mean", "less_pct", "share_pct", "order", "spread_pct"]
"""What is made of the trials: their mean; how much less than another method's, in percent; the share that succeeded;
the order of the methods; how much repeats of one thing differ (coefficient of variation)."""
Side = Literal["less", "more", "none"]

TABLES: dict[str, str] = {
    "dynamic": "models while flying round, by hand, by plans that do not know their wash, and by ours",
    "success": "models that succeed, over varied starts, angles and command patterns",
    "station": "180 s of station keeping 0.20 m above the target in a stream of 0.3 m/s",
    "ablation": "models with each part of the method left out, one by one",
    "sediment": "calcium carbonate in the water",
    "flow": "speed of the water at the target, as particle image velocimetry sees it",
    "solver": "time, convergence, violations and restarts of the planner",
    "wake": "the wake model against flows that it was not made from",
    "field": "a dive with 3 m of sight, swell and a current to 0.5 m/s",
    "operator": "a pilot obeyed, by the weight of obedience w_track",
    "comparison": "methods and approaches side by side, each cell with the command that shows it",
}
"""Tables in the order of `all`, and what each is about."""

ORDER = ("manual", "mpc", "mpc-smooth", "wake-aware")
"""The paper's order by RMSE, the worst first."""


@dataclass(frozen=True, kw_only=True)
class PublishedFigure:
    """One figure of a table of the paper.

    `method` and `figure` (a key of a trial's figures) say whose it is. `paper` is the value in `unit`, None where
    it is not known here; `where` is its section or table; `said` is the claim in words. `side` is which side of the
    paper's value, or of `asked`, is as good: at most ("less"), at least ("more"); "none" where the figure only says how
    it was. `asked` is what is asked where the paper's number is not known but its direction is; `than` names the method
    of a "less_pct". `scale` is from the trial's unit to this one; `how` is how it is measured here. `itt`: trials that
    failed count as the worst; else they are left out, as in the paper.
    """

    method: str
    figure: str
    title: str
    unit: str
    paper: float | None
    said: str
    side: Side
    how: str
    where: str = ""
    asked: float | None = None
    than: str | None = None
    reading: Reading = "mean"
    scale: float = 1.0
    itt: bool = False

    @property
    def bar(self) -> float | None:
        """The value to meet; None where there is none."""
        return self.paper if self.paper is not None else self.asked

    def met(self, value: float | None) -> bool | None:
        """Whether a value is as good; None where that cannot be said."""
        if value is None or self.bar is None or self.side == "none":
            return None
        return value <= self.bar if self.side == "less" else value >= self.bar


def read_claims(tree: Mapping[str, Any]) -> dict[str, tuple[PublishedFigure, ...]]:
    """Claims by table, from the values of `published.yaml`, which says how they are written."""
    hows: Mapping[str, str] = tree["hows"]
    return {
        table: tuple(_claim(one, hows, tree["unquoted"]) for entry in entries for one in _expanded(entry))
        for table, entries in tree["tables"].items()
    }


def _expanded(entry: Mapping[str, Any]) -> list[dict[str, Any]]:
    """An entry, or the claims that it repeats for each value of a field."""
    if "each" not in entry:
        return [dict(entry)]
    ((field, values),) = entry["each"].items()
    return [
        {key: told.get(value) if isinstance(told, dict) else told for key, told in claim.items()} | {field: value}
        for value in values
        for claim in entry["claims"]
    ]


def _claim(entry: Mapping[str, Any], hows: Mapping[str, str], unquoted: str) -> PublishedFigure:
    told: dict[str, Any] = {"method": "wake-aware", "unit": "", "side": "none", "said": unquoted, "paper": None}
    told |= {key: value for key, value in entry.items() if value is not None}
    told["how"] = hows.get(told["how"], told["how"])
    if (ratio := told.pop("ratio", None)) is not None:
        told["paper"] = 100.0 * (1.0 - ratio[0] / ratio[1])
    if (than := told.get("than")) is not None:
        told |= {"title": f"{told['title']}, less than {than}", "unit": "%", "reading": "less_pct"}
        told["how"] = f"{told['how']}; ratio of the means over pairs of one seed"
        told["side"] = "none" if told.get("paper") is None and told.get("asked") is None else "more"
    return PublishedFigure(**told)


_PUBLISHED = read_yaml((resources.files("wakewise_paper.reproduction") / "published.yaml").read_text("utf-8"))
CLAIMS = read_claims(_PUBLISHED)
"""By table; `comparison` has none, since the paper's cells are words, which are not quoted here."""
UNQUOTED: str = _PUBLISHED["unquoted"]
UNKNOWN: tuple[str, ...] = tuple(_PUBLISHED["unknown"])
"""What of the paper is not known here, or measures something else than our tables do."""

JUDGED = {
    "dynamic": ComparisonMetric("rmse_mm", "mm RMSE", 1.0, True),
    "success": ComparisonMetric("success", "% of models", 100.0, False),
    "station": ComparisonMetric("target_speed_mean_m_s", "mm/s at the target", 1e3, True),
    "ablation": ComparisonMetric("rmse_mm", "mm RMSE", 1.0, True),
    "sediment": ComparisonMetric("rmse_mm", "mm RMSE", 1.0, True),
    "flow": ComparisonMetric("piv_speed_m_s", "mm/s by PIV", 1e3, True),
    "field": ComparisonMetric("rmse_mm", "mm RMSE", 1.0, True),
    "operator": ComparisonMetric("target_speed_mean_m_s", "mm/s at the target", 1e3, True),
    "comparison": ComparisonMetric("target_speed_mean_m_s", "mm/s at the target", 1e3, True),
}
"""By table what it is judged by."""


def glances(table: str, places: Sequence[Place]) -> list[MethodSummary]:
    """One for each world of a table, over the trials that all of its methods have; none of tables without methods."""
    if table not in JUDGED:
        return []
    found = (summarize(JUDGED[table], world, places) for world in dict.fromkeys(place["world"] for place in places))
    return [one for one in found if one is not None]


CIRCULAR = ("paper",)
"""Worlds whose water is the planner's own model: what is met there alone is told apart."""
SETUP = "pump-tank"
"""The world that is the paper's own set-up: its tank, with the water that pumps move."""


def count_met(tables: Mapping[str, Sequence[Mapping[str, Any]]]) -> dict[str, int]:
    """How many of the figures that the paper quotes are met, each counted once, however many worlds or flows it has.

    `quoted`: figures with a value of the paper and one of ours; `met`: in some world that is not circular; `surely`:
    there with the whole interval on that side; `circular`: in a circular world alone; `own`, `own_judged`: in the
    paper's own set-up, and those that have a value there; `worlds`: those that are judged in a world at all.
    """
    found: dict[tuple[str, str, str], list[Mapping[str, Any]]] = {}
    for name, rows in tables.items():
        for row in rows:
            if row["paper"] is not None and row["met"] is not None:
                found.setdefault((name, row["method"], row["figure"]), []).append(row)
    fair = {key: [row for row in rows if row["met"] and row["world"] not in CIRCULAR] for key, rows in found.items()}
    return {
        "quoted": len(found),
        "met": sum(bool(rows) for rows in fair.values()),
        "surely": sum(any(row["sure"] for row in rows) for rows in fair.values()),
        "own": sum(any(row["met"] and row["world"] == SETUP for row in rows) for rows in found.values()),
        "own_judged": sum(any(row["world"] == SETUP for row in rows) for rows in found.values()),
        "worlds": sum(any(row["world"] != "-" for row in rows) for rows in found.values()),
        "circular": sum(not fair[key] and any(row["met"] for row in rows) for key, rows in found.items()),
    }
