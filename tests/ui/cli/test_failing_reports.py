"""A report that fails costs neither the result nor the exit code, whichever command writes it."""

from __future__ import annotations

import ast
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest

from wakewise import api
from wakewise.core.errors import InputError
from wakewise.experiments.trials.stages import report_attempt
from wakewise.ui.cli.main import run

CLI = Path(__file__).parents[3] / "src" / "wakewise" / "ui" / "cli"
# What the command is asked for is the page itself, so that without it there is no result.
PAGE_IS_THE_RESULT = {
    ("campaign", "write_campaign"),
    ("target", "write_target"),
    ("vehicle", "drawing_svg"),
    ("vehicle", "vehicle_page"),
    ("vehicle_thruster", "curve_svg"),
}
NOT_WRITING = {"compared_trials"}


def _unguarded(path: Path) -> set[tuple[str, str]]:
    """Functions of the reports that a command calls outside of `write_page`."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    names = {
        alias.asname or alias.name
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("wakewise.ui.reports")
        for alias in node.names
    }
    guarded = {
        id(inner)
        for node in ast.walk(tree)
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "write_page"
        for inner in ast.walk(node)
    }
    helpers = {  # functions that are called under guard alone
        node.func.id for node in ast.walk(tree)
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and id(node) in guarded
    }  # fmt: skip
    inside = {
        id(inner)
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef) and node.name in helpers
        for inner in ast.walk(node)
    }
    return {
        (path.stem, node.func.id)
        for node in ast.walk(tree)
        if isinstance(node, ast.Call)
        and isinstance(node.func, ast.Name)
        and node.func.id in names - NOT_WRITING
        and id(node) not in guarded | inside
    }


def test_every_command_writes_its_report_under_guard():
    """But for those whose result the page is."""
    found = set().union(*(_unguarded(path) for path in CLI.glob("*.py")))
    assert found == PAGE_IS_THE_RESULT


NOTHING: Any = None


def test_a_fault_is_told_in_a_line_with_its_place():
    """A fault of the program with kind and line, one that is foreseen with its words; Ctrl-C goes through."""
    with report_attempt() as attempt:
        float(NOTHING)
    assert attempt.fault is not None and "\n" not in attempt.fault
    assert attempt.fault.startswith("TypeError: float()") and "(test_failing_reports.py:" in attempt.fault
    with report_attempt() as attempt:
        raise InputError("model: holds no model")
    assert attempt.fault == "model: holds no model"
    with report_attempt() as attempt:
        pass
    assert attempt.fault is None
    with pytest.raises(RuntimeError), report_attempt():
        raise RuntimeError("a library's") from KeyboardInterrupt()
    with pytest.raises(KeyboardInterrupt), report_attempt():
        raise KeyboardInterrupt


def broken(*_: object, **__: object) -> None:
    float(NOTHING)


@pytest.fixture
def flown(monkeypatch):
    """Trials that take no time, and reports that fail, early parts of them too."""

    def fly(*given: object) -> dict[str, object]:
        begin = given[4] if len(given) > 4 else None
        if callable(begin):
            begin("mesh")
        return {"rmse_mm": 1.0}

    monkeypatch.setattr("wakewise.experiments.trials.run_trial", fly)
    monkeypatch.setattr("wakewise.experiments.trials.compare_methods", lambda flights, *_: {"methods": list(flights)})
    for name in ("begin_report", "write_report", "write_comparison"):
        monkeypatch.setattr(f"wakewise.ui.reports.{name}", broken)


def test_a_trial_and_a_comparison_keep_their_figures(flown, tmp_path):
    """The report is None, and what failed is said."""
    one = api.trial(SimpleNamespace(), tmp_path)
    assert one.figures == {"rmse_mm": 1.0} and one.report is None and "TypeError" in (one.report_fault or "")
    two = api.compare({"dp": SimpleNamespace(), "ours": SimpleNamespace()}, tmp_path)
    assert two.figures["methods"] and two.report is None and "TypeError" in (two.report_fault or "")


def test_the_command_says_so_and_ends_well(flown, tmp_path, capsys, monkeypatch):
    """Figures on standard output, what failed on standard error, exit code 0; no page is named that is not there."""
    monkeypatch.chdir(tmp_path)
    assert run(["scan", "--out", "s", "--json"]) == 0
    told = capsys.readouterr()
    assert "wakewise: report could not be written: TypeError: float()" in told.err
    assert "report:" not in told.out


def test_a_look_at_photographs_keeps_its_words(tmp_path, capsys, monkeypatch):
    """look.json and the advice are there without the page."""
    photos = tmp_path / "photos"
    photos.mkdir()
    noise = np.random.default_rng(0).integers(0, 255, (120, 160, 3), dtype=np.uint8)
    for k in range(3):
        cv2.imwrite(str(photos / f"{k}.png"), cv2.GaussianBlur(np.roll(noise, 9 * k, axis=1), (0, 0), 1.0))
    monkeypatch.setattr("wakewise.ui.reports.photo_preview.look_page", broken)
    assert run(["reconstruct", str(photos), "--look", "--out", str(tmp_path / "out")]) == 0
    told = capsys.readouterr()
    assert "report could not be written: TypeError" in told.err
    assert "3 photos" in told.out and "page:" not in told.out
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["look.json"]
