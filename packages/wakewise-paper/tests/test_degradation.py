"""The degradation study: levels in order, a failure told as one and never as a figure, resumed from its files."""

import json

import pytest

from wakewise.core.errors import InputError
from wakewise.operation import load_scenario
from wakewise_paper import photo_robustness
from wakewise_paper.photo_robustness import COLUMNS, FACTORS, degrade
from wakewise_paper.reports.operator_bench_plot import plot_degradation

pytestmark = pytest.mark.slow

SMALL = {
    "target.kind": "brain",
    "mission.elevations_deg": [45],
    "mission.views": [14],
    "mission.standoff_m": 0.35,
    "imaging.width": 320,
    "imaging.height": 240,
    "imaging.fov_deg": 50,
    "imaging.samples": 1,
    "reconstruction.dense_px": 160,
    "reconstruction.dense_zoom": 1.0,
    "reconstruction.stereo_paths": 3,
    "reconstruction.stereo_partners": 2,
}


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    folder = tmp_path_factory.mktemp("study")
    scenario = load_scenario("quick", None, SMALL)
    return folder, scenario, degrade(scenario, folder, {"silt": (0.0, 3000.0, 4000.0)})


@pytest.fixture(scope="module")
def told(tmp_path_factory):
    """The same study with its photographs, but of models that are made up: what it does with them is looked at."""

    def made_up(photos, *_):
        mud = bool(asked)
        asked.append(photos.folder)
        figures = {"images": len(photos.names), "failure": "too few features" if mud else None, "success": not mud}
        return figures | ({} if mud else {"rmse_mm": 1.0, "completeness_pct": 97.0})

    asked = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(photo_robustness, "judge", made_up)
        scenario = load_scenario("quick", None, SMALL | {"mission.views": [4]})
        folder = tmp_path_factory.mktemp("told")
        return folder, scenario, degrade(scenario, folder, {"silt": (0.0, 3000.0, 4000.0)})


def test_clear_water_gives_a_model_and_mud_gives_none(study):
    """In clear water there are figures; in mud a reason instead of every one of them, and it ends there."""
    _, _, rows = study
    assert [row["level"] for row in rows] == [0.0, 3000.0]
    clear, mud = rows
    assert tuple(clear) == COLUMNS
    assert clear["failure"] is None and clear["rmse_mm"] < 3.0 and clear["registered_images"] == 14
    assert mud["failure"] and mud["success"] is False
    assert mud["rmse_mm"] is None and mud["completeness_pct"] is None


def test_what_is_done_is_not_done_again_and_another_study_is_refused(told, monkeypatch):
    """A second call reads its files; another scenario in the same folder is bad input."""
    folder, scenario, rows = told
    monkeypatch.setattr(photo_robustness, "judge", None)
    assert degrade(scenario, folder, {"silt": (0.0, 3000.0)}) == rows
    assert json.loads((folder / "degradation.json").read_text())["rows"] == rows
    assert len((folder / "degradation.csv").read_text().splitlines()) == 3
    with pytest.raises(InputError, match="another scenario"):
        degrade(load_scenario("quick", None, SMALL | {"seed": 7}), folder)


def test_the_plot_holds_levels_with_and_without_a_model(told, tmp_path):
    """A picture comes about whether there are models, none, or only some."""
    rows = told[2]
    assert [row["failure"] for row in rows] == [None, "too few features"]
    for some in (rows, rows[:1], rows[1:]):
        plot_degradation(some, FACTORS["silt"].title, "mg/L", tmp_path / "silt.png")
        assert (tmp_path / "silt.png").stat().st_size > 5000


def test_silly_levels_are_told(tmp_path):
    """Unknown factors and levels that do not rise from 0 are bad input, before anything is written."""
    scenario = load_scenario("quick", None, SMALL)
    for levels, words in (({"fog": (0.0,)}, "fog"), ({"silt": (2.0, 1.0)}, "rise"), ({"blur": (-1.0,)}, "rise")):
        with pytest.raises(InputError, match=words):
            degrade(scenario, tmp_path / "x", levels)
    assert not (tmp_path / "x").exists()


def test_levels_of_every_factor_begin_at_none():
    """Each factor has a level without it, so that its curve has a beginning."""
    assert all(factor.levels[0] == 0.0 for factor in FACTORS.values())
