"""Python of the pages that show what it prints: pasted in order, each block prints the text below it."""

import contextlib
import io
import re
from pathlib import Path

import numpy as np
import pytest
import trimesh

DOCS = Path(__file__).parents[2] / "docs"
NUMBER = r"-?\d+\.?\d*(?:e-?\d+)?"


def blocks(page: str) -> list[tuple[str, str]]:
    """Python blocks of a page in order, each with the text block that follows it directly, if one does."""
    text = (DOCS / page).read_text(encoding="utf-8")
    found = re.findall(r"^```python\n(.*?)^```$(?:\n\n^```text\n(.*?)^```$)?", text, re.MULTILINE | re.DOTALL)
    assert len(found) == text.count("```python"), page
    return found


def assert_alike(printed: str, shown: str, rel: float) -> None:
    """The words are the same, and the numbers nearly: another processor may round another way."""
    words = [re.sub(r"\s+", " ", re.sub(NUMBER, "#", text)).replace("[ ", "[").strip() for text in (printed, shown)]
    assert words[0] == words[1]
    numbers = [[float(number) for number in re.findall(NUMBER, text)] for text in (printed, shown)]
    np.testing.assert_allclose(*numbers, rtol=rel, atol=0.011)


@pytest.mark.parametrize(
    ("page", "rel"), [("allocation.md", 0.02), pytest.param("tutorial.md", 0.15, marks=pytest.mark.slow)]
)
def test_the_python_of_a_page_prints_what_the_page_shows(page, rel, tmp_path, monkeypatch):
    """Block after block in one session, and at least one of them shows what it prints."""
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    for code, shown in blocks(page):
        out = io.StringIO()
        with contextlib.redirect_stdout(out):
            exec(code, names)
        if shown:
            assert_alike(out.getvalue(), shown, rel)
    assert any(shown for _, shown in blocks(page))


def test_a_model_is_turned_to_east_north_up(tmp_path, monkeypatch):
    """The page's matrix is that of its Python: a point 1 north, 2 east, 3 down; the inside of a mesh stays inside."""
    monkeypatch.chdir(tmp_path)
    solid = trimesh.creation.box((1.0, 1.0, 1.0))
    solid.apply_translation([1.0, 2.0, 3.0])
    solid.export("mesh.ply")
    ((code, _),) = blocks("scale.md")
    exec(code, {})
    turned = trimesh.load("mesh-z-up.ply", process=False)
    np.testing.assert_allclose(turned.bounds.mean(axis=0), [2.0, 1.0, -3.0])
    assert turned.volume > 0.9
    pasted = re.search(r"^```text\n(0 .*?)^```$", (DOCS / "scale.md").read_text(), re.MULTILINE | re.DOTALL)
    assert pasted and re.findall(r"-?\d", pasted[1]) == re.findall(r"-?\d", code.split("transform(")[1].split(")")[0])


def test_a_wrong_number_would_be_found():
    """The comparison above can fail, by number and by word."""
    assert_alike("least 1.00 mm/s", "least 1.01 mm/s", 0.02)
    with pytest.raises(AssertionError):
        assert_alike("least 1.20 mm/s", "least 1.01 mm/s", 0.02)
    with pytest.raises(AssertionError):
        assert_alike("most 1.00 mm/s", "least 1.00 mm/s", 0.02)
