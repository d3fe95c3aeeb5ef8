"""Angles of other projects' files: radians where the format says so, and no guess that ends up in a vehicle."""

from __future__ import annotations

import math

import numpy as np

from wakewise.core.arrays import Array
from wakewise.robot.importers.xml import PlacedError, SourceLocation

TURN = 2.0 * math.pi + 0.01
"""Angles beyond this are not taken as radians, unless they are a few eighths of a turn."""
_FEW_TURNS = 8.0 * math.pi
_EIGHTH = math.pi / 4.0
_WHOLE = 1e-9


def require_radians(angles: Array, place: SourceLocation, what: str) -> Array:
    """Return angles of a format that states radians, shape (3,); refuse those that can only be degrees.

    Raises InputError if an angle is beyond a turn and is not a multiple of an eighth of a turn.
    """
    for angle in np.abs(angles):
        eighths = angle / _EIGHTH
        odd = angle > _FEW_TURNS or abs(eighths - round(eighths)) > 2e-3
        if angle > TURN and odd:
            raise PlacedError(
                f"{place}: {what} holds the angle {angle:g}, which is beyond a turn; this format's angles are in "
                f"radians (are these degrees?)"
            )
    return angles


def read_angles(rows: list[tuple[Array, SourceLocation]], what: str, key: str) -> tuple[list[Array], str]:
    """Angles in radians of a file whose format states no unit, and a note on how they were read ("" if none).

    All rows are of one unit, which the key may say (`..._deg`, `..._rad`). Else angles beyond a turn are degrees if all
    are whole or half degrees; whole numbers of radians are implausible, so they are refused.

    `rows`, shape (3,): roll, pitch and yaw of each thruster. `what`, `key`: for messages, and the key that the angles
    stand under. Raises InputError if the unit cannot be told.
    """
    unit = unit_of(key)
    if unit == "degrees":
        return [np.deg2rad(row) for row, _ in rows], f"angles: {key} says degrees"
    if unit == "radians":
        return [require_radians(row, place, what) for row, place in rows], ""
    values = np.concatenate([row for row, _ in rows]) if rows else np.zeros(0)
    largest = float(np.abs(values).max(initial=0.0))
    place = next((place for row, place in rows if np.abs(row).max() == largest), rows[0][1] if rows else None)
    if largest > TURN:
        halves = 2.0 * values
        if largest <= 360.0 and largest >= 10.0 and np.all(np.abs(halves - np.round(halves)) < 1e-6):
            return (
                [np.deg2rad(row) for row, _ in rows],
                f"angles: degrees (inferred: {largest:g} is beyond a turn in radians)",
            )
        raise PlacedError(
            f"{place}: {what} holds the angle {largest:g}: degrees or radians? call it rpy_deg or rpy_rad"
        )
    if largest > 0.0 and np.all(np.abs(values - np.round(values)) < _WHOLE):
        raise PlacedError(
            f"{place}: {what} holds whole numbers, up to {largest:g}: degrees, radians or a direction? "
            f"call it rpy_deg, rpy_rad or direction"
        )
    return [row for row, _ in rows], ""


def unit_of(key: str) -> str:
    """Unit that a key's name says: "degrees", "radians" or ""."""
    words = key.lower().replace("-", "_").split("_")
    if {"deg", "degs", "degree", "degrees"} & set(words):
        return "degrees"
    return "radians" if {"rad", "rads", "radian", "radians"} & set(words) else ""
