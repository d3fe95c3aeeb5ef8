"""The bench of a patch of reef: its patches, surveys and lawnmowers, and what is told of them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.experiments.trials.timing import BenchOptions
from wakewise.operation import load_scenario
from wakewise.scene.missions.visibility import patches_of
from wakewise_benchmarks import reef

PARTS = load_scenario("reef", None, {"target.seed": 1}).parts()


@pytest.fixture(scope="module")
def figures() -> dict[str, Any]:
    """Of one patch, without models, against two lawnmowers."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(reef, "DENSER", ((0.3, 0.5), (0.3, 0.25)))
        patch.setattr(reef, "PATCHES", 400)
        return reef.patch_figures(PARTS.scenario, PARTS.target, (), BenchOptions())


@pytest.mark.slow
def test_two_levels_see_more_than_transects_and_go_less_far_than_orbits_everywhere(figures: dict[str, Any]) -> None:
    """Paths, photographs and expected completeness are those of the planned poses."""
    arms = figures["arms"]
    assert set(arms) == set(reef.ARMS)
    assert arms["transects"]["expected_pct"] < arms["two-level"]["expected_pct"] <= 100.0
    assert arms["transects"]["path_m"] < arms["two-level"]["path_m"] < arms["everywhere"]["path_m"]
    assert arms["two-level"]["orbits"] >= 3
    assert arms["everywhere"]["orbits"] == 16
    assert figures["path_ratio"]["everywhere"] < 0.6
    assert len(figures["lawnmowers"]) == 2


def test_a_lawnmower_that_touches_the_relief_is_none() -> None:
    """Nearer than the hull's clearance it is not flown; higher it has the lines that were asked for."""
    assert reef.lawnmower(PARTS, 0.0, 0.5) is None
    survey = reef.lawnmower(PARTS, 0.4, 0.25)
    assert survey is not None
    assert survey.names.startswith("8 at")
    assert survey.path_m > 16.0


def test_the_real_patch_is_the_square_of_median_surface(tmp_path: Path) -> None:
    """Of a map that is rough in one corner, neither the flat nor the rough square is taken; it stands on the bed."""
    rng = np.random.default_rng(0)
    rough = np.linspace(0.0, 0.02, 400)[:, None] * rng.normal(size=(400, 400))
    path = tmp_path / "map.npz"
    np.savez(path, z=(-3.0 + rough).astype(np.float32))
    target = reef.real_patch(path, 3.0)
    top = target.bed_z_m - target.mesh.vertices_m[:, 2].min()
    assert 0.02 < top < 0.25
    assert np.ptp(target.mesh.vertices_m[:, 0]) == pytest.approx(2.5)


def test_the_map_has_what_two_photographs_show() -> None:
    """Points are a cell apart and near the true surface; what no transect shows is not mapped."""
    patches = patches_of(PARTS.target.mesh, None, 400)
    poses = PARTS.route.X_WC_planned
    target = reef.mapped(patches, poses, PARTS)
    assert target.surface_W_m is not None
    assert len(target.surface_W_m) > 1000
    assert len(reef.mapped(patches, poses[:6], PARTS).points_W_m) < len(target.points_W_m)


@pytest.mark.slow
def test_the_answer_is_printed_and_an_unknown_survey_refused(
    figures: dict[str, Any], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A row per survey, the ratios, the cost; a name that is none is refused in one line."""
    monkeypatch.setattr(reef, "patch_figures", lambda *_: figures)
    monkeypatch.setattr(reef, "POINTS", (100, 300, 1000))
    told = reef.run(BenchOptions(seeds=1, models=0))
    assert told["why"] == {"real": f"needs {reef.REAL} in --data"}
    assert told["cost"]["gram_us_per_point"] > 0.0
    reef.show_reef(told)
    printed = capsys.readouterr().out
    assert "two-level" in printed
    assert "path over everywhere's" in printed
    with pytest.raises(InputError, match="--methods: 'spiral' is not known"):
        reef.run(replace(BenchOptions(), methods=("spiral",)))
