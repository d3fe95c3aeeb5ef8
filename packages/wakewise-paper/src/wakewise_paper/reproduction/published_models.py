"""What the paper says of models: tables `dynamic`, `success`, `sediment` and `field`."""

from __future__ import annotations

from wakewise_paper.reproduction.claim import ORDER, RMSE, SUCCESS, UNQUOTED, WASH, PublishedFigure, less, model_claims


def dynamic() -> list[PublishedFigure]:
    """Models while flying round."""
    rmse: dict[str, float | None] = {"manual": 8.7, "unaware": 4.3, "smooth": 2.8, "wake-aware": 1.9}
    claims = model_claims(rmse, {"manual": 34.2, "unaware": 68.5, "smooth": 87.0, "wake-aware": 94.8})
    claims.append(
        PublishedFigure(
            method="wake-aware",
            figure="rmse_mm",
            title="order of the methods by RMSE",
            unit="%",
            paper=None,
            said=" > ".join(ORDER),
            side="none",
            reading="order",
            how="share of a bootstrap's draws in which the means stand in the paper's order",
        )
    )
    for than, value in rmse.items():
        if than != "wake-aware" and value is not None:
            words = f"{value:g} mm and 1.9 mm, from which this share follows"
            claims.append(less("rmse_mm", "RMSE", than, 100.0 * (1.0 - 1.9 / value), words, RMSE))
    claims.append(less("target_speed_mean_m_s", "wash at the target", "unaware", None, UNQUOTED, WASH, asked=0.0))
    for figure, title, unit in (
        ("position_rmse_mm", "distance from the wished place", "mm"),
        ("collisions", "times the hull touched something", ""),
    ):
        claims += [
            PublishedFigure(
                method=method,
                figure=figure,
                title=title,
                unit=unit,
                paper=None,
                said=UNQUOTED,
                side="none",
                how="mean over the flights in which the photographs were taken",
            )
            for method in rmse
        ]
    for figure, title in (("area_cm2", "area of the model"), ("volume_cm3", "volume of the model")):
        claims += [
            PublishedFigure(
                method=method,
                figure=figure,
                title=f"{title}, repeated",
                unit="%",
                paper=None,
                said=f"{UNQUOTED}; biologists ask for it (1 % is reached by photogrammetry of coral fragments)",
                side="none",
                reading="spread_pct",
                how="coefficient of variation over seeds of one target, mean over targets; what stands 1 cm clear of "
                "the bed",
            )
            for method in rmse
        ]
    return claims


def success() -> list[PublishedFigure]:
    """Models that succeed."""
    quoted = {"wake-aware": 98.5, "unaware": 45.0}
    table = {"wake-aware": "98.3 % (59 of 60)", "unaware": "45 % (27 of 60)"}
    return [
        PublishedFigure(
            method=method,
            figure="success",
            title=f"models with {SUCCESS}",
            unit="%",
            paper=share,
            said=f"{share:g} % of trials; {table[method]} in table Dynamic Scanning",
            side="more" if method == "wake-aware" else "none",
            reading="share_pct",
            itt=True,
            how="trials that failed count as no success; Wilson's interval",
        )
        for method, share in quoted.items()
    ]


def sediment() -> list[PublishedFigure]:
    """Calcium carbonate."""
    claims = model_claims({"wake-aware": None, "unaware": None}, {})
    rays = "beam attenuation by silt along the rays from camera to target, mean over rays and time"
    lifted = "what the bed gave up by the end of the flight"
    said = "62 % less disturbance in its water with silt, 67 % in clear water; silt itself is not given (Discussion)"
    claims.append(less("ray_optical_depth", "silt on the rays", "unaware", None, said, rays, asked=0.0))
    claims.append(less("silt_lifted_g", "silt lifted", "unaware", None, said, lifted, asked=0.0))
    said = "about 40 % more than in clear water, with the method alone (Discussion)"
    claims.append(less("rmse_mm", "RMSE", "unaware", None, said, RMSE, asked=0.0))
    return claims


def field() -> list[PublishedFigure]:
    """A dive at sea."""
    claims = [
        PublishedFigure(
            method=method,
            figure="rmse_mm",
            title="RMSE of models that were made",
            unit="mm",
            paper=5.0,
            said="3 to 5 mm expected, not measured",
            side="less",
            how=RMSE,
        )
        for method in ("wake-aware", "dp")
    ]
    claims += [
        PublishedFigure(
            method=method,
            figure="success",
            title=f"models with {SUCCESS}",
            unit="%",
            paper=None,
            said=UNQUOTED,
            side="none",
            reading="share_pct",
            itt=True,
            how="trials that failed count as no success; Wilson's interval",
        )
        for method in ("wake-aware", "dp")
    ]
    return claims
