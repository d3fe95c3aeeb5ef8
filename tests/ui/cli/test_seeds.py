"""A seed on the command line is a whole number from 0 to 2^63 - 1; any other is refused in one line."""

from typing import Any

import pytest
import typer

from wakewise.ui.cli.main import app, run

CASES = [
    ["scan"],
    ["compare"],
    ["cockpit"],
    ["target", "show", "brain"],
    ["world", "show", "tank"],
    ["wake", "fit", "none.csv", "--out", "x.yaml"],
]


@pytest.mark.parametrize("seed", ["-1", str(2**63), str(2**200)])
@pytest.mark.parametrize("words", CASES, ids=" ".join)
def test_a_seed_out_of_range_is_refused(words: list[str], seed: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run([*words, "--seed", seed]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert f"--seed: {seed[:20]}" in said
    assert "0 to 9223372036854775807" in said


def test_every_seed_of_a_command_is_checked() -> None:
    """Each option called --seed has the check."""

    def options(command: Any) -> list[Any]:
        inner = getattr(command, "commands", {})
        own = [p for p in getattr(command, "params", []) if "--seed" in p.opts]
        return own + [option for child in inner.values() for option in options(child)]

    found = options(typer.main.get_command(app))
    assert len(found) > 5
    assert all(option.callback is not None for option in found)
