"""Gallery and notebooks: short, without outputs, and all of them on the pages."""

import ast
import json
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
GALLERY = sorted((ROOT / "examples" / "gallery").glob("plot_*.py"))
NOTEBOOKS = sorted((ROOT / "examples" / "notebooks").glob("*.ipynb"))


@pytest.mark.parametrize("path", GALLERY, ids=lambda path: path.stem)
def test_a_script_of_the_gallery_has_a_title_and_is_short(path):
    """Its docstring begins with an underlined title, and it has at most 60 lines."""
    text = path.read_text(encoding="utf-8")
    title, underline = (ast.get_docstring(ast.parse(text)) or "").splitlines()[:2]
    assert underline == "=" * len(title)
    assert len(text.splitlines()) <= 60


def test_there_are_six_notebooks_and_the_page_names_them():
    """Each has a row in docs/notebooks.md."""
    page = (ROOT / "docs" / "notebooks.md").read_text(encoding="utf-8")
    assert len(NOTEBOOKS) == 6
    assert [path.name for path in NOTEBOOKS if f"(../examples/notebooks/{path.name})" not in page] == []


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_kept_without_outputs(path):
    """`make notebooks` runs it; what it shows is not kept in the repository."""
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    code = [cell for cell in cells if cell["cell_type"] == "code"]
    assert code and all(not cell["outputs"] and cell["execution_count"] is None for cell in code)
    assert cells[0]["cell_type"] == "markdown" and "".join(cells[0]["source"]).startswith("# ")


def test_the_tools_of_the_site_are_pinned_with_hashes_and_without_addresses():
    """docs/requirements.lock agrees with requirements.lock wherever both pin a package."""
    pins = []
    for name in ("requirements.lock", "docs/requirements.lock"):
        text = (ROOT / name).read_text(encoding="utf-8")
        assert "://" not in text
        pins.append(dict(line.split(" ")[0].split("==") for line in text.splitlines() if "==" in line.split(" ")[0]))
        assert text.count("--hash=sha256:") >= len(pins[-1])
    assert pins[1]["sphinx"]
    assert {name: pin for name, pin in pins[1].items() if pins[0].get(name, pin) != pin} == {}
