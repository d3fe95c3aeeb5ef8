"""The measurement of how the costs of the tank grow, at small numbers."""

from __future__ import annotations

from pathlib import Path

import pytest

from wakewise_benchmarks.tank_scaling import exponent, measure_scaling, show_tank
from wakewise_benchmarks.tank_scaling_plot import draw_scaling


def test_the_exponent_of_a_power_law_is_its_power():
    """Of costs n^1.7 the exponent is 1.7; of one number there is none."""
    rows = [{"count": float(n), "ms": 1e-3 * n**1.7} for n in (10, 40, 90, 300, 2000)]
    assert exponent(rows, "ms") == pytest.approx(1.7)
    assert exponent(rows[:1], "ms") is None


def test_more_thrusters_send_more_parcels_and_all_costs_are_told_and_drawn(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    """Every number has its costs in ms; the text names the parcels, and the picture is a whole PNG."""
    found = measure_scaling(lambda *_: None, thrusters=(1, 3), points=(50, 100), particles=(50, 100), spin_up_s=1.0)
    few, many = found["rows"]["parcels"]
    assert many["count"] > 2 * few["count"] > 0
    assert all(ms > 0.0 for rows in found["rows"].values() for row in rows for ms in row.values())
    draw_scaling({"scaling": found}, tmp_path / "cost.png")
    assert (tmp_path / "cost.png").read_bytes().startswith(b"\x89PNG")
    show_tank({"realtime_factor": 9.5, "scaling": found})
    assert "parcels" in capsys.readouterr().out
