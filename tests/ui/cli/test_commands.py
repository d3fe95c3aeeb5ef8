"""Commands: help is documented, JSON is alone on standard output, small commands do what they say."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from wakewise.operation import Scenario
from wakewise.ui.cli.main import run

ROOT = Path(__file__).parents[3]


def test_the_documentation_is_what_commands_and_settings_say() -> None:
    """docs/commands.md and docs/scenario.md are up to date; `tools/write_docs.py` writes them."""
    sys.path.insert(0, str(ROOT / "tools"))
    try:
        from write_docs import DOCS, PAGES
    finally:
        sys.path.pop(0)
    for name, text in PAGES.items():
        assert (DOCS / name).read_text(encoding="utf-8") == text(), f"docs/{name} is stale: run tools/write_docs.py"


def _leaves(tree: dict[str, object], prefix: str = "") -> list[str]:
    """Dotted names of all values of a tree."""
    names = []
    for key, value in tree.items():
        names += _leaves(value, f"{prefix}{key}.") if isinstance(value, dict) else [f"{prefix}{key}"]
    return names


def test_the_page_of_fields_lists_every_one() -> None:
    """Whatever a resolved scenario holds, however deep, has a row of docs/scenario.md, and only one."""
    rows = [line.split("`")[1] for line in (ROOT / "docs" / "scenario.md").read_text().splitlines() if "| `" in line]
    fields = _leaves(Scenario().model_dump(mode="json"))
    assert len(fields) > 140
    assert sorted(set(fields) - set(rows)) == []
    assert len(rows) == len(set(rows))


def test_help_is_quick_and_loads_no_heavy_library() -> None:
    """Asking for help imports neither numba, nor OpenCV, nor pycolmap."""
    code = "import sys, wakewise.ui.cli.main; heavy = ('numba', 'cv2', 'pycolmap', 'viser')"
    code += "; print([m for m in heavy if m in sys.modules])"
    shown = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert shown.strip() == "[]"


@pytest.mark.parametrize("name", ["paper", "bluerov2-heavy"])
def test_a_vehicle_is_shown_to_machines_and_people(
    name: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """--json prints one object with rank 6 and two null vectors; the table names every thruster; a drawing is SVG."""
    assert run(["vehicle", "show", name, "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["rank"] == 6
    assert len(facts["null_space"]) == 2
    assert run(["vehicle", "show", name, "--drawing", str(tmp_path / "v.svg")]) == 0
    shown = capsys.readouterr().out
    assert all(thruster["name"] in shown for thruster in facts["thrusters"])
    assert (tmp_path / "v.svg").read_text().startswith("<svg")


def test_a_model_that_is_the_truth_scores_perfectly(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """Points drawn from a surface have next to no error against it and cover it."""
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=4, radius=0.07)
    ball.export(tmp_path / "truth.ply")
    points = trimesh.PointCloud(trimesh.sample.sample_surface(ball, 400_000, seed=1)[0])
    points.export(tmp_path / "cloud.ply")
    assert run(["evaluate", str(tmp_path / "cloud.ply"), "--reference", str(tmp_path / "truth.ply"), "--json"]) == 0
    score = json.loads(capsys.readouterr().out)
    assert score["rmse_mm"] < 0.1
    assert score["completeness_1mm_pct"] > 99.0
    assert score["success"] is True
    assert "completeness_visible_pct" in score["why"]


def test_help_names_every_method_and_every_wake_model() -> None:
    """`--method` and `--wake-model` list what there is, so that nobody learns it from a refusal."""
    from wakewise.control import METHODS
    from wakewise.wake.models import OWN_MODELS

    page = (Path(__file__).parents[3] / "docs" / "commands.md").read_text(encoding="utf-8")
    scan = " ".join(page.split("## wakewise scan")[1].split("\n## ")[0].split())
    allocate = " ".join(page.split("## wakewise allocate")[1].split("\n## ")[0].split())
    assert [name for name in METHODS if name not in scan] == []
    assert [name for name in OWN_MODELS if name not in allocate] == []
