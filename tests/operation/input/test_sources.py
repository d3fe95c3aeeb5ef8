"""Hands from a file."""

from pathlib import Path

import pytest

from wakewise.core.errors import InputError
from wakewise.operation.teleop.input.control_log import ControlLog
from wakewise.operation.teleop.input.script import ScriptedInput, read_input


def test_the_ending_says_how_a_file_is_read(tmp_path):
    """YAML is a script, a table the record of a flight; anything else is refused with what would do."""
    (tmp_path / "sticks.yml").write_text("- {at_s: 0, right: 1}")
    (tmp_path / "sticks.csv").write_text("time_s,forward,right,down,turn,tilt\n0,0,1,0,0,0\n")
    assert isinstance(read_input(tmp_path / "sticks.yml"), ScriptedInput)
    assert isinstance(read_input(tmp_path / "sticks.csv"), ControlLog)
    with pytest.raises(InputError, match=r"\.yaml, \.yml, \.parquet, \.csv"):
        read_input(Path("sticks.txt"))
