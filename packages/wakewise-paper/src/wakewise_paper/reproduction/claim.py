"""What one figure of the paper's tables is, as data: its value where it is known here, its side, how we measure it.

The paper: Y. Gao, T. Xu, Q. Liu and Y. Cai, Disturbance-Aware Motion Planning for Over-Actuated Underwater Vehicles
Exploiting Actuation Redundancy for High-Fidelity 3D Reconstruction (2026). Its figures stand here by section or table;
a number that it does not give, or that is not quoted, is None and said so, never guessed. `than` names the method
against which a claim is a difference.

What each of the paper's tables is judged by, and how many of its figures are met.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from wakewise.experiments.campaigns.summary import ComparisonMetric, MethodSummary, Place, summarize

Reading = Literal["mean", "less_pct", "share_pct", "order", "spread_pct"]
"""What is made of the trials: their mean; how much less than another method's, in percent; the share that succeeded;
the order of the methods; how much repeats of one thing differ (coefficient of variation)."""
Side = Literal["less", "more", "none"]

UNQUOTED = "not quoted here"
TABLES: dict[str, str] = {
    "dynamic": "models while flying round, by hand, by plans that do not know their wash, and by ours",
    "success": "models that succeed, over varied starts, angles and command patterns",
    "station": "180 s of station keeping 0.20 m above the target in a stream of 0.3 m/s",
    "ablation": "what each part of the method is worth: left out one by one",
    "sediment": "calcium carbonate in the water",
    "flow": "speed of the water at the target, as particle image velocimetry sees it",
    "solver": "time, convergence, violations and restarts of the planner",
    "wake": "the wake model against flows that it was not made from",
    "field": "a dive with 3 m of sight, swell and a current to 0.5 m/s",
    "operator": "a pilot obeyed, by the weight of obedience w_track",
    "comparison": "methods and approaches side by side, each cell with the command that shows it",
}
"""Tables in the order of `all`, and what each is about."""

OURS = "wake-aware"
ORDER = ("manual", "mpc", "mpc-smooth", "wake-aware")
"""The paper's order by RMSE, the worst first."""


@dataclass(frozen=True, kw_only=True)
class PublishedFigure:
    """One figure of a table.

    Parameters
    ----------
    method, figure : str
        Whose it is, and the key of a trial's figures.
    title, unit : str
    paper : float or None
        The paper's value in that unit; None where it is not known here.
    said : str
        The claim in words.
    side : Side
        Which side of the paper's value, or of `asked`, is as good: at most ("less"), at least ("more"); "none" where
        the figure only says how it was.
    asked : float or None
        What is asked where the paper's number is not known but its direction is.
    than : str or None
        Of "less_pct": the method that it is held against.
    reading : Reading
    scale : float
        From the trial's unit to this one.
    how : str
        How it is measured here.
    itt : bool
        Trials that failed count as the worst; else they are left out, as in the paper.
    """

    method: str
    figure: str
    title: str
    unit: str
    paper: float | None
    said: str
    side: Side
    how: str
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


RMSE = "distance of the model's points from the truth, rms, each capped at 20 mm, after rigid alignment"
COMPLETE = "share of the whole surface with a point of the model within 3 mm"
WASH = (
    "speed of the water at the target's surface in excess of the same water without the vehicle, mean over the flight"
)
SUCCESS = "rmse below 3 mm and completeness above 85 %"
"""What counts as a success."""


def model_claims(paper_rmse: dict[str, float | None], paper_complete: dict[str, float | None]) -> list[PublishedFigure]:
    """RMSE, failed trials left out and counted as 20 mm, and completeness of each method.

    Only ours is held against the paper's: a rival that is better here than there meets no claim.
    """
    claims: list[PublishedFigure] = []
    for method, value in paper_rmse.items():
        said = UNQUOTED if value is None else f"RMSE {value:g} mm"
        judged = value is not None and method == OURS
        for itt in (False, True):
            words = "RMSE, failed trials 20 mm" if itt else "RMSE of models that were made"
            claims.append(
                PublishedFigure(
                    method=method,
                    figure="rmse_mm",
                    title=words,
                    unit="mm",
                    paper=None if itt else value,
                    asked=value if itt and judged else None,
                    said=f"{said}; the paper leaves failures out" if itt else said,
                    side="less" if judged else "none",
                    how=RMSE,
                    itt=itt,
                )
            )
        share = paper_complete.get(method)
        claims.append(
            PublishedFigure(
                method=method,
                figure="completeness_pct",
                title="completeness",
                unit="%",
                paper=share,
                said=UNQUOTED if share is None else f"{share:g} % of the surface",
                side="more" if share is not None and method == OURS else "none",
                how=COMPLETE,
            )
        )
    return claims


def less(
    figure: str,
    title: str,
    than: str,
    paper: float | None,
    said: str,
    how: str,
    *,
    asked: float | None = None,
    method: str = "wake-aware",
) -> PublishedFigure:
    """How much less a figure is than another method's, in percent."""
    return PublishedFigure(
        method=method,
        figure=figure,
        title=f"{title}, less than {than}",
        unit="%",
        paper=paper,
        said=said,
        side="none" if paper is None and asked is None else "more",
        asked=asked,
        than=than,
        reading="less_pct",
        how=f"{how}; ratio of the means over pairs of one seed",
    )


def washes(methods: tuple[str, ...]) -> list[PublishedFigure]:
    """The wash itself, whose size says whether there is anything to take away."""
    return [
        PublishedFigure(
            method=method,
            figure="target_speed_mean_m_s",
            title="wash at the target",
            unit="mm/s",
            paper=None,
            said="180 and 60 mm/s by its PIV, see flow",
            side="none",
            scale=1e3,
            how=WASH,
        )
        for method in methods
    ]


JUDGED = {
    "dynamic": ComparisonMetric("rmse_mm", "mm RMSE", 1.0, True),
    "success": ComparisonMetric("success", "% of models", 100.0, False),
    "station": ComparisonMetric("target_speed_mean_m_s", "mm/s at the target", 1e3, True),
    "ablation": ComparisonMetric("target_speed_mean_m_s", "mm/s at the target", 1e3, True),
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
