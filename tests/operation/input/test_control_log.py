"""A record of hands: written, read and played back as it was."""

import numpy as np
import polars as pl
import pytest

from wakewise.core.errors import InputError
from wakewise.operation.teleop.input.control_log import ControlLog, ControlLogWriter, read_trace
from wakewise.operation.teleop.input.controls import CONTROL_AXES, Controls


def hands(k):
    """Hands that move now and then, press, and go away."""
    if 40 <= k < 45:
        return None
    axes = np.round(np.sin(np.arange(5) + k // 7), 3)
    return Controls(axes=axes, pressed=("capture", "hold") if k == 23 else ("scan",) if k == 30 else ())


@pytest.mark.parametrize("ending", ["parquet", "csv"])
def test_what_was_written_is_played_back(tmp_path, ending):
    """The same axes, buttons, absences and settings at each step, and nobody after the end; twice the same."""
    writer = ControlLogWriter()
    all_settings = [{"mode": "hold", "gain": 0.5}, {"mode": "scan", "gain": 0.5}]
    for k in range(60):
        writer.take(0.02 * k, hands(k), all_settings[k >= 33])
    writer.write(tmp_path / f"controls.{ending}")
    trace = read_trace(tmp_path / f"controls.{ending}")
    for _ in range(2):
        for k in range(60):
            there, desired = trace.read(0.02 * k), hands(k)
            assert (there is None) == (desired is None)
            if there is not None and desired is not None:
                np.testing.assert_array_equal(there.axes, desired.axes)
                assert there.pressed == desired.pressed
            assert trace.settings_at(0.02 * k) == all_settings[k >= 33]
        assert trace.read(1.3) is None


def test_hands_at_rest_take_no_room():
    """An hour of centred sticks is two rows."""
    writer, still = ControlLogWriter(), Controls(axes=np.zeros(5))
    for k in range(180_000):
        writer.take(0.02 * k, still, {})
    assert writer.frame().height == 2


def test_a_record_by_hand_needs_no_desk():
    """Time and axes suffice."""
    frame = pl.DataFrame({"time_s": [0.0, 1.0], **{name: [0.0, 0.5] for name in CONTROL_AXES}})
    trace = ControlLog(frame)
    assert trace.read(0.5).centred and trace.settings_at(0.5) is None and trace.end_s == 1.0


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"time_s": [0.0, 0.0]}, "time_s must increase"),
        ({"time_s": [0.0, float("nan")]}, "time_s must increase"),
        ({"right": [0.0, 1.5]}, "row 2: axes:"),
        ({"right": ["a", "b"]}, "must be numbers"),
        ({"pressed": ["", "jump"]}, "row 2: pressed: 'jump'"),
        ({"settings": ["{", ""]}, "row 1: "),
        ({"settings": ["[1]", ""]}, "row 1: settings must be an object"),
    ],
)
def test_a_bad_row_is_named(change, words):
    """Which row, and what is wrong with it."""
    columns = {"time_s": [0.0, 1.0], **{name: [0.0, 0.0] for name in CONTROL_AXES}, **change}
    with pytest.raises(InputError, match=words):
        ControlLog(pl.DataFrame(columns, strict=False))


def test_a_file_that_is_no_table_is_named(tmp_path):
    """Missing, no table, or one without the columns."""
    with pytest.raises(InputError, match="cannot be read as a table"):
        read_trace(tmp_path / "none.parquet")
    (tmp_path / "other.csv").write_text("a,b\n1,2\n")
    with pytest.raises(InputError, match="no column time_s"):
        read_trace(tmp_path / "other.csv")
