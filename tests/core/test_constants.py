"""Gravity and the density of water are written once."""

import io
import tokenize
from pathlib import Path

import wakewise

SOURCE = Path(wakewise.__file__).parent


def test_constants_of_physics_are_written_in_one_place_only() -> None:
    """No other file holds a number that is gravity or the density of fresh water; words in texts may."""
    numbers = ("9.8", "9.80", "9.81", "9.80665", "998", "998.0")
    found = []
    for path in SOURCE.rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        if not any(number in text for number in numbers):
            continue
        tokens = tokenize.generate_tokens(io.StringIO(text).readline)
        found += [f"{path.relative_to(SOURCE)}: {token.string}" for token in tokens if token.string in numbers]
    assert sorted(found) == ["core/constants.py: 9.80665", "core/constants.py: 998.0"]
