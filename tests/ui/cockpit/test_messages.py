"""What a page may say: read strictly, and never a fault of ours."""

from __future__ import annotations

import json
import random
from typing import Any

import numpy as np
import pytest

from wakewise.operation.teleop.input.controls import ACTIONS
from wakewise.ui.cockpit.messages import (
    PROPOSAL,
    ButtonPress,
    Hello,
    InvalidMessage,
    SettingsChange,
    StickMessage,
    TargetDesignation,
    TargetProposal,
    read_message,
)

GOOD: list[dict[str, Any]] = [
    {"type": "hello", "token": None, "name": "Ada", "wants": "helm"},
    {"type": "helm", "want": True, "force": False},
    {"type": "consent", "to": "c2", "yes": True},
    {"type": "sticks", "seq": 3, "t": 12.5, "axes": [0, 0.5, -1, 0, 0], "lease": "L"},
    {"type": "press", "what": "capture", "lease": "L"},
    {"type": "settings", "set": {"w_track": 2}, "lease": "L"},
    {"type": "seen", "frame": 7},
    {"type": "designate", "box": [0.1, 0, 1, 0.5], "frame": 7, "lease": "L"},
    {"type": "designate", "box": "clear", "lease": "L"},
    {"type": "proposal", "what": "refuse", "lease": "L"},
]
JUNK: list[Any] = [
    None, True, False, 0, -1, 1e308, -1e308, 10**400, -(10**400), 2**53 + 1, "", "x" * 5000, "\x00", "NaN", [], {},
    [[]], [1, 2], {"a": 1}, [None] * 5, ["1"] * 5, [True] * 5, [1e400] * 5, float("nan"), float("inf"), "\u202e\ud800",
]  # fmt: skip


@pytest.mark.parametrize("told", GOOD, ids=lambda told: told["type"])
def test_what_the_protocol_allows_is_read(told: dict[str, Any]) -> None:
    """Each kind of message becomes its own record."""
    assert not isinstance(read_message(json.dumps(told)), InvalidMessage)


@pytest.mark.parametrize(
    ("raw", "words"),
    [
        ("{", "not JSON"),
        ("[" * 100_000, "not JSON"),
        ("1" * 5000, "not JSON"),
        ("[]", "not an object"),
        ('{"type": "fly"}', "'fly', allowed hello"),
        ('{"type": ["hello"]}', "a list"),
        ('{"type": "hello", "wants": "all"}', "wants 'all', allowed helm, watch"),
        ('{"type": "hello", "token": 7}', "token must be a text"),
        ('{"type": "sticks", "seq": 1, "t": 0, "axes": [0, 0], "lease": "L"}', "axes must be 5 numbers"),
        ('{"type": "sticks", "seq": 1, "t": 0, "axes": [0, 0, "1", 0, 0], "lease": "L"}', "must be a number, not '1'"),
        ('{"type": "sticks", "seq": 1.5, "t": 0, "axes": [0, 0, 0, 0, 0], "lease": "L"}', "seq must be a whole"),
        ('{"type": "sticks", "seq": 1, "t": NaN, "axes": [0, 0, 0, 0, 0], "lease": "L"}', "t must be a time"),
        ('{"type": "press", "what": "surface", "lease": "L"}', "what 'surface', allowed capture"),
        ('{"type": "settings", "set": {"gain": [1]}, "lease": "L"}', "set.'gain' must be a number"),
        (
            '{"type": "designate", "frame": 7, "lease": "L"}',
            "top, right and bottom, or 'clear', not None",
        ),
        ('{"type": "designate", "box": "all", "frame": 7, "lease": "L"}', "not 'all'"),
        ('{"type": "designate", "box": [0, 0, 1], "frame": 7, "lease": "L"}', "not a list"),
        ('{"type": "designate", "box": [0, 0, "1", 1], "frame": 7, "lease": "L"}', "box must be a number, not '1'"),
        ('{"type": "designate", "box": [0, 0, NaN, 1], "frame": 7, "lease": "L"}', "must lie within 0 to 1"),
        ('{"type": "designate", "box": [0, 0, Infinity, 1], "frame": 7, "lease": "L"}', "must lie within 0 to 1"),
        ('{"type": "designate", "box": [-0.1, 0, 1, 1], "frame": 7, "lease": "L"}', "must lie within 0 to 1"),
        ('{"type": "designate", "box": [0.5, 0, 0.5, 1], "frame": 7, "lease": "L"}', "left before right"),
        ('{"type": "designate", "box": [0.5, 0, 0.505, 1], "frame": 7, "lease": "L"}', "sides of 0.01 at least"),
        ('{"type": "designate", "box": [0, 0, 1, 1], "lease": "L"}', "frame must be a whole number"),
        ('{"type": "designate", "box": [0, 0, 1, 1], "frame": 7}', "lease must be a text"),
        ('{"type": "proposal", "lease": "L"}', "what None, allowed ask, accept, refuse"),
        ('{"type": "proposal", "what": ["accept"], "lease": "L"}', "what a list, allowed ask"),
        ('{"type": "proposal", "what": "accept"}', "lease must be a text"),
        ('{"type": "seen", "frame": -1}', "frame must be a whole number from 0"),
    ],
)
def test_what_it_does_not_allow_is_told_in_one_line(raw: str, words: str) -> None:
    """The line names the kind, what was found and what would be right."""
    read = read_message(raw)
    assert isinstance(read, InvalidMessage)
    assert words in read.why
    assert "\n" not in read.why
    assert len(read.why) < 200


def test_axes_of_any_size_are_made_harmless() -> None:
    """Huge axes are full stick, what is no number is centred, as for any device."""
    raw = '{"type": "sticks", "seq": 1, "t": 0, "axes": [1e300, -9, NaN, Infinity, 0.01], "lease": "L"}'
    read = read_message(raw)
    assert isinstance(read, StickMessage)
    np.testing.assert_array_equal(read.axes, [1.0, -1.0, 0.0, 0.0, 0.0])
    huge = read_message(raw.replace("1e300", "1" + "0" * 400))
    assert isinstance(huge, StickMessage)
    assert float(np.abs(huge.axes).max()) <= 1.0


def test_binary_is_refused() -> None:
    """Only the server sends bytes."""
    assert isinstance(read_message(b"\x00\x01"), InvalidMessage)


def test_a_name_is_one_printable_line() -> None:
    """A name goes to every page, so it cannot break lines there."""
    read = read_message(json.dumps({"type": "hello", "name": "A\nd\x07a ", "wants": "watch"}))
    assert isinstance(read, Hello)
    assert read.name == "Ada"


def test_a_hundred_thousand_mangled_messages_raise_nothing() -> None:
    """Whatever comes is read or is amiss, and what is read holds to its types and ranges."""
    rng = random.Random(17)
    read_well = 0
    for _ in range(100_000):
        read = read_message(_mangled(rng))
        if isinstance(read, InvalidMessage):
            assert 0 < len(read.why) < 300
            continue
        read_well += 1
        if isinstance(read, StickMessage):
            assert np.all(np.abs(read.axes) <= 1.0)
            assert abs(read.t_ms) <= 2**53
        elif isinstance(read, ButtonPress):
            assert read.what in ACTIONS
        elif isinstance(read, SettingsChange):
            assert all(isinstance(value, str | float | bool) for value in read.changes.values())
        elif isinstance(read, TargetDesignation) and read.box is not None:
            left, top, right, bottom = read.box
            assert 0.0 <= left < right <= 1.0
            assert 0.0 <= top < bottom <= 1.0
        elif isinstance(read, TargetProposal):
            assert read.what in PROPOSAL
    assert read_well > 1000


def _mangled(rng: random.Random) -> str:
    """A message of the protocol with something wrong in it, in its values or in its text."""
    told = dict(rng.choice(GOOD))
    if rng.random() < 0.7:
        key = rng.choice(list(told))
        told[key] = rng.choice(JUNK)
    if rng.random() < 0.2:
        told.pop(rng.choice(list(told)))
    text = json.dumps(told)
    if rng.random() < 0.4:
        at = rng.randrange(len(text) + 1)
        text = (
            text[:at] + "".join(chr(rng.choice((34, 44, 91, 123, 0, 233, 48, 0x10FFFF))) for _ in range(3)) + text[at:]
        )
    return text[: rng.randrange(len(text) + 1)] if rng.random() < 0.1 else text
