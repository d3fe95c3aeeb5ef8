"""Which photographs share intrinsics: by the user, by folder, by size, and by EXIF."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import PurePosixPath
from typing import Any

from wakewise.core.errors import InputError
from wakewise.vision.reconstruction.photos.lenses import Lens
from wakewise.vision.reconstruction.photos.photo_folder import Photo

_Key = tuple[str, str, str, str]
"""Name given by the user, folder, EXIF, size."""


@dataclass(frozen=True, kw_only=True)
class LensGroup:
    """Photographs, by name, that were taken through one lens at one focal length; `lens` where it is known."""

    name: str
    photos: tuple[str, ...]
    width: int
    height: int
    lens: Lens | None = None


def group_photos(
    photos: tuple[Photo, ...],
    patterns: Mapping[str, str] | None = None,
    lenses: Mapping[str, Lens] | Lens | None = None,
) -> tuple[LensGroup, ...]:
    """Photographs by lens.

    Photographs that differ in size, folder, or EXIF's camera are of different lenses.

    `patterns`: name of a lens to a shell pattern of its photos' names (`left_*`); a photo that fits several is of the
    first. `lenses`: one lens of them all, or those of groups by name. Raises InputError if no photo fits a pattern, a
    lens belongs to no group, or has another size than the group's photos.
    """
    patterns = dict(patterns or {})
    found: dict[_Key, list[Photo]] = {}
    for photo in photos:
        given = next((name for name, pattern in patterns.items() if fnmatchcase(photo.name, pattern)), None)
        folder = str(PurePosixPath(photo.name).parent)
        size = f"{photo.width} x {photo.height}"
        read = ("", "" if folder == "." else folder, photo.camera, size)
        key = read if given is None else (given, "", "", size)
        found.setdefault(key, []).append(photo)
    for name, pattern in patterns.items():
        if not any(key[0] == name for key in found):
            raise InputError(f"lens {name}: none of the {len(photos)} photos fits '{pattern}' ({photos[0].name} ...)")
    names = _names(list(found))
    groups = []
    for key, members in found.items():
        first = members[0]
        lens = lenses if isinstance(lenses, Lens) else _given(lenses, key, names[key])
        if lens is not None and (first.width, first.height) != (lens.width, lens.height):
            raise InputError(
                f"camera: is of photos of {lens.width} x {lens.height} px, {first.name} has {first.width} x "
                f"{first.height}; all of a lens must have the camera's size"
            )
        groups.append(
            LensGroup(
                name=names[key],
                photos=tuple(photo.name for photo in members),
                width=first.width,
                height=first.height,
                lens=lens,
            )
        )
    if lenses is not None and not isinstance(lenses, Lens):
        for name in lenses:
            if name not in names.values() and not any(name in key[:2] for key in found):
                raise InputError(f"camera {name}: there is no such lens, there are {', '.join(names.values())}")
    return tuple(groups)


def known_groups(photos: tuple[Photo, ...], lenses: Mapping[str, Lens]) -> tuple[LensGroup, ...]:
    """Photographs by lenses that are known photo by photo: those with the same numbers share one.

    Raises InputError if a photo has none.
    """
    found: dict[tuple[float, ...], list[str]] = {}
    for photo in photos:
        if photo.name not in lenses:
            raise InputError(f"cameras: {photo.name} has a pose and no lens; give one with --camera or beside the pose")
        found.setdefault(tuple(lenses[photo.name].numbers()), []).append(photo.name)
    out = []
    for k, names in enumerate(found.values()):
        lens = lenses[names[0]]
        name = "known" if len(found) == 1 else f"known {k + 1}"
        out.append(LensGroup(name=name, photos=tuple(names), width=lens.width, height=lens.height, lens=lens))
    return tuple(out)


def named_lenses(lenses: Sequence[Mapping[str, Any]], groups: tuple[LensGroup, ...]) -> list[dict[str, Any]]:
    """Lenses of a model, each with the name of its photos' group; numbered if a group has several: `left (1)`."""
    name_of = {photo: group.name for group in groups for photo in group.photos}
    names = [name_of[one["photos"][0]] for one in lenses]
    out = []
    for k, (name, one) in enumerate(zip(names, lenses, strict=True)):
        number = f" ({names[: k + 1].count(name)})" if names.count(name) > 1 else ""
        out.append({"name": name + number, **one})
    return out


def _given(lenses: Mapping[str, Lens] | None, key: _Key, name: str) -> Lens | None:
    """The lens that was handed in for a group, by its whole name, the name of its pattern or its folder."""
    return None if lenses is None else lenses.get(name, lenses.get(key[0] or key[1]))


def _names(keys: list[_Key]) -> dict[_Key, str]:
    """Short unique names: the user's, else the parts in which groups differ."""
    found = [key for key in keys if not key[0]]
    varies = [k for k in (1, 2, 3) if len({key[k] for key in found}) > 1]
    out: dict[_Key, str] = {}
    for key in keys:
        label = key[0] or ", ".join(key[k] for k in varies if key[k]) or key[2] or key[3]
        twice = sum(other[0] == key[0] for other in keys) > 1 if key[0] else label in out.values()
        out[key] = f"{label}, {key[3]}" if twice and not label.endswith(key[3]) else label
    return out
