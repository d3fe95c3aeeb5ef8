"""Why figures are missing is said once for each reason."""

import pytest

from wakewise.ui.cli.console import print_json, unique_reasons


def test_figures_that_fail_together_share_a_line() -> None:
    """One reason, one line, figures in the order of the table; a figure that is not asked for stays out."""
    why = {"f_score": "no model", "rmse_mm": "no model", "energy_kJ": "no power on record", "wall_s": "no model"}
    assert unique_reasons(why, ("rmse_mm", "f_score", "energy_kJ")) == [
        "rmse_mm, f_score: no model",
        "energy_kJ: no power on record",
    ]
    assert unique_reasons({}, ("rmse_mm",)) == []


def test_what_json_cannot_say_is_not_half_printed(capsys):
    """A number that is none is a fault of ours; standard output then stays empty."""
    with pytest.raises(ValueError, match="JSON"):
        print_json({"first": 1.0, "second": float("inf")})
    assert capsys.readouterr().out == ""
