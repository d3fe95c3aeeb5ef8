"""`import wakewise`: what a researcher needs, nothing else, each name with an example that runs."""

import doctest
import inspect
import subprocess
import sys

import pytest

import wakewise as ww

RUN = [name for name in ww.__all__ if name not in ("Pose", "BodyState", "Goal", "Command")]


def test_about_fifteen_names_and_all_of_them_are_there():
    """Every name of the page can be had, and a wrong one is an AttributeError as of any module."""
    assert 12 <= len(ww.__all__) <= 20
    for name in ww.__all__:
        assert getattr(ww, name) is not None and name in dir(ww)
    with pytest.raises(AttributeError, match="nothing"):
        _ = ww.nothing


def test_completion_shows_the_names_and_nothing_else():
    """`ww.<Tab>`: what is exported; no helper of the page, no module that it imported."""
    assert [name for name in dir(ww) if not name.startswith("__")] == sorted(ww.__all__)


def test_importing_it_imports_no_package():
    """`import wakewise` pulls in neither arrays nor compilers: packages are imported when asked for."""
    heavy = "numpy, numba, scipy, polars, pydantic, cv2, pycolmap, matplotlib"
    code = f"import sys, wakewise; print([m for m in '{heavy}'.split(', ') if m in sys.modules])"
    assert subprocess.check_output([sys.executable, "-c", code], text=True).strip() == "[]"


@pytest.mark.slow
@pytest.mark.parametrize("name", RUN)
def test_every_name_ends_with_an_example_that_runs(name, tmp_path, monkeypatch):
    """The docstring's last section is an example; what it prints is what it says."""
    monkeypatch.chdir(tmp_path)
    thing = getattr(ww, name)
    text = inspect.getdoc(thing) or ""
    target = thing.preset if name == "Scenario" else thing
    text = inspect.getdoc(target) or ""
    assert "Examples" in text, name
    assert text.rfind("Examples") > text.rfind("Raises"), f"{name}: the example is not the end"
    finder = doctest.DocTestFinder(recurse=False)
    examples = [e for found in finder.find(target, name, globs={}) for e in found.examples]
    assert examples, name
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS)
    for found in finder.find(target, name, globs={}):
        runner.run(found)
    assert runner.failures == 0
