"""What trainers of radiance fields and Gaussian splats need besides photographs with poses.

A held-out split, photographs without lens distortion, dense points in the axes of the export, and the attenuation of
the water per colour channel. `export.json` lists all of it.
"""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.experiments.exports.records import Photographs, SparsePoints, flu_of

HELD_OUT_ONE_IN = 8
"""One photograph of so many is held out, as B. Mildenhall et al. do, Local light field fusion, ACM TOG 38(4), 2019, doi
10.1145/3306346.3322980."""
UNDISTORTED = "undistorted"
_QUALITY = 95


def held_out_names(names: Sequence[str], one_in: int, seed: int) -> tuple[str, ...]:
    """Names of the held-out photographs: one of each run of `one_in` neighbours, drawn by `seed`; sorted.

    The names are in the order in which the photographs were taken, so that held-out views are spread over the path.
    Of two photographs and more at least one is held out, and at least one is not. `one_in` 0 holds none out.

    Raises InputError if `one_in` is 1 or negative.
    """
    if one_in < 0 or one_in == 1:
        raise InputError(f"--held-out {one_in}: must be 0 (none) or one photograph in 2 and more")
    if one_in == 0 or len(names) < 2:
        return ()
    rng = np.random.default_rng(seed)
    runs = np.array_split(np.arange(len(names)), max(1, len(names) // one_in))
    return tuple(sorted(names[int(rng.choice(run))] for run in runs))


def undistorted(
    photographs: Photographs, cloud: SparsePoints | None, folder: Path
) -> tuple[Photographs, SparsePoints | None]:
    """Write `folder/images`, the photographs of a pinhole camera in the same place, and give them with their points.

    The pinhole camera has the image size of the lens and shows no pixel that the lens did not see. Observations of
    points move to their undistorted pixels. Photographs of a lens without distortion are copied as they are.
    """
    images = folder / "images"
    images.mkdir(parents=True)
    files = tuple(images / file.name for file in photographs.files)
    if not photographs.params[4:].any():
        for source, target in zip(photographs.files, files, strict=True):
            shutil.copyfile(source, target)
        return replace(photographs, files=files), cloud
    import cv2

    from wakewise.core.optional_dependencies import need
    from wakewise.vision.image_decoding import AS_STORED, read_picture
    from wakewise.vision.reconstruction.photos.lenses import undistort

    need("undistorted photographs", "photos", only=("cv2",))
    fx, fy, cx, cy, *bend = photographs.params
    size = (photographs.width, photographs.height)
    # OpenCV's pixel centres are at 0, those of an export at +0.5.
    K = np.array([[fx, 0.0, cx - 0.5], [0.0, fy, cy - 0.5], [0.0, 0.0, 1.0]])
    new_K, _ = cv2.getOptimalNewCameraMatrix(K, np.array(bend), size, 0.0)
    maps = cv2.initUndistortRectifyMap(K, np.array(bend), np.eye(3), new_K, size, cv2.CV_32FC1)
    for source, target in zip(photographs.files, files, strict=True):
        picture = read_picture(source, AS_STORED)
        if picture is None or picture.shape[:2] != (photographs.height, photographs.width):
            raise InputError(f"{source}: is no picture of {photographs.width} x {photographs.height} px")
        flat = cv2.remap(picture, *maps, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
        jpeg = [cv2.IMWRITE_JPEG_QUALITY, _QUALITY] if target.suffix.lower() in (".jpg", ".jpeg") else []
        target.write_bytes(cv2.imencode(target.suffix, flat, jpeg)[1].tobytes())
    pinhole = np.array([new_K[0, 0], new_K[1, 1], new_K[0, 2] + 0.5, new_K[1, 2] + 0.5, 0.0, 0.0, 0.0, 0.0])
    if cloud is not None:

        def moved(pixels: Array) -> Array:
            slopes = undistort((pixels - [cx, cy]) / [fx, fy], np.array(bend), fisheye=False)
            return slopes * pinhole[:2] + pinhole[2:4]

        cloud = replace(cloud, seen={name: (moved(at), which) for name, (at, which) in cloud.seen.items()})
    return replace(photographs, files=files, params=pinhole), cloud


def write_dense(dense: Path, target: Path, *, z_up: bool) -> int:
    """Write dense points with normals and colours as `target`, NED or z up (x north, y west); how many they are."""
    from wakewise.vision.reconstruction.outputs.clouds import read_cloud, write_cloud

    cloud = read_cloud(dense)
    if z_up:
        cloud = replace(cloud, points_m=flu_of(cloud.points_m), normals=flu_of(cloud.normals))
    write_cloud(target, cloud)
    return len(cloud.points_m)


def place_picture(source: Path, target: Path) -> None:
    """Copy a photograph to where an export has it, unless it is there."""
    if source.resolve() != target.resolve():
        shutil.copyfile(source, target)


@dataclass(frozen=True, kw_only=True, eq=False)
class WaterAttenuation:
    """Attenuation of the water in red, green and blue: I = J exp(-beta_D r) + B (1 - exp(-beta_B r)) at the range r.

    `attenuation_per_m` is beta_D, `veil_per_m` beta_B, each (3,) in 1/m; `veil`, (3,), is B: relative to a white card
    where the trial says it (`source` "trial"), in linear units of the photographs where it was fitted ("estimated").
    None with the reason `why` where neither is possible. D. Akkaynak and T. Treibitz, CVPR 2018, doi
    10.1109/CVPR.2018.00703.
    """

    source: str | None
    attenuation_per_m: Array | None = None
    veil_per_m: Array | None = None
    veil: Array | None = None
    why: str | None = None

    def figures(self) -> dict[str, Any]:
        """Plain values for JSON, by channel."""
        values = {"attenuation_per_m": self.attenuation_per_m, "veil_per_m": self.veil_per_m, "veil": self.veil}
        named = {
            key: None if value is None else dict(zip(("red", "green", "blue"), map(float, value), strict=True))
            for key, value in values.items()
        }
        return {"source": self.source, **named, "why": self.why}
