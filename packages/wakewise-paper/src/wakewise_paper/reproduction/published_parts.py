"""What the paper says of its parts: tables `solver` and `wake`."""

from __future__ import annotations

from wakewise_paper.reproduction.claim import UNQUOTED, PublishedFigure, Side


def solver() -> list[PublishedFigure]:
    """The planner."""

    def claim(
        method: str, figure: str, title: str, unit: str, paper: float | None, said: str, side: Side, how: str
    ) -> PublishedFigure:
        return PublishedFigure(
            method=method,
            figure=figure,
            title=title,
            unit=unit,
            paper=paper,
            asked=0.0 if paper is None else None,
            said=said,
            side=side,
            how=how,
        )

    claims = []
    for method in ("wake-aware", "the paper's recipe"):
        where = "thread CPU of one plan, 2 s in 20 steps, 300 points, both scenarios of the planner bench"
        claims += [
            claim(method, "ms_mean", "time of a plan", "ms", 45.0, "45 ms, sd 12, on an i7-10700K", "less", where),
            claim(method, "late_pct", "plans over 50 ms", "%", 0.8, "0.8 %", "less", where),
            claim(method, "converged_pct", "plans that converged", "%", 99.2, "99.2 %", "more", "its own test"),
            claim(
                method,
                "thrusts_beyond",
                "commands beyond a limit",
                "",
                None,
                "limits are hard",
                "less",
                "commands of all stages outside a thruster's range by more than 1e-6 N",
            ),
            claim(
                method,
                "clearance_broken",
                "planned places too near",
                "",
                None,
                "clearance by a barrier",
                "less",
                "stages whose hull would touch the target or the floor",
            ),
        ]
    spread = "(q95 - q5) / (2 median) of D over 20 random starts, plans that converged"
    claims.append(
        claim("wake-aware", "restart_spread_pct", "D over random restarts", "%", 5.0, "within 5 %", "less", spread)
    )
    claims.append(
        claim("wake-aware", "disturbance_ms", "D once, 300 points", "ms", 1.0, "< 1 ms", "less", "thread CPU, median")
    )
    return claims


WAKE_MODELS = ("paper", "paper-calibrated", "fitted", "jet-fitted")


def wake() -> list[PublishedFigure]:
    """Wake models against flows."""
    claims = []
    for method in WAKE_MODELS:
        for figure, title, value, where in (
            ("r2_core", "R2 near the axis", 0.99, "within 15 deg and 0.1 to 0.3 m"),
            ("r2_wake", "R2 of the wake", 0.82, "within 30 deg and 0.1 to 0.5 m"),
        ):
            claims.append(
                PublishedFigure(
                    method=method,
                    figure=figure,
                    title=title,
                    unit="",
                    paper=value if method.startswith("paper") else None,
                    asked=value,
                    said=f"{value:g} for its proxy"
                    + ("" if method.startswith("paper") else "; asked of this one, too"),
                    side="more",
                    how=f"axial speed {where}, thrusts and places that no model was fitted to",
                )
            )
        claims.append(
            PublishedFigure(
                method=method,
                figure="bias_far_pct",
                title="overestimate beyond 0.4 m",
                unit="%",
                paper=None,
                asked=0.0 if method == "paper" else None,
                said="overestimates beyond 0.4 m" if method == "paper" else UNQUOTED,
                side="more" if method == "paper" else "none",
                how="sum of model over sum of measured less one, within 15 deg",
            )
        )
    return claims
