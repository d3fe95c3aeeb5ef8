"""Hands by a script."""

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.operation.teleop.input.script import load_script, script_of

TEXT = """
- {at_s: 1, right: 0.6, tilt: -1}
- {at_s: 2, pressed: [capture, scan]}
- {at_s: 3, gone: true}
- {at_s: 4, forward: 0.5}
"""


def test_an_entry_holds_until_the_next_and_presses_once(tmp_path):
    """Centred before the first; what is pressed is pressed once, however seldom the hands are read."""
    (tmp_path / "sticks.yaml").write_text(TEXT)
    script = load_script(tmp_path / "sticks.yaml")
    for _ in range(2):  # from the beginning again
        assert script.read(0.0).centred
        np.testing.assert_array_equal(script.read(1.98).axes, [0.0, 0.6, 0.0, 0.0, -1.0])
        assert script.read(2.4).pressed == ("capture", "scan") and script.read(2.42).pressed == ()
        assert script.read(3.0) is None
        assert script.read(50.0).axes[0] == 0.5


def test_what_was_pressed_between_two_reads_is_not_lost():
    """Entries that nobody read in time still press."""
    script = script_of([{"at_s": 0.1, "pressed": ["operator"]}, {"at_s": 0.11, "pressed": ["precise"]}, {"at_s": 0.12}])
    assert script.read(0.2).pressed == ("operator", "precise")


@pytest.mark.parametrize(
    ("entries", "words"),
    [
        ([], "must be a list of entries"),
        ({"at_s": 1}, "must be a list of entries"),
        ([{"right": 1.0}], "entry 1: must be a mapping with at_s"),
        ([{"at_s": 0}, {"at_s": 0}], "entry 2 at 0 s, must be later than 0 s"),
        ([{"at_s": -1}], "at_s -1, must be 0 or more"),
        ([{"at_s": "1"}], "at_s: '1', must be a finite number"),
        ([{"at_s": 0, "left": 1}], "'left' is unknown, allowed are at_s, forward"),
        ([{"at_s": 0, "right": 2}], "entry 1: axes: .* must be numbers from -1 to 1"),
        ([{"at_s": 0, "right": float("nan")}], "right: nan"),
        ([{"at_s": 0, "pressed": ["jump"]}], "'jump' is not one of"),
        ([{"at_s": 0, "pressed": "stop"}], "pressed 'stop', must be a list"),
        ([{"at_s": 0, "gone": "yes"}], "gone 'yes', must be true or false"),
    ],
)
def test_a_bad_entry_is_named(entries, words):
    """Which entry, what was found, what is allowed."""
    with pytest.raises(InputError, match=words):
        script_of(entries)


def test_a_file_that_is_none_is_named(tmp_path):
    """Missing, or no YAML."""
    with pytest.raises(InputError, match=r"none\.yaml: cannot be read"):
        load_script(tmp_path / "none.yaml")
    (tmp_path / "bad.yaml").write_text("- {at_s: 1")
    with pytest.raises(InputError, match=r"bad\.yaml: cannot be read as YAML"):
        load_script(tmp_path / "bad.yaml")
