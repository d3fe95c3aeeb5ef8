import pytest

from wakewise.ui.cli.main import run


def test_unknown_bench_is_refused_with_the_list(capsys: pytest.CaptureFixture[str]) -> None:
    """A bench that does not exist is refused in one line that names those that do."""
    assert run(["bench", "nothing"]) == 2
    said = capsys.readouterr().err
    assert "no such bench" in said
    assert "dynamics" in said


def test_every_bench_has_a_module_with_a_run() -> None:
    """A name that is listed can be run."""
    from importlib import import_module

    from wakewise_benchmarks.registry import BENCHES, module_of

    assert [name for name in BENCHES if not callable(getattr(import_module(module_of(name)), "run", None))] == []
