"""Folder of image pairs: pictures `*A` and `*B`, and `piv.yaml` with scale, time step, jet direction and thrusts."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np
import yaml
from pydantic import Field, ValidationError

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.core.optional_dependencies import need
from wakewise.core.settings import Settings, describe_faults
from wakewise.vision.piv.correlation import Displacements, averaged, displacements
from wakewise.vision.piv.images import Picture
from wakewise.wake.samples import JetSamples, joined

_SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp")
_EDGE_WINDOWS = 2


class PivFolder(Settings):
    """Contents of piv.yaml. The picture shows a plane through the jet's axis."""

    m_per_px: float = Field(gt=0.0, le=0.1, description="size of a pixel in the light sheet")
    dt_s: float = Field(gt=0.0, le=10.0, description="time between the frames of a pair")
    jet_direction: Literal["right", "left", "up", "down"] = Field(description="where the jet goes in the picture")
    disk_px: tuple[float, float] = Field(description="middle of the disk, column and row, may lie outside the picture")
    disk_diameter_m: float = Field(gt=0.0, le=10.0, description="diameter of the disk")
    thrust_N: float | dict[str, float] = Field(description="thrust, or one per pair by the name before its A or B")


def read_pairs(folder: Path) -> dict[str, tuple[Picture, Picture]]:
    """Pairs of 8-bit pictures by name, sorted; the two of a pair end in A and B before the suffix.

    Raises InputError if there are none, a partner is missing, or a picture cannot be read.
    """
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder, needs pictures *A and *B")
    found = {path.stem: path for path in sorted(folder.iterdir()) if path.suffix.lower() in _SUFFIXES}
    names = sorted(stem[:-1] for stem in found if stem.endswith(("A", "a")))
    pairs = {}
    for name in names:
        partner = next((name + end for end in ("B", "b") if name + end in found), None)
        if partner is None:
            raise InputError(f"{folder}: picture {name}A has no partner {name}B")
        first = next(name + end for end in ("A", "a") if name + end in found)
        pairs[name] = (_read(found[first]), _read(found[partner]))
    if not pairs:
        raise InputError(f"{folder}: no image pairs, needs pictures *A and *B ({', '.join(_SUFFIXES)})")
    return pairs


def _read(path: Path) -> Picture:
    need("reading pictures of a jet", "photos", only=("cv2",))
    import cv2

    from wakewise.vision.image_decoding import read_picture

    picture = read_picture(path, cv2.IMREAD_GRAYSCALE)
    if picture is None:
        raise InputError(f"{path}: not a picture that can be read")
    return np.asarray(picture, dtype=np.uint8)


def read_piv_settings(folder: Path) -> PivFolder:
    """Read and check piv.yaml.

    Raises InputError if it is missing or a field is wrong.
    """
    path = folder / "piv.yaml"
    wanted = ", ".join(PivFolder.model_fields)
    if not path.is_file():
        raise InputError(f"{path}: no such file; without scale and time nothing can be fitted, it must hold {wanted}")
    try:
        tree = yaml.safe_load(path.read_text(encoding="utf-8"))
        return PivFolder.model_validate(tree)
    except (yaml.YAMLError, UnicodeDecodeError):
        raise InputError(f"{path}: not YAML, it must hold {wanted}") from None
    except ValidationError as fault:
        raise InputError(f"{path}: {describe_faults(fault, PivFolder, 'piv.yaml')}; it must hold {wanted}") from None


def samples_of_folder(folder: Path) -> JetSamples:
    """Velocity samples in the jet frame from all pairs of a folder; pairs of one thrust are averaged.

    Raises InputError for faults of the folder, of piv.yaml or of the pictures.
    """
    settings, pairs = read_piv_settings(folder), read_pairs(folder)
    if isinstance(settings.thrust_N, dict):
        missing = [name for name in pairs if name not in settings.thrust_N]
        if missing:
            raise InputError(f"{folder / 'piv.yaml'}: thrust_N has no entry for pair {missing[0]}")
        thrust = {name: settings.thrust_N[name] for name in pairs}
    else:
        thrust = dict.fromkeys(pairs, settings.thrust_N)
    fields = dict(zip(pairs, displacements(list(pairs.values())), strict=True))
    parts = []
    for value in sorted(set(thrust.values())):
        mean = averaged([field for name, field in fields.items() if thrust[name] == value])
        parts.append(samples_of_vectors(mean, settings, value, title=folder.name))
    return joined(parts)


def samples_of_vectors(field: Displacements, settings: PivFolder, thrust_N: float, title: str) -> JetSamples:
    """Valid vectors inside the picture's rim and downstream of the disk, as samples in the jet frame."""
    columns, rows = np.meshgrid(field.columns_px, field.rows_px)
    right = (columns - settings.disk_px[0]) * settings.m_per_px
    down = (rows - settings.disk_px[1]) * settings.m_per_px
    speed = settings.m_per_px / settings.dt_s
    x, side, u, v = _turned(settings.jet_direction, right, down, field.right_px * speed, field.down_px * speed)
    use = x > 0.0
    rim = np.ones_like(use)
    rim[_EDGE_WINDOWS:-_EDGE_WINDOWS, _EDGE_WINDOWS:-_EDGE_WINDOWS] = False
    use &= ~rim
    untrusted = int((use & ~field.valid).sum())
    use &= field.valid
    if not use.any():
        raise InputError(f"{title}: no trusted vector downstream of the disk, check disk_px and jet_direction")
    return JetSamples(
        x_m=x[use],
        r_m=np.abs(side[use]),
        thrust_N=np.full(int(use.sum()), thrust_N),
        speed_m_s=u[use],
        across_m_s=np.abs(v[use]),
        disk_diameter_m=settings.disk_diameter_m,
        title=title,
        warnings=(f"{untrusted} vectors at {thrust_N:g} N not trusted and left out",) if untrusted else (),
    )


def _turned(direction: str, right: Array, down: Array, u: Array, v: Array) -> tuple[Array, Array, Array, Array]:
    """Place and velocity along and across the jet."""
    turns = {"right": (right, down, u, v), "left": (-right, down, -u, v), "down": (down, right, v, u)}
    return turns.get(direction, (-down, right, -v, u))
