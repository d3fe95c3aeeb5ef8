"""Keys of a YAML file that no reader took: named, and questioned where they may change what was read."""

from __future__ import annotations

import re

from wakewise.robot.importers.parsed_vehicle import QUESTION
from wakewise.robot.importers.safe_yaml_nodes import YamlNode
from wakewise.robot.importers.thruster_lists import LOOKS_LIKE_THRUSTERS

_TURNING = re.compile(
    r"flip|revers|invert|negat|mirror|backward|multipl|(^|_)signs?(_|$)|polarity|spin|(^|_)directions?$"
    r"|(^|_)(left_|right_)?hand(ed|edness)?(_|$)|(^|_)c?cw(_|$)|clockwise",
    re.IGNORECASE,
)
_SWITCH = re.compile(r"(^|_)(active|enabled?)(_|$)", re.IGNORECASE)
_OFF = re.compile(r"(^|_)(inactive|disabled?)(_|$)", re.IGNORECASE)
_LOWER = re.compile(r"min|lower", re.IGNORECASE)
"""Keys of lower ends, which are negative in any thruster."""
_NO = frozenset({"false", "no", "off", "0", "0.0", ""})
_HANDS = frozenset({"cw", "ccw", "clockwise", "counterclockwise", "counter_clockwise", "left", "reverse", "reversed"})
_NEGATIVE = re.compile(r"-\s*(\d+\.?\d*|\.\d+)(e[-+]?\d+)?")
_ODD_UNITS = re.compile(
    r"[cm]m|in|inch(es)?|ft|feet|foot|(centi|milli)(meter|metre)s?|k?gf|lb[sf]?|pounds?|g|grams?|percent|%|deg(ree)?s?"
)
_SI_UNITS = re.compile(r"m|meters?|metres?|kg|n|newtons?|n\*?m|rad(ian)?s?|s|si")
_ASKED = 6


def title(path: tuple[str, ...]) -> str:
    """Keys that lead to a value, joined by dots."""
    return ".".join(key for key in path if key)[:80]


def words_in(text: str) -> frozenset[str]:
    """Words of a name in snake case or camel case, in lower case."""
    return frozenset(word.lower() for word in re.findall(r"[A-Z]?[a-z]+|[A-Z]+", text))


def list_unused_keys(root: YamlNode) -> list[str]:
    """Keys that no reader took, each once; those that may turn or stop a thrust, or name a unit, are questioned."""
    parents = {path[:-1] for path, item in root.walk() if item.seen or any(below.seen for _, below in item.walk_all())}
    plain: dict[str, list[tuple[str, ...]]] = {}
    doubts: dict[tuple[str, str], list[tuple[str, ...]]] = {}
    for path, item in root.unread():
        inner = [(at, _doubt(at, one, parents)) for at, one in [(path, item), *item.walk(path)]]
        for at, why in inner:
            if why:
                doubts.setdefault((at[-1], why), []).append(at)
        if not inner[0][1]:
            plain.setdefault(path[-1], []).append(path)
    for (key, _), places in doubts.items():
        places.extend(plain.pop(key, []))
    asked = [f"{QUESTION}not read: {_said(key, places)}, which {why}" for (key, why), places in doubts.items()]
    notes = asked[:_ASKED]
    if len(asked) > _ASKED:
        rest = ", ".join(key[:60] for key, _ in list(doubts)[_ASKED:])
        notes.append(f"{QUESTION}not read: {rest[:200]}, of the same kind")
    if plain:
        more = f" and {len(plain) - 20} more" if len(plain) > 20 else ""
        notes.append(f"not read: {', '.join([_said(*entry) for entry in plain.items()][:20])}{more}")
    return notes


def _said(key: str, places: list[tuple[str, ...]]) -> str:
    return title(places[0]) if len(places) == 1 else f"{key[:60]} ({len(places)} times)"


def _doubt(path: tuple[str, ...], item: YamlNode, parents: set[tuple[str, ...]]) -> str:
    """What an unread key may mean for what was read; "" if nothing."""
    key, texts = path[-1], [item.value, *(below.value for _, below in item.walk_all())]
    values = [text.strip().lower() for text in texts if isinstance(text, str)]
    if not item.table() and any(_ODD_UNITS.fullmatch(value) for value in values):
        return "names a unit that is not taken"
    if words_in(key) & {"unit", "units"} and not all(_SI_UNITS.fullmatch(value) for value in values):
        return "names a unit that is not taken"
    among = any(LOOKS_LIKE_THRUSTERS.search(part) for part in path[:-1])
    if not (among or LOOKS_LIKE_THRUSTERS.search(key) or path[:-1] in parents):
        return ""
    if _SWITCH.search(key):
        return "may switch a thrust off" if any(value in _NO for value in values) else ""
    if _OFF.search(key):
        return "may switch a thrust off" if any(value not in _NO for value in values) else ""
    # In a list 0 may be the number of a thruster, by itself it says no.
    neutral = _NO if isinstance(item.value, str) else _NO - {"0"}
    if re.search("multipl", key, re.IGNORECASE):
        neutral |= {"1", "1.0", "+1"}
    if _TURNING.search(key) and any(value not in neutral for value in values):
        return "may turn the thrust round"
    alone = among and isinstance(item.value, str) and not _LOWER.search(key)
    return "may turn the thrust round" if alone and (values[0] in _HANDS or _NEGATIVE.fullmatch(values[0])) else ""
