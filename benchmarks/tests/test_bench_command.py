import pytest

from wakewise.ui.cli.main import run


def test_unknown_bench_is_refused_with_the_list(capsys: pytest.CaptureFixture[str]) -> None:
    """A bench that does not exist is refused in one line that names those that do."""
    assert run(["bench", "nothing"]) == 2
    said = capsys.readouterr().err
    assert "no such bench" in said
    assert "dynamics" in said
