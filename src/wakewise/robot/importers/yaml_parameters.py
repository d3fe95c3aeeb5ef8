"""Vehicle parameters in the YAML of controllers: mass, inertia, buoyancy and hydrodynamic coefficients."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.constants import GRAVITY_M_S2
from wakewise.robot.importers.parsed_vehicle import ParsedVehicle
from wakewise.robot.importers.robot_description import PART_NAME, inertia_matrix
from wakewise.robot.importers.safe_yaml_nodes import YamlNode
from wakewise.robot.importers.water import store
from wakewise.robot.importers.xml import PlacedError

_MASS = ("mass", "mass_kg")
Entries = list[tuple[tuple[str, ...], YamlNode]]
"""Every item of a file with the keys that lead to it."""


def find(entries: Entries, keys: Sequence[str], inside: str = "") -> YamlNode | None:
    """First item under one of the keys, in their order; `inside` names a key that must lead to it."""
    for key in keys:
        for path, item in entries:
            if path[-1] == key and (not inside or inside in path[:-1]):
                return item
    return None


def vector3(item: YamlNode, what: str) -> Array:
    """Three numbers, from a list or from a table of x, y, z (or roll, pitch, yaw)."""
    if item.table():
        keys = next((k for k in (("x", "y", "z"), ("roll", "pitch", "yaw")) if all(i in item.table() for i in k)), None)
        if keys is None:
            raise PlacedError(f"{item.place}: {what} must have x, y and z")
        return np.array([item.table()[key].scalar(f"{what} {key}") for key in keys])
    return item.numbers(what, 3)


def read_parameters(entries: Entries, found: ParsedVehicle) -> bool:
    """Fill in mass, inertia, buoyancy and coefficients under the names that controllers use; False if there are none.

    Raises
    ------
    InputError
        If a number is not one, a mass is not positive, or an inertia is not positive definite.
    """
    known = len(found.derived)
    entries = _of_the_vehicle(entries, found)
    where = f"{found.kind} {found.file.name}"
    mass = _number(entries, _MASS)
    if mass is not None:
        value, item = mass
        if value == 0.0 and find(entries, ("mass",)) is None:
            found.notes.append(f"mass: 0, so it is not stated ({item.place.file.name}:{item.place.line})")
        elif value <= 0.0:
            raise PlacedError(f"{item.place}: mass is {value:g}, must be more than 0")
        else:
            found.mass_kg = value
            found.derived["body"] = where
    _inertia(entries, found)
    for keys, attribute in (
        (("cog", "center_of_gravity", "center_of_mass", "centre_of_gravity"), "p_G_m"),
        (("cob", "center_of_buoyancy", "center_of_volume", "centre_of_buoyancy"), "p_buoyancy_m"),
    ):
        point = find(entries, keys)
        if point is not None:
            setattr(found, attribute, vector3(point, keys[0]))
            found.derived["buoyancy"] = where
    volume = _number(entries, ("volume", "displaced_volume", "displacement_m3", "volume_m3"))
    if volume is not None and volume[0] > 0.0:
        found.displaced_volume_m3 = volume[0]
        found.derived["buoyancy"] = where
    sides = [_number(entries, (side,)) for side in ("length", "width", "height")]
    if all(side is not None and side[0] > 0.0 for side in sides):
        found.size_m = np.array([side[0] for side in sides if side is not None])
    store(
        found,
        added=_six(entries, ("Ma", "added_mass", "added_mass_matrix")),
        linear=_six(entries, ("linear_damping", "linear_damping_matrix", "D_linear")),
        quadratic=_six(entries, ("quad_damping", "quadratic_damping", "nonlinear_damping", "D_quadratic")),
    )
    _weights(entries, found)
    return len(found.derived) > known


def _of_the_vehicle(entries: Entries, found: ParsedVehicle) -> Entries:
    """Entries that speak of the vehicle, outermost first, not of an arm or another part of it.

    Raises
    ------
    InputError
        If two masses stand at one depth that may both be the vehicle's.
    """
    whole = [(path, item) for path, item in entries if not any(PART_NAME.search(key) for key in path[:-1])]
    masses = [(path, item) for path, item in whole if path[-1] in _MASS and isinstance(item.value, str)]
    parts = [path for path, item in entries if path[-1] in _MASS and any(PART_NAME.search(key) for key in path[:-1])]
    if parts:
        said = ", ".join(dict.fromkeys("/".join(path[:-1]) for path in parts[:6]))
        found.notes.append(f"mass: that of {said} is of a part and is not taken for the vehicle's")
    least = min((len(path) for path, _ in masses), default=0)
    at_least = [(path, item) for path, item in masses if len(path) == least]
    values = {item.scalar("mass") for _, item in at_least}
    if len(values) > 1:
        said = " and ".join("/".join(path) for path, _ in at_least[:4])
        raise PlacedError(
            f"{at_least[1][1].place}: {said} state different masses: which is the vehicle's cannot be told"
        )
    if not at_least:
        return whole
    # What stands beside the mass is of the same body, and comes before what stands elsewhere.
    home = at_least[0][0][:-1]
    return sorted(whole, key=lambda entry: entry[0][: len(home)] != home)


def _number(entries: Entries, keys: Sequence[str]) -> tuple[float, YamlNode] | None:
    item = find(entries, keys)
    return None if item is None or not isinstance(item.value, str) else (item.scalar(keys[0]), item)


def _six(entries: Entries, keys: Sequence[str]) -> Array | None:
    item = find(entries, keys)
    if item is None or not item.items():
        return None
    values = item.numbers(keys[0])
    if len(values) == 36:
        return values.reshape(6, 6)
    if len(values) == 6:
        return np.diag(values)
    raise PlacedError(f"{item.place}: {keys[0]} has {len(values)} numbers, must have 6 or 36")


def _inertia(entries: Entries, found: ParsedVehicle) -> None:
    table = find(entries, ("inertial", "inertia"))
    moments = find(entries, ("moments_of_inertia", "inertia_diagonal"))
    whole = find(entries, ("mass_matrix", "mass_inertia_matrix"))
    if table is not None and all(key in table.table() for key in ("ixx", "iyy", "izz")):
        found.inertia_kg_m2 = inertia_matrix({key: entry.scalar(key) for key, entry in table.table().items()})
        item = table
    elif moments is not None and len(moments.items()) == 3:
        found.inertia_kg_m2, item = np.diag(moments.numbers("moments_of_inertia", 3)), moments
    elif whole is not None and len(whole.numbers("mass_matrix")) == 36:
        _from_mass_matrix(whole, found)
        return
    else:
        return
    _require_definite(found.inertia_kg_m2, item)
    found.derived["inertia"] = f"{found.kind} {found.file.name}:{item.place.line}"


def _require_definite(inertia: Array, item: YamlNode) -> None:
    lowest = float(np.linalg.eigvalsh(0.5 * (inertia + inertia.T))[0])
    if lowest <= 0.0:
        raise PlacedError(f"{item.place}: inertia has smallest eigenvalue {lowest:g}, must be positive definite")


def _from_mass_matrix(item: YamlNode, found: ParsedVehicle) -> None:
    """Mass and inertia from a rigid body's 6 x 6 matrix; its coupling blocks must be m S(r_g)."""
    matrix = item.numbers("mass_matrix", 36).reshape(6, 6)
    mass = float(matrix[0, 0])
    if mass <= 0.0 or not np.allclose(matrix[:3, :3], mass * np.eye(3)):
        found.notes.append("mass matrix: its first block is not mass times identity, so it is not taken")
        return
    inertia = matrix[3:, 3:]
    _require_definite(inertia, item)
    found.mass_kg = mass
    found.derived["body"] = found.derived["inertia"] = f"{found.kind} {found.file.name}:{item.place.line}"
    coupling = matrix[3:, :3] / mass
    skewness = float(np.abs(coupling + coupling.T).max())
    # m S(r): the moment about the origin of a force at the centre of gravity (Fossen 2021, eq. 3.42).
    offset = np.array([coupling[2, 1], coupling[0, 2], coupling[1, 0]])
    if skewness > 1e-9:
        found.inertia_kg_m2 = 0.5 * (inertia + inertia.T)
        found.notes.append(
            "mass matrix: the coupling blocks are not antisymmetric, as m S(r_g) must be; they are not used, and "
            "its inertia is taken as about the centre of gravity"
        )
        return
    found.inertia_kg_m2 = 0.5 * (inertia + inertia.T)
    if np.any(np.abs(offset) > 1e-9):
        shifted = found.inertia_kg_m2 - mass * (float(offset @ offset) * np.eye(3) - np.outer(offset, offset))
        _require_definite(shifted, item)
        found.inertia_kg_m2 = shifted
        found.notes.append(f"mass matrix: states the centre of gravity at {np.round(offset, 6).tolist()} m")


def _weights(entries: Entries, found: ParsedVehicle) -> None:
    """Weight and buoyancy are said, not used: newton or kilogram and the density are left to guess."""
    weight, buoyancy = _number(entries, ("weight",)), _number(entries, ("buoyancy",))
    if weight is not None and found.mass_kg is not None:
        expected = found.mass_kg * GRAVITY_M_S2
        if abs(weight[0] - expected) > 0.02 * expected and abs(weight[0] - found.mass_kg) > 0.02 * found.mass_kg:
            found.notes.append(
                f"weight {weight[0]:g} does not fit mass {found.mass_kg:g} kg ({expected:.4g} N); the mass is taken"
            )
    if buoyancy is not None and found.displaced_volume_m3 is None:
        found.notes.append(f"buoyancy {buoyancy[0]:g} is stated without a density, so the displaced volume stays open")
