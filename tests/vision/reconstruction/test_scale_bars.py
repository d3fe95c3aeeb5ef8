"""What a user says of lengths, in words and in files."""

import pytest

from wakewise.core.errors import InputError
from wakewise.vision.reconstruction.scale import ScaleBar, ScaleBars, parse_bar, read_bars


def test_bars_are_read_from_words_and_files(tmp_path):
    """With and without an uncertainty; family, size and board from the file."""
    assert parse_bar("3, 7, 0.5, 0.0002") == ScaleBar(ends=(3, 7), length_m=0.5, sigma_m=0.0002)
    assert parse_bar("3,7,0.5").sigma_m == pytest.approx(0.0005)
    path = tmp_path / "bars.yaml"
    path.write_text(
        "bars:\n- {ends: [3, 7], length_m: 0.5, sigma_m: 0.0002}\n- {ends: [1, 2], length_m: 0.25}\n"
        "targets: aruco_4x4\ntag_m: 0.04\nboard: {columns: 9, rows: 6, square_m: 0.03, marker_m: 0.022}\n"
    )
    said = read_bars(path)
    assert said.wanted == (1, 2, 3, 7)
    assert (said.family, said.tag_m, said.board.columns) == ("aruco_4x4", 0.04, 9)


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ("3,7", "must be A,B,LENGTH"),
        ("a,7,0.5", "must be A,B,LENGTH"),
        ("3,3,0.5", "two different targets"),
        ("3,7,-0.5", "must be above 0"),
        ("3,7,nan", "must be above 0"),
        ("3,7,0.5,0", "must be above 0"),
        ("3,7,0.5,0.6", "less than the length"),
    ],
)
def test_bad_words_are_named(words, told):
    """Each in a line that says what would be right."""
    with pytest.raises(InputError, match=told):
        parse_bar(words)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("[1, 2]", "must hold bars"),
        ("bars: []", "none are given"),
        ("bars: [{ends: [1], length_m: 1}]", "bars.0.ends"),
        ("bars: [{ends: [1, 2], length: 1}]", "length"),
        ("bars: [{ends: [1, 2], length_m: 1}, {ends: [2, 1], length_m: 1}]", "given 2 times"),
        ("{bars: [{ends: [1, 2], length_m: 1}], targets: qr}", "'qr', allowed are"),
        ("{bars: [{ends: [1, 2], length_m: 1}], tag_m: -1}", "must be above 0"),
        ("{board: {columns: 1, rows: 6, square_m: 0.03, marker_m: 0.022}}", "1 x 6 squares"),
        ("bars: [", "cannot be read as YAML"),
    ],
)
def test_bad_files_are_named(tmp_path, text, told):
    """The file, what in it, and what would be right."""
    path = tmp_path / "bars.yaml"
    path.write_text(text)
    with pytest.raises(InputError, match=told) as fault:
        read_bars(path)
    assert str(path) in str(fault.value)
    assert isinstance(ScaleBars(bars=(parse_bar("1,2,3"),)).key(), list)
