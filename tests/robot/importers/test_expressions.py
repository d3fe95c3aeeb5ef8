"""Slices of lists and words are read as Python reads them; filters are refused in one line."""

from typing import Any

import pytest

from wakewise.core.errors import InputError
from wakewise.robot.importers.expressions import evaluate

NAMES: dict[str, Any] = {"p": [1, 2, 3, 4], "w": "thruster_12", "at": "0.1 0.2 0.3 0 0 1", "n": 2}


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("p[1:3]", [2, 3]),
        ("p[:n]", [1, 2]),
        ("p[-1:][0]", 4),
        ("p[::2]", [1, 3]),
        ("p[::-1]", [4, 3, 2, 1]),
        ("w[-2:]", "12"),
        ("w[:8] + '_'", "thruster_"),
        ("int(w[-2:]) + 1", 13),
        ("' '.join(at.split()[0:3])", "0.1 0.2 0.3"),
        ("dict(x=1, y=2)['y']", 2),
    ],
)
def test_slices_are_read(text: str, value: object) -> None:
    assert evaluate(text, NAMES.__getitem__) == value


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("[x for x in p if x > 1]", "for ... in ...] is not part of the expressions"),
        ("sum(x for x in p)", "for ... in ...] is not part of the expressions"),
        ("w|float", "BitOr is not part of the expressions"),
        ("p[0.5:]", "bounds of a slice must be whole numbers"),
        ("p['a':]", "bounds of a slice must be whole numbers"),
        ("p[::0]", "cannot evaluate"),
        ("n[0:1]", "only lists and words can be sliced"),
        ("' '.join(p)", "is for words only"),
        ("dict(**p)", "is not part of the expressions"),
    ],
)
def test_filters_and_odd_slices_are_refused(text: str, match: str) -> None:
    with pytest.raises(InputError, match=match):
        evaluate(text, NAMES.__getitem__)
