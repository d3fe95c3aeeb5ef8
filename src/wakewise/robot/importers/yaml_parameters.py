"""Vehicle parameters in the YAML of controllers: mass, inertia, buoyancy and hydrodynamic coefficients.

Hydrodynamics and buoyancy of Gazebo files as positive magnitudes: gz-sim's derivatives, UUV Simulator's blocks.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.constants import GRAVITY_M_S2
from wakewise.robot.importers.gazebo_thrusters import words
from wakewise.robot.importers.parsed_vehicle import ParsedVehicle, symmetrised
from wakewise.robot.importers.robot_description import PART_NAME, RobotDescription, inertia_matrix, short
from wakewise.robot.importers.safe_yaml_nodes import YamlNode
from wakewise.robot.importers.xml import Element, PlacedError, SourceLocation, number, numbers

_FORCES = "xyzkmn"
_SPEEDS = "UVWPQR"
_COEFFICIENTS = {
    "added": re.compile(r"([xyzkmn])Dot([UVWPQR])$"),
    "linear": re.compile(r"([xyzkmn])([UVWPQR])$"),
    "quadratic": re.compile(r"([xyzkmn])([UVWPQR])(?:abs)?([UVWPQR])$"),
}


def read_water(bodies: RobotDescription, found: ParsedVehicle) -> None:
    """Fill in added mass, damping and buoyancy from the plugins.

    Raises InputError if a block does not hold the right number of numbers.
    """
    for plugin in bodies.plugins:
        said = words(plugin)
        if "hydrodynamics" in said and plugin.first("link_name") is not None:
            if found.quadratic_damping is None and found.added_mass is None:
                _gz(plugin, found)
        elif "underwater_object" in said or "underwaterobject" in said:
            _uuv(plugin, bodies, found)
    _fluid_added_mass(bodies, found)


def magnitude(matrix: Array, what: str, found: ParsedVehicle, *, negative: str) -> Array | None:
    """Turn coefficients to positive magnitudes by the sign of their diagonal; None if it has both signs.

    `negative` says what a negative diagonal is called, for the note.
    """
    diagonal = np.diag(matrix)
    if np.all(diagonal >= 0.0):
        return matrix
    if np.all(diagonal <= 0.0):
        found.notes.append(f"{what}: the file states {negative}; the sign is turned")
        return -matrix + 0.0
    found.notes.append(f"{what}: diagonal {np.round(diagonal, 6).tolist()} has both signs, so it is not taken")
    return None


def _usable(matrix: Array | None, what: str, found: ParsedVehicle) -> Array | None:
    """A matrix whose symmetric part takes energy from the vehicle; else None and a note."""
    if matrix is None:
        return None
    lowest = float(np.linalg.eigvalsh(0.5 * (matrix + matrix.T))[0])
    if lowest < -1e-9 * max(1.0, float(np.abs(matrix).max())):
        found.notes.append(
            f"{what}: smallest eigenvalue {lowest:.4g} would give the vehicle energy, so it is not taken"
        )
        return None
    return matrix


def store(
    found: ParsedVehicle, *, added: Array | None = None, linear: Array | None = None, quadratic: Array | None = None
) -> None:
    """Check the three matrices of coefficients, whatever their sign, and keep the usable ones."""
    where = found.origin
    for name, matrix in (("added mass", added), ("linear damping", linear), ("quadratic damping", quadratic)):
        if matrix is not None and not np.any(matrix):
            found.notes.append(f"{name}: the file states zeros")
    if added is not None:
        turned = magnitude(added, "added mass", found, negative="negative derivatives")
        if turned is not None:
            found.added_mass = _usable(symmetrised(turned, found.notes), "added mass", found)
            found.derived["added_mass"] = where
    if linear is not None:
        turned = magnitude(linear, "linear damping", found, negative="negative coefficients")
        found.linear_damping = _usable(turned, "linear damping", found)
        found.derived["damping"] = where
    if quadratic is not None:
        turned = magnitude(quadratic, "quadratic damping", found, negative="negative coefficients")
        if turned is not None:
            coupled = turned - np.diag(np.diag(turned))
            if np.any(coupled != 0.0):
                found.notes.append(
                    f"quadratic damping: {np.count_nonzero(coupled)} coupled terms, largest "
                    f"{np.abs(coupled).max():.4g}, are left out, since they may feed energy to the vehicle"
                )
            found.quadratic_damping = np.diag(np.diag(turned))
            found.derived["damping"] = where


def _gz(plugin: Element, found: ParsedVehicle) -> None:
    matrices: dict[str, Array] = {}
    odd = []
    for element in plugin.children:
        for kind, pattern in _COEFFICIENTS.items():
            match = pattern.match(element.tag)
            if match is None:
                continue
            if kind == "quadratic" and match[2] != match[3]:
                odd.append(element.tag)
                break
            value = number(element.text.strip() or "0", element.place, element.tag)
            matrix = matrices.setdefault(kind, np.zeros((6, 6)))
            matrix[_FORCES.index(match[1]), _SPEEDS.index(match[2])] += value
            break
    if odd:
        found.notes.append(f"quadratic damping of two speeds is left out: {', '.join(odd[:8])}")
    store(found, **matrices)
    density = plugin.value("water_density")
    if density is not None:
        found.notes.append(f"water density of the file: {density} kg/m3")


def _fluid_added_mass(bodies: RobotDescription, found: ParsedVehicle) -> None:
    """Added mass that SDF 1.10 keeps in the inertial of a link."""
    holders = [link for link in bodies.links.values() if link.added_mass is not None and np.any(link.added_mass)]
    if not holders or (found.added_mass is not None and np.any(found.added_mass)):
        return
    heaviest = max(holders, key=lambda link: link.mass_kg or 0.0)
    store(found, added=heaviest.added_mass)
    found.notes.append(f"added mass: fluid_added_mass of link {heaviest.name}")


def _uuv(plugin: Element, bodies: RobotDescription, found: ParsedVehicle) -> None:
    blocks = plugin.all("link")
    if not blocks:
        return
    base = [b for b in blocks if short(b.name) == short(bodies.base)]
    block = (base or blocks)[0]
    if len(blocks) > 1:
        others = ", ".join(short(b.name) for b in blocks if b is not block)
        found.notes.append(
            f"hydrodynamics: those of link {short(block.attributes.get('name', ''))}; not of {others[:120]}"
        )
    _uuv_buoyancy(block, plugin, bodies, found)
    box = block.first("box")
    if box is not None:
        sides = [box.value(side) for side in ("length", "width", "height")]
        if all(sides):
            size = numbers(" ".join(side or "" for side in sides), box.place, "box", 3)
            if np.all(size > 0.0):
                found.size_m = size
                found.derived["body"] = f"{found.origin}: box of the underwater object plugin"
    model = block.first("hydrodynamic_model")
    if model is None:
        return
    kind = (model.value("type") or "").lower()
    if kind not in {"fossen", ""}:
        found.notes.append(f"hydrodynamics: model {kind!r} computes its coefficients in the simulator, none are stated")
    added, linear, quadratic = (_block(model, t) for t in ("added_mass", "linear_damping", "quadratic_damping"))
    store(found, added=added, linear=linear, quadratic=quadratic)
    forward = _block(model, "linear_damping_forward_speed")
    if forward is not None and np.any(forward):
        found.notes.append("linear damping that grows with forward speed is left out")


def _block(model: Element, tag: str) -> Array | None:
    values, element = model.numbers(tag), model.first(tag)
    return None if values is None or element is None else _six_by_six(values, element.place, tag)


def _six_by_six(values: Array, place: SourceLocation, what: str) -> Array:
    """A matrix from 36 numbers in rows, or from 6 as its diagonal."""
    if len(values) not in (6, 36):
        raise PlacedError(f"{place}: {what} has {len(values)} numbers, must have 6 or 36")
    return values.reshape(6, 6) if len(values) == 36 else np.diag(values)


def _positive(element: Element, tag: str) -> float | None:
    """Number in the first child with this tag, which must be more than 0; None if there is none."""
    value = element.number(tag)
    if value is not None and value <= 0.0:
        raise PlacedError(f"{(element.first(tag) or element).place}: {tag} is {value:g}, must be more than 0")
    return value


def _uuv_buoyancy(block: Element, plugin: Element, bodies: RobotDescription, found: ParsedVehicle) -> None:
    link = bodies.link(block.name)
    where = f"{found.origin}: underwater object plugin"
    volume_m3 = _positive(block, "volume")
    if volume_m3 is not None:
        found.displaced_volume_m3 = volume_m3
        found.derived["buoyancy"] = where
    neutral = (block.value("neutrally_buoyant") or "0").lower() in {"1", "true"}
    if neutral and link is not None and link.mass_kg and (density := _positive(plugin, "fluid_density")) is not None:
        found.displaced_volume_m3 = link.mass_kg / density
        found.notes.append("displaced volume: mass over density, since the file says the vehicle is neutral")
    point = block.numbers("center_of_buoyancy", 3)
    if point is not None:
        found.p_buoyancy_m = point if link is None else link.X_BL.apply(point)
        found.derived["buoyancy"] = where


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

    Raises InputError if a number is not one, a mass is not positive, or an inertia is not positive definite.
    """
    known = len(found.derived)
    entries = _of_the_vehicle(entries, found)
    where = found.origin
    mass = _number(entries, _MASS)
    if mass is not None:
        value, item = mass
        if value == 0.0 and find(entries, ("mass",)) is None:
            found.notes.append(f"mass: 0, so it is not stated ({item.place.short})")
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
    """Entries that concern the vehicle, outermost first, not of an arm or another part of it.

    Raises InputError if two masses stand at one depth that may both be the vehicle's.
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
    return _six_by_six(item.numbers(keys[0]), item.place, keys[0])


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
    found.derived["inertia"] = f"{found.origin}:{item.place.line}"


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
    found.derived["body"] = found.derived["inertia"] = f"{found.origin}:{item.place.line}"
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
