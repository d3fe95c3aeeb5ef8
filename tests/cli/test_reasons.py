"""Why figures are missing is said once for each reason."""

from wakewise.cli.console import reasons_once


def test_figures_that_fail_together_share_a_line() -> None:
    """One reason, one line, figures in the order of the table; a figure that is not asked for stays out."""
    why = {"f_score": "no model", "rmse_mm": "no model", "energy_kJ": "no power on record", "wall_s": "no model"}
    assert reasons_once(why, ("rmse_mm", "f_score", "energy_kJ")) == [
        "rmse_mm, f_score: no model",
        "energy_kJ: no power on record",
    ]
    assert reasons_once({}, ("rmse_mm",)) == []
