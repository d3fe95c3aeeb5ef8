"""Thrust curves by name or by file: those that come with the package, and anybody's table."""

from __future__ import annotations

from functools import lru_cache
from importlib import resources
from pathlib import Path

from wakewise.core.errors import InputError
from wakewise.robot.thrusters.thrust_curve import ThrustCurve
from wakewise.robot.thrusters.thrust_table import parse_thrust_table, read_thrust_table


def library_curve(name: str) -> ThrustCurve:
    """Read a thrust curve that comes with the package, such as `t200`.

    Raises
    ------
    InputError
        If there is none of that name; the message lists those there are.
    """
    if name not in curve_names():
        raise InputError(f"thrust curve {name!r}: not in the library, allowed {', '.join(curve_names())}")
    return _library_curve(name)


def curve_names() -> list[str]:
    """Names of the thrust curves that come with the package, sorted."""
    folder = resources.files("wakewise.robot.thrusters") / "data"
    return sorted(entry.name.removesuffix(".csv") for entry in folder.iterdir() if entry.name.endswith(".csv"))


def load_curve(name_or_path: str) -> ThrustCurve:
    """Read a thrust curve of the library by name, or any table by path (anything with a slash or .csv).

    Raises
    ------
    InputError
        If there is no such curve or file, or the table cannot be used.
    """
    if name_or_path in curve_names():
        return library_curve(name_or_path)
    path = Path(name_or_path)
    if path.suffix != ".csv" and path.name == name_or_path:
        names = ", ".join(curve_names())
        raise InputError(f"thrust curve {name_or_path!r}: not in the library, allowed {names} or the path of a .csv")
    return read_thrust_table(path)


@lru_cache(maxsize=8)
def _library_curve(name: str) -> ThrustCurve:
    text = (resources.files("wakewise.robot.thrusters") / "data" / f"{name}.csv").read_text("utf-8")
    return parse_thrust_table(text, f"{name}.csv", name)
