"""Laws of the report of one trial: one file, no network, nothing left out, nothing crashes."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from wakewise.core.errors import InputError
from wakewise.ui.reports import write_report

# Whatever would make a browser fetch something from a host.
LOADS = re.compile(
    r"""(?:\b(?:src|href|action|poster|srcset|data)\s*=\s*["']?|url\(\s*["']?|@import\s+["']?|"""
    r"""\b(?:fetch|import|Worker|importScripts|sendBeacon|open)\s*\(\s*["'`])\s*(?:https?:)?//""",
    re.IGNORECASE,
)


def test_the_page_loads_nothing_from_any_host(report_text: str) -> None:
    """Neither the page nor the scene inside it names a host to load from."""
    assert not LOADS.search(report_text)
    scene = json.loads(re.search(r'<script type="application/json">([^<]+)</script>', report_text)[1])
    assert not LOADS.search(scene)
    assert "__VISER_EMBED_DATA__" in scene


def test_loads_from_hosts_would_be_found() -> None:
    """The search above finds the ways in which a page fetches."""
    for bad in (
        '<img src="https://a.b/c">',
        "url(//a.b)",
        '@import "http://a.b"',
        "fetch('https://a.b')",
        "src=http://a",
    ):
        assert LOADS.search(bad), bad


def test_every_local_reference_is_answered(report_text: str) -> None:
    """Each `#id` that something points at exists once; no file beside the page is needed."""
    ids = re.findall(r'\sid="([^"]+)"', report_text)
    assert len(ids) == len(set(ids))
    wanted = set(re.findall(r'href="#([^"]+)"', report_text)) | set(re.findall(r"url\(#([^)]+)\)", report_text))
    assert wanted and wanted <= set(ids)
    assert all(s.startswith("data:") for s in re.findall(r'\ssrc="([^"]{0,40})', report_text))


def test_the_page_holds_every_figure_with_its_definition_or_reason(made_up: Path, report_text: str) -> None:
    """Every key of metrics.json is in the table; null ones say why."""
    metrics = json.loads((made_up / "metrics.json").read_text())
    why, definitions = metrics.pop("why"), metrics.pop("definitions")
    for key in metrics:
        assert f'<td class="key">{key}</td>' in report_text
    for text in (*why.values(), *definitions.values()):
        assert text in report_text


def test_every_photograph_is_inside_and_two_are_marked(report_text: str) -> None:
    """All photographs are embedded as JPEGs, three of them again in pairs; one is the sharpest, one the least sharp."""
    assert report_text.count("data:image/jpeg;base64,") == 14 + 2 * 3
    assert report_text.count('<span class="tag">sharpest') == report_text.count('<span class="tag worst">') == 1


def test_every_plot_has_a_drawing_for_a_phone_and_long_parts_can_be_folded(report_text: str) -> None:
    """Panels side by side would be cut at 390 px; each leg of photographs and each group of figures is a fold."""
    plots = report_text.count('<figure class="plot">')
    assert plots >= 4
    assert report_text.count('class="wide-only"') == report_text.count('class="narrow-only"') == plots
    legs = re.findall(r'<details class="fold" open><summary>(orbit[^<]+)<', report_text)
    assert len(legs) == len(set(legs)) == 3
    assert '<details class="fold" open><summary>The water' in report_text


def test_the_scene_has_a_picture_in_its_place_until_it_is_drawn(report_text: str) -> None:
    """No white box: the model and a word stand there while the scene loads."""
    stage = report_text[report_text.index('<div class="stage">') : report_text.index("<iframe")]
    assert "data:image/png;base64," in stage
    assert "loading" in stage


def test_thrusters_have_names_and_D_is_explained_where_it_stands(report_text: str) -> None:
    """The vehicle's own names beside the numbers; the wake model is named beside its estimate."""
    water = report_text[report_text.index('id="water"') : report_text.index('id="figures"')]
    assert "D is no measurement" in water
    assert "front right horizontal 1" in water


def test_the_page_is_of_moderate_size(report_text: str) -> None:
    """A report is mailed around: below 15 MB."""
    assert 0.2e6 < len(report_text) < 15e6


def test_the_same_trial_gives_the_same_page(made_up: Path, report_text: str) -> None:
    """Written again it is the same, but for the scene's own random names; and it stays one file."""
    again = write_report(made_up).read_text()
    scene = re.compile(r'<script type="application/json">[^<]+</script>')
    assert scene.sub("", again) == scene.sub("", report_text)
    assert [p.name for p in made_up.iterdir() if p.suffix in (".html", ".js", ".css")] == ["report.html"]


@pytest.mark.slow
@pytest.mark.parametrize(
    "parts",
    [("mesh.ply", "planned.csv"), ("truth.ply", "images.csv"), ("steps.parquet",), ("metrics.json", "scenario.yaml")],
    ids=" and ".join,
)
def test_missing_parts_leave_gaps_that_say_so(made_up: Path, tmp_path: Path, parts: tuple[str, ...]) -> None:
    """Without any of its parts, a trial still has a report, and the report names them."""
    trial = tmp_path / "trial"
    shutil.copytree(made_up, trial, ignore=shutil.ignore_patterns("images", "report.html", *parts))
    text = write_report(trial).read_text()
    for part in parts:
        assert f"<code>{part}</code> was not written" in text


def test_a_failed_reconstruction_is_a_failed_scan(
    made_up: Path, tmp_path: Path, new_metrics: Callable[..., None]
) -> None:
    """With no model at all the headline says so, and gives the reason from metrics.json."""
    trial = tmp_path / "trial"
    shutil.copytree(made_up, trial, ignore=shutil.ignore_patterns("images", "*.html", "dense.ply", "mesh.ply"))
    new_metrics(trial)
    text = write_report(trial).read_text()
    assert '<h1 class="bad">' in text
    assert "There is no model." in text
    assert "Reconstruction failed." in text


def test_damaged_parts_are_named(made_up: Path, tmp_path: Path) -> None:
    """Files that hold nonsense are treated as missing, with the reason."""
    trial = tmp_path / "trial"
    shutil.copytree(made_up, trial, ignore=shutil.ignore_patterns("images", "*.html"))
    for name in ("dense.ply", "mesh.ply", "truth.ply", "steps.parquet", "planned.csv", "scenario.yaml"):
        (trial / name).write_bytes(b"\x00{nonsense")
    text = write_report(trial).read_text()
    for name in ("dense.ply", "mesh.ply", "truth.ply", "steps.parquet", "scenario.yaml"):
        assert f"<code>{name}</code> could not be read" in text


@pytest.mark.usefixtures("undrawn")
def test_markup_in_a_trial_is_shown_not_run(made_up: Path, tmp_path: Path) -> None:
    """Text from the folder is escaped."""
    trial = tmp_path / "trial"
    shutil.copytree(made_up, trial, ignore=shutil.ignore_patterns("images", "*.html", "*.ply", "steps.parquet"))
    (trial / "scenario.yaml").write_text("vehicle: <script>alert(1)</script>\n")
    text = write_report(trial).read_text()
    assert "<script>alert" not in text
    assert "&lt;script&gt;alert" in text


def test_a_folder_that_is_no_trial_is_refused(tmp_path: Path) -> None:
    """A missing or empty folder is bad input, in one line, and nothing is written."""
    for folder in (tmp_path / "none", tmp_path):
        with pytest.raises(InputError) as fault:
            write_report(folder)
        assert "\n" not in str(fault.value)
    assert list(tmp_path.iterdir()) == []
