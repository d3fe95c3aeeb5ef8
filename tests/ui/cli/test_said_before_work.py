"""What a command can say at once it says at once: no compiling, no folder, no flight before it."""

from pathlib import Path

import pytest
import yaml

from wakewise.experiments.campaigns.definition import Campaign, example
from wakewise.experiments.trials import trial as stages
from wakewise.ui.cli.main import run
from wakewise_benchmarks import command

Capsys = pytest.CaptureFixture[str]


@pytest.fixture(autouse=True)
def nothing_is_compiled(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Work of minutes is a failure here."""
    monkeypatch.setattr(stages, "is_warm", lambda *_: False)
    monkeypatch.setattr(stages, "compile_kernels", lambda *_: pytest.fail("kernels were compiled first"))
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize("words", [["--method", "nomod.mine:make"], ["--set", "control.wake.model=nomod.mine:make"]])
def test_a_name_that_leads_nowhere_leaves_no_folder(words: list[str], capsys: Capsys, tmp_path: Path) -> None:
    """Exit code 2, one line with the name, and nothing was made."""
    assert run(["scan", *words, "--out", "made"]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and "nomod.mine:make" in said
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("words", [["world", "show", "my.yaml"], ["scan", "--world", "my.yaml"]])
def test_a_file_given_for_a_world_is_told_where_it_goes(words: list[str], capsys: Capsys) -> None:
    """It is the scenario; the page of worlds says how draws are written."""
    assert run(words) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and "wakewise scan my.yaml" in said and "docs/worlds.md" in said


@pytest.mark.parametrize("methods", ["dp", "dp,dp", "", ","])
def test_a_comparison_is_of_two_methods(methods: str, capsys: Capsys, tmp_path: Path) -> None:
    """One alone is a scan, and that is said."""
    assert run(["compare", "--methods", methods]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and "two or more different names" in said
    assert ("wakewise scan --method dp" in said) == (methods == "dp")
    assert list(tmp_path.iterdir()) == []


def test_benches_are_listed_with_what_and_how_long(capsys: Capsys, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without a name nothing runs; each bench has a line, and the hours are told beforehand."""
    from wakewise_benchmarks.registry import BENCHES

    monkeypatch.setattr("wakewise_benchmarks.registry.run_bench", lambda *_: pytest.fail("a bench was run"))
    assert run(["bench"]) == 0
    lines = capsys.readouterr().out.splitlines()
    told = {line.split()[0]: line for line in lines if line.split() and line.split()[0] in BENCHES}
    assert set(told) == set(BENCHES) and "all" not in BENCHES
    assert all(("hours" in line.split()[1]) == (name in command._LASTS) for name, line in told.items())
    assert "wakewise bench all" in lines[-1]


def test_the_campaign_to_begin_with_has_fields_of_the_scenario() -> None:
    """Dotted and nested names both, beside variations, and the file is one."""
    told = yaml.safe_load(example())
    assert any("." in name for name in told["scenario"])
    assert any(isinstance(value, dict) for value in told["scenario"].values())
    assert Campaign.model_validate(told).scenario == told["scenario"]
