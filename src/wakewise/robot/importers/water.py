"""Hydrodynamics and buoyancy of Gazebo files as positive magnitudes: gz-sim's derivatives, UUV Simulator's blocks."""

from __future__ import annotations

import re

import numpy as np

from wakewise.core.arrays import Array
from wakewise.robot.importers.gazebo_thruster_models import short, words
from wakewise.robot.importers.parsed_vehicle import ParsedVehicle, symmetrised
from wakewise.robot.importers.robot_description import RobotDescription
from wakewise.robot.importers.xml import Element, PlacedError, number, numbers

_FORCES = "xyzkmn"
_SPEEDS = "UVWPQR"
_ADDED = re.compile(r"([xyzkmn])Dot([UVWPQR])$")
_LINEAR = re.compile(r"([xyzkmn])([UVWPQR])$")
_QUADRATIC = re.compile(r"([xyzkmn])([UVWPQR])(?:abs)?([UVWPQR])$")


def read_water(bodies: RobotDescription, found: ParsedVehicle) -> None:
    """Fill in added mass, damping and buoyancy from the plugins.

    Raises
    ------
    InputError
        If a block does not hold the right number of numbers.
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
    where = f"{found.kind} {found.file.name}"
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
    added, linear, quadratic = np.zeros((6, 6)), np.zeros((6, 6)), np.zeros((6, 6))
    seen: set[str] = set()
    odd = []
    for element in plugin.children:
        tag = element.tag
        if match := _ADDED.match(tag):
            matrix, column = added, match[2]
        elif match := _LINEAR.match(tag):
            matrix, column = linear, match[2]
        elif match := _QUADRATIC.match(tag):
            if match[2] != match[3]:
                odd.append(tag)
                continue
            matrix, column = quadratic, match[2]
        else:
            continue
        value = number(element.text.strip() or "0", element.place, tag)
        i, j = _FORCES.index(match[1]), _SPEEDS.index(column)
        matrix[i, j] += value
        seen.add("added" if matrix is added else "linear" if matrix is linear else "quadratic")
    if odd:
        found.notes.append(f"quadratic damping of two speeds is left out: {', '.join(odd[:8])}")
    store(
        found,
        added=added if "added" in seen else None,
        linear=linear if "linear" in seen else None,
        quadratic=quadratic if "quadratic" in seen else None,
    )
    density = plugin.value("water_density")
    if density is not None:
        found.notes.append(f"water density of the file: {density} kg/m3")


def _fluid_added_mass(bodies: RobotDescription, found: ParsedVehicle) -> None:
    """Added mass that SDF 1.10 keeps in the inertial of a link."""
    holders = [link for link in bodies.links.values() if link.added_mass is not None and np.any(link.added_mass)]
    if not holders or (found.added_mass is not None and np.any(found.added_mass)):
        return
    heaviest = max(holders, key=lambda link: link.mass_kg or 0.0)
    if heaviest.added_mass is None:
        return
    store(found, added=heaviest.added_mass)
    found.notes.append(f"added mass: fluid_added_mass of link {heaviest.name}")


def _uuv(plugin: Element, bodies: RobotDescription, found: ParsedVehicle) -> None:
    blocks = plugin.all("link")
    if not blocks:
        return
    base = [b for b in blocks if short(b.attributes.get("name", "")) == short(bodies.base)]
    block = (base or blocks)[0]
    if len(blocks) > 1:
        others = ", ".join(short(b.attributes.get("name", "")) for b in blocks if b is not block)
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
                found.derived["body"] = f"{found.kind} {found.file.name}: box of the underwater object plugin"
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
    """A 6 x 6 matrix from 36 numbers in rows, or from 6 as its diagonal."""
    element = model.first(tag)
    if element is None or not element.text.strip():
        return None
    values = numbers(element.text, element.place, tag)
    if len(values) == 36:
        return values.reshape(6, 6)
    if len(values) == 6:
        return np.diag(values)
    raise PlacedError(f"{element.place}: {tag} has {len(values)} numbers, must have 6 or 36")


def _uuv_buoyancy(block: Element, plugin: Element, bodies: RobotDescription, found: ParsedVehicle) -> None:
    link = bodies.link(block.attributes.get("name", ""))
    where = f"{found.kind} {found.file.name}: underwater object plugin"
    volume = block.first("volume")
    if volume is not None and volume.text.strip():
        value = number(volume.text.strip(), volume.place, "volume")
        if value <= 0.0:
            raise PlacedError(f"{volume.place}: volume is {value:g}, must be more than 0")
        found.displaced_volume_m3 = value
        found.derived["buoyancy"] = where
    density = plugin.first("fluid_density")
    neutral = (block.value("neutrally_buoyant") or "0").lower() in {"1", "true"}
    if neutral and link is not None and link.mass_kg and density is not None and density.text.strip():
        value = number(density.text.strip(), density.place, "fluid_density")
        if value <= 0.0:
            raise PlacedError(f"{density.place}: fluid_density is {value:g}, must be more than 0")
        found.displaced_volume_m3 = link.mass_kg / value
        found.notes.append("displaced volume: mass over density, since the file says the vehicle is neutral")
    centre = block.first("center_of_buoyancy")
    if centre is not None and centre.text.strip():
        point = numbers(centre.text, centre.place, "center_of_buoyancy", 3)
        found.p_buoyancy_m = point if link is None else link.X_BL.apply(point)
        found.derived["buoyancy"] = where
