"""What the paper says (`published.yaml`), what each of its tables is judged by, and how many figures are met where.

A number that the paper does not give, or that is not quoted, is None and said so, never guessed.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from typing import Any, Literal

from wakewise.core.safe_yaml import read_yaml
from wakewise.experiments.campaigns.summary import MethodSummary, Place, summarize
from wakewise.experiments.campaigns.table import ComparisonMetric

Reading = Literal["mean", "less_pct", "more_pct", "share_pct", "made_pct", "order", "spread_pct"]
"""What is made of the trials: their mean; how much less than another method's, or more than in another world, in
percent; the share that succeeded, or that gave the figure; the order of the methods; how much repeats of one thing
differ (coefficient of variation)."""
DIFFERENCES: tuple[Reading, ...] = ("less_pct", "more_pct", "order")
"""Readings that compare pairs: their number decides what can be said."""
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
    of a "less_pct", `against` the world of a "more_pct". `scale` is from the trial's unit to this one; `how` is how it
    is measured here. `itt`: trials that failed count as the worst; else they are left out, as in the paper. `sd` is
    the paper's standard deviation, `baseline` the method that the paper compares with. `worlds` are those in which the
    claim can be judged; all where there is none.
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
    against: str | None = None
    scale: float = 1.0
    itt: bool = False
    sd: float | None = None
    baseline: str | None = None
    worlds: tuple[str, ...] = ()

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
    baselines: Mapping[str, str] = tree["baselines"]
    return {
        table: tuple(
            _claim(one, hows, tree["unquoted"], baselines.get(table)) for entry in entries for one in _expanded(entry)
        )
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


def _claim(entry: Mapping[str, Any], hows: Mapping[str, str], unquoted: str, baseline: str | None) -> PublishedFigure:
    told: dict[str, Any] = {"method": "wake-aware", "unit": "", "side": "none", "said": unquoted, "paper": None}
    told |= {key: value for key, value in entry.items() if value is not None}
    told["how"] = hows.get(told["how"], told["how"])
    if (ratio := told.pop("ratio", None)) is not None:
        told["paper"] = 100.0 * (1.0 - ratio[0] / ratio[1])
    if (than := told.get("than")) is not None:
        told |= {"title": f"{told['title']}, less than {than}", "unit": "%", "reading": "less_pct"}
        told["how"] = f"{told['how']}; ratio of the geometric means over pairs of one seed"
        told["side"] = "none" if told.get("paper") is None and told.get("asked") is None else "more"
    quoted_than = than if told["paper"] is not None else None
    told = {"baseline": quoted_than or baseline} | told | {"worlds": tuple(told.get("worlds", ()))}
    return PublishedFigure(**told)


_PUBLISHED = read_yaml((resources.files("wakewise_paper.reproduction") / "published.yaml").read_text("utf-8"))
CLAIMS = read_claims(_PUBLISHED)
"""By table; `comparison` has none, since the paper's cells are words, which are not quoted here."""
UNQUOTED: str = _PUBLISHED["unquoted"]
UNMEASURED: tuple[str, ...] = tuple(
    "{what}: {said} ({where}). Not measured here: {why}".format(**one) for one in _PUBLISHED["unmeasured"]
)
"""Results that the paper states and that no table of ours measures, and why."""
UNKNOWN: tuple[str, ...] = tuple(_PUBLISHED["unknown"])
"""What of the paper is not known here, or does not agree with another place in it."""

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
"""Worlds whose water is the planner's own model: what is met there is told apart."""
SETUP = "pump-tank"
"""The world that is the paper's own set-up: its tank, with the water that pumps move."""
OWN_SETUP = "the paper's own"
"""What a row of that world has as its `setup`."""
NO_FLIGHT = "no flight"
"""The `setup` of what is computed without one."""


def setup_of(world: str, flow: str | None) -> str:
    """The set-up of a row: the paper's own, the name of a world or of a flow that wake models are held against."""
    if world == "-":
        return NO_FLIGHT if flow is None else f"flow {flow}"
    return OWN_SETUP if world == SETUP else world


@dataclass(frozen=True, kw_only=True)
class SetupTally:
    """How many of the paper's figures are met in one set-up.

    `judged`: figures with a value of the paper and one of ours. Of those that are `met`, `surely` have the whole
    interval on that side, `by_all` are met by every method here and so say nothing of one, and `preliminary` are
    differences of fewer than `ENOUGH` pairs.
    """

    setup: str
    judged: int
    met: int
    surely: int
    by_all: int
    preliminary: int


def tallies(tables: Mapping[str, Sequence[Mapping[str, Any]]]) -> list[SetupTally]:
    """One for each set-up in which a figure is judged: the paper's own first, circular worlds last."""
    found: dict[str, list[Mapping[str, Any]]] = {}
    for row in (row for rows in tables.values() for row in rows):
        if row["paper"] is not None and row["met"] is not None:
            found.setdefault(row["setup"], []).append(row)
    return [_tally(setup, found[setup]) for setup in setups(found)]


def setups(names: Iterable[str]) -> list[str]:
    """Set-ups in the order of reports: the paper's own first, then worlds by name as they come, circular ones last."""
    return sorted(dict.fromkeys(names), key=lambda name: (name != OWN_SETUP, name in CIRCULAR))


def _tally(setup: str, rows: Sequence[Mapping[str, Any]]) -> SetupTally:
    met = [row for row in rows if row["met"]]
    return SetupTally(
        setup=setup,
        judged=len(rows),
        met=len(met),
        surely=sum(bool(row["sure"]) for row in met),
        by_all=sum(bool(row["met_by_all"]) for row in met),
        preliminary=sum(bool(row["preliminary"]) for row in met),
    )
