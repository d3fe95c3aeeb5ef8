"""Every page and picture of the project comes about whichever of its figures is missing, and says a dash for it."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import polars as pl
import pytest
from holes import figure_places, with_holes, without
from test_campaign_page import campaign
from test_photo_model_report import FACTS, FIGURES, TARGET

from wakewise.robot.vehicles import describe, load_draft
from wakewise.ui.reports.campaign import campaign_page
from wakewise.ui.reports.compare import comparison_page
from wakewise.ui.reports.methods_compared import methods_compared, profiles
from wakewise.ui.reports.photo_model.page import model_page
from wakewise.ui.reports.photo_preview import look_page
from wakewise.ui.reports.report import report_page
from wakewise.ui.reports.text import NONE, fixed, number, shown
from wakewise.ui.reports.trial import read_trial
from wakewise.ui.reports.vehicle import page as vehicle
from wakewise.vision.reconstruction.quality.photo_preview import PhotoPreview, PhotoQuality
from wakewise_ardusub.reports.log import log_page
from wakewise_paper.reports.operator_bench_plot import draw_operator, plot_degradation
from wakewise_paper.reports.reproduction import write_results
from wakewise_paper.reports.reproduction.page import tables_page
from wakewise_paper.reports.reproduction.plots import agreement, obedience
from wakewise_paper.reports.wake import wake_page
from wakewise_paper.reports.wash_bench_plot import LOOKS, draw_gentle
from wakewise_paper.reproduction.claim import JUDGED

SAID = re.compile(r"\bNone\b|\bnan\b|\binf\b")
"""What a page must not say where a figure is missing."""


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    """Figures are put together, but not drawn, and 3D scenes are left out: neither has a figure in words."""
    monkeypatch.setattr("wakewise.ui.reports.svg_style.inline_svg", lambda *_: "<svg></svg>")
    monkeypatch.setattr("wakewise.ui.reports.model.scene_html", lambda *_: None)
    monkeypatch.setattr("wakewise.ui.reports.photo_model.page.match_figure", lambda _: None)
    for drawn in ("plan_and_side", "water_over_time", "thrust_strip", "overlaid_speeds"):
        monkeypatch.setattr(f"wakewise.ui.reports.figures.{drawn}", lambda *_, **__: None)


def words_of(page: str) -> str:
    """What people read of a page: without tags, style and script."""
    body = re.sub(r"<(script|style)\b.*?</\1>", "", page[page.index("<body") :], flags=re.DOTALL)
    return re.sub(r"<[^>]*>", " ", body)


def every_hole(tree: Any, page: Callable[[Any], str]) -> None:
    """Render a page without each figure in turn, and without all; none says None."""
    count = 0
    for name, holed in with_holes(tree):
        said = words_of(page(holed))
        found = SAID.search(said)
        assert found is None, f"without {name}: ... {said[max(0, found.start() - 60) : found.end() + 20]} ..."
        count += 1
    assert count > 5


MORE = {
    "known cameras": {"scale": 1.0, "cameras_rmse_mm": None, "cameras_max_mm": None, "reference_inliers": None,
                      "surface_distance_m": 3.1, "scale_bars": None},
    "references": {"scale": 2.0, "cameras_rmse_mm": 1.0, "cameras_max_mm": 2.0, "reference_inliers": 3,
                   "surface_distance_m": 3.1, "scale_bars": None, "dense_points": 10, "mesh_faces": 20},
    "bars": {"scale_bars": FIGURES["scale_bars"] | {"targets": [TARGET]}},
    "bars beside references": {"scale": 1.0, "scale_bars": FIGURES["scale_bars"] | {"used": False}},
    "fixes": {"scale_bars": None, "scale_fixes": {
        "used": True, "photos": 9, "uncertainty_pct": 3.0, "model_off_pct": 2.0, "why": None, "north_known": True,
        "horizontal_rms_m": 1.0, "depth_rms_m": 0.1, "far": ["a.jpg"]}},
    "fixes that are not used": {"scale_bars": None, "scale_fixes": {
        "used": False, "photos": 9, "uncertainty_pct": 30.0, "model_off_pct": None, "why": "too near", "far": [],
        "north_known": False, "horizontal_rms_m": 1.0, "depth_rms_m": 0.1}},
}  # fmt: skip


@pytest.mark.parametrize("more", MORE.values(), ids=MORE)
def test_the_page_of_a_model_from_photographs(more):
    """With bars, references, known cameras or fixes."""
    every_hole(FIGURES | more, lambda found: model_page("reef", found, FACTS, None))


def test_the_page_of_a_model_whose_lists_or_photographs_lack_something():
    """A list or mapping that is missing is an empty one; a figure of a photograph is a dash."""
    told = FIGURES | MORE["fixes"]
    for key in told:
        assert "None" not in words_of(model_page("reef", told | {key: None}, FACTS, None))
        model_page("reef", {name: value for name, value in told.items() if name != key}, FACTS, None)
    for place in figure_places(FACTS.photos):
        holed = replace(FACTS, photos=without(FACTS.photos, place))
        assert "None" not in words_of(model_page("reef", told, holed, None))


@pytest.fixture(scope="module")
def flown(tmp_path_factory, made_up) -> Path:
    """A trial with figures and a record, but without photographs and models."""
    folder = tmp_path_factory.mktemp("flown") / "mpc-smooth"
    folder.mkdir()
    for name in ("steps.parquet", "scenario.yaml"):
        (folder / name).write_bytes((made_up / name).read_bytes())
    told = json.loads((made_up / "metrics.json").read_text(encoding="utf-8"))
    told |= {
        "ambient_speed_m_s": 0.01, "disturbance_flown": 0.2, "disturbance_least_thrusts": 0.3, "bed_shear_p95_Pa": 0.1,
        "grain_threshold_Pa": 0.05, "coverage_agreement_pct": 80.0, "turbidity_mean_per_m": 0.3,
    }  # fmt: skip
    (folder / "metrics.json").write_text(json.dumps(told), encoding="utf-8")
    return folder


def test_the_page_of_a_trial_and_of_a_comparison(flown, tmp_path):
    """Figures of metrics.json, with a reason beside them or without; in a comparison in the first trial or another."""
    whole = read_trial(flown)
    told = dict(whole.metrics.values)

    def holed(found: dict[str, Any]) -> Any:
        return replace(whole, metrics=replace(whole.metrics, values=found))

    pages = [report_page, lambda trial: comparison_page({"dp": whole, "mpc-smooth": trial}),
             lambda trial: comparison_page({"mpc-smooth": trial, "dp": whole})]  # fmt: skip
    for page in pages:
        every_hole(told, lambda found, page=page: page(holed(found)))


def test_the_page_of_a_campaign(tmp_path):
    """Figures of each of its trials."""
    found = campaign(seeds=2)

    def page(figures: list[dict[str, Any]]) -> str:
        made = tuple(replace(one, figures=own) for one, own in zip(found.made, figures, strict=True))
        return campaign_page(replace(found, made=made), tmp_path)

    every_hole([dict(one.figures) for one in found.made], page)


def _rows(**changes: Any) -> dict[str, Any]:
    """A row of the paper's tables."""
    return {
        "method": "wake-aware", "target": None, "figure": "wash", "paper": 60.0, "ours": 50.0, "low": 40.0,
        "high": 60.0, "n": 3, "met": True, "world": "pump-tank", "unit": "mm/s", "key": "target_speed_mean_m_s",
        "reading": "mean", "than": None, "asked": 60.0, "side": "less", "paper_says": "60 mm/s", "failed": 0,
        "sure": True, "setup": "the paper's own", "met_by_all": False, "told_apart": True, "preliminary": True,
        "baseline": "mpc", "source": "table", "paper_sd": 0.4,
        "how": "flown", "why": {}, "p_t": 0.01, "p_wilcoxon": 0.02, "p_holm": 0.02, "d_z": 1.0, "improvement": 0.9,
        "pairs_for_80_pct": 7,
    } | changes  # fmt: skip


def _tables() -> dict[str, Any]:
    places = [
        {"world": "pump-tank", "method": method, "target": "brain", "seed": seed, "folder": "x", "reason": None,
         "figures": {"target_speed_mean_m_s": 0.02 / (1 + k) + 1e-4 * seed, "energy_kJ": 1.0, "rmse_mm": 2.0}}
        for seed in (1, 2) for k, method in enumerate(("mpc", "wake-aware"))
    ]  # fmt: skip
    common = {"title": "hold a place", "made": 6, "failed": 0, "trials": 3, "trial_s": 60.0, "seeds": [1, 2, 3],
              "config_hash": "ab", "worlds": ["pump-tank"], "failures": [], "why": {}, "places": places,
              "left_undone": 0}  # fmt: skip
    wake = [_rows(world="-", method=m, target=f, key=k, figure=k) for m in ("paper", "jet") for f in ("oracle",)
            for k in ("r2_core",)]  # fmt: skip
    return {
        "station": {"table": "station", **common, "rows": [_rows(), _rows(reading="less_pct", than="dp")]},
        "wake": {"table": "wake", **common, "places": [], "worlds": [], "rows": wake},
        "operator": {"table": "operator", **common, "rows": [
            _rows(method="wake-aware 5", key="velocity_deviation_pct"), _rows(method="wake-aware 5", reading="less_pct")
        ]},
    }  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("name", ["station", "wake", "operator"])
def test_the_pages_of_the_papers_tables(name, tmp_path, monkeypatch):
    """As HTML and as Markdown; of rows and of trials."""
    for module in ("page", "results"):
        for drawn in ("methods_compared", "profiles"):
            monkeypatch.setattr(f"wakewise_paper.reports.reproduction.{module}.{drawn}", lambda *_, **__: None)
    for drawn in ("agreement", "obedience"):
        monkeypatch.setattr(f"wakewise_paper.reports.reproduction.plots.{drawn}", lambda *_, **__: None)
    monkeypatch.setattr("wakewise_paper.reports.reproduction.results.standalone_svg", lambda _: "<svg></svg>")

    def both(tables: Any) -> str:
        written = write_results(tables, tmp_path, tmp_path / "out").parent.glob("*.md")
        return tables_page(tables, tmp_path) + "".join(path.read_text(encoding="utf-8") for path in written)

    every_hole({name: _tables()[name]}, both)


def test_pictures_of_the_papers_tables():
    """Methods side by side and how often each is how good, by what trials and rows have."""
    table, measure = _tables()["station"], JUDGED["station"]
    for _, (rows, places) in with_holes((table["rows"][:1], table["places"][:2])):
        methods_compared(measure, [*places, *table["places"][2:]], rows)
    for _, rows in with_holes(_tables()["wake"]["rows"][:1]):
        agreement(rows)
    for _, rows in with_holes(_tables()["operator"]["rows"]):
        obedience(rows)
    for _, places in with_holes(table["places"][:2]):
        profiles(measure, [*places, *table["places"][2:], *table["places"]])


@pytest.mark.parametrize("name", ["bluerov2-heavy", "paper"])
def test_the_page_of_a_vehicle(name, monkeypatch):
    """What its geometry allows and what each failure takes."""
    draft = load_draft(name)
    facts = describe(draft)
    facts |= {key: facts[key][:2] for key in ("thrusters", "failures", "null_space")}
    monkeypatch.setattr(vehicle, "drawing_svg", lambda *_, **__: "")
    monkeypatch.setattr(vehicle, "parameters", lambda _: ())

    def page(found: dict[str, Any]) -> str:
        monkeypatch.setattr(vehicle, "describe", lambda _: found)
        return vehicle.vehicle_page(draft)

    every_hole({key: facts[key] for key in facts if key not in ("allocation_matrix", "added_mass")}, page)


def test_the_page_of_wake_models(monkeypatch):
    """Every R2, number of a fit and error of the round trips."""
    for drawn in ("scatters", "profiles", "decays"):
        monkeypatch.setattr(f"wakewise_paper.reports.wake.{drawn}", lambda *_, **__: None)
    keys = ("r2_core", "r2_wake", "bias_far_pct")
    found = {"gain": {"value": 1.1, "low": 1.0, "high": 1.2}}
    cells = {"parcels": dict.fromkeys(keys, 0.4) | {"parameters": found, "warnings": []},
             "piv": dict.fromkeys(keys) | {"why": dict.fromkeys(keys, "no data")}}  # fmt: skip
    trip = {"field": "jet", "median_px": 0.1, "rms_px": 0.1, "bias_px": 0.0, "valid_pct": 99.0}
    real = {"pairs": 3, "valid_pct": 99.0, "fastest_px": 9.0, "along_jet_pct": 98.0}
    values = {
        "models": dict.fromkeys(("paper", "paper-calibrated", "jet"), cells), "grid_convergence_pct": 3.0,
        "paper": {"r2_core": 0.99, "r2_wake": 0.82},
        "flows": {"parcels": {"title": "a jet", "note": "", "split": "half", "points": 9, "test_points": 4}},
        "piv": {"round_trips": [trip], "real_pairs": real}, "why": {},
    }  # fmt: skip
    result: Any = SimpleNamespace(absent={"piv": "no data"}, flows=())
    every_hole(values, lambda holed: wake_page(result, holed))


def test_the_page_of_a_log(monkeypatch):
    """With hindsight and without."""
    for drawn in ("dive", "pulses", "speeds", "thrusts"):
        monkeypatch.setattr(f"wakewise_ardusub.reports.log_plots.{drawn}", lambda *_, **__: None)
    rows = pl.DataFrame({"time_s": [0.0, 1.0]})
    facts = {
        "file": "dive.tlog", "format": "tlog", "vehicle": "bluerov2-heavy", "points": "ahead", "wake_model": "jet",
        "duration_s": 60.0, "armed_s": 30.0, "records": 1000, "bad_records": 3, "bad_by_reason": {"checksum": 3},
        "bad_bytes": 12, "cut_short": True, "clock_jumps": [{"time_s": 3.0, "step_s": 1.0}], "samples": {"servo": 5},
        "parameters": 7, "rate_hz": 20.0, "depth_from": "pressure", "depth_max_m": 3.0, "voltage_min_V": 14.0,
        "identity": "ArduSub", "unread_records": {"CTUN": 2}, "running_s": 20.0, "saved_pct": 12.0, "motors": [1, 2],
        "directions": [1, -1], "total_weight": 3.0,
    }  # fmt: skip
    every_hole(facts, lambda found: log_page(rows, found, ["a", "b"]))
    without_hindsight = {key: facts[key] for key in list(facts)[:-4]} | {"why_no_hindsight": "no servo outputs"}
    every_hole(without_hindsight, lambda found: log_page(rows, found, ["a", "b"]))


def test_the_page_of_a_look_at_photographs():
    """Of one photograph and of all."""
    photos = tuple(
        PhotoQuality(name=name, width=80, height=60, sharpness_pct=100.0, mean=90.0, dark_pct=1.0, bright_pct=2.0,
                  features=300, partners=(("b.jpg", 40),), covered_pct=50.0, group=0, faults=faults)
        for name, faults in (("a.jpg", ()), ("b.jpg", ("blurred: 20 % of the usual",)))
    )  # fmt: skip
    look = PhotoPreview(photos=photos, groups=(2,), pairs=1, advice=("shoot b again",), passed_over={"video": 1})
    every_hole(look, lambda found: look_page(found, {"a.jpg": b"", "b.jpg": b""}, "dive"))


def _gentle() -> dict[str, Any]:
    row = {"target_speed_mean_m_s": 0.01, "target_speed_mean_m_s_interval": [0.008, 0.012]}
    return {"scenarios": {name: {"methods": dict.fromkeys(tuple(LOOKS)[:2], row)} for name in ("orbit", "mud")}}


def _operator() -> dict[str, Any]:
    row = {"velocity_deviation_pct": 9.0, "target_speed_reduction_pct": 70.0, "target_speed_reduction_all_pct": 60.0}
    sweep = dict.fromkeys(("1", "5"), row)
    return {"worlds": {"mud": {"w_track": sweep}}, "paper": {"w_track": sweep, "w_track_over": sweep}}


def _degraded() -> list[dict[str, Any]]:
    keys = ("rmse_mm", "accuracy_median_mm", "completeness_pct", "completeness_visible_pct", "registered_images")
    return [
        {"level": level, "images": 9, "failure": None if level < 20.0 else "too few", **dict.fromkeys(keys, 3.0)}
        for level in (0.0, 10.0, 20.0)
    ]


PICTURES: dict[str, tuple[Any, Callable[[Any, Path], None]]] = {
    "gentle": (_gentle(), draw_gentle),
    "operator": (_operator(), draw_operator),
    "degradation": (_degraded(), lambda rows, path: plot_degradation(rows, "silt", "mg/L", path)),
}


@pytest.mark.parametrize("name", PICTURES)
def test_pictures_of_studies(name, tmp_path, monkeypatch):
    """A mark is left out, and the rest is drawn."""
    monkeypatch.setattr("matplotlib.figure.Figure.savefig", lambda _, path, **__: Path(path).write_bytes(b"drawn"))
    tree, draw = PICTURES[name]
    for place, holed in with_holes(tree):
        draw(holed, tmp_path / f"{name}.png")
        assert (tmp_path / f"{name}.png").read_bytes() == b"drawn", place


@pytest.mark.parametrize("value", [None, float("nan"), float("inf"), np.float64("nan")])
def test_one_formatter_says_a_dash(value):
    """For None, and for what JSON has no word for."""
    assert number(value) == number(value, scale=1e3) == fixed(value, 2) == fixed(value, 2, scale=1e3, sign=True) == NONE
    assert shown(None) == NONE


def test_the_formatter_scales_and_signs():
    """Decimals as asked, thin spaces between thousands; no minus before a zero."""
    assert fixed(0.0123, 2, scale=1e3) == "12.30"
    assert fixed(0.4, 1, sign=True) == "+0.4"
    assert fixed(-0.0001, 2) == "0.00"
    assert number(0.0123, scale=1e3) == "12.3"
