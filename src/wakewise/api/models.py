"""Photographs to a model, a model against the truth, and targets and methods by name."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from numpy.typing import ArrayLike

from wakewise.control import MAKERS
from wakewise.core.arrays import frozen
from wakewise.core.checks import boolean, finite_number, instance_of, path_of, quoted
from wakewise.core.errors import InputError
from wakewise.core.optional_dependencies import need
from wakewise.core.plugins import names
from wakewise.core.settings import seed_number
from wakewise.scene.targets import find_target, is_mesh_file

if TYPE_CHECKING:
    from wakewise.scene.targets import Mesh, Target
    from wakewise.vision.evaluation import SurfaceScore
    from wakewise.vision.reconstruction import Model, ReconstructionSettings


def reconstruct(
    photos: str | Path,
    out: str | Path,
    *,
    settings: ReconstructionSettings | None = None,
    reference_cameras: str | Path | None = None,
    focal_px: float | None = None,
    camera: str | Path | None = None,
    region: tuple[ArrayLike, float] | None = None,
) -> Model:
    """Photographs to a sparse model, a dense cloud and a mesh (photogrammetry with COLMAP and stereo).

    Parameters
    ----------
    photos, out : path
        Folder of photographs; folder for the model. Stages that are done are skipped.
    settings : ReconstructionSettings, optional
    reference_cameras : path, optional
        Known camera centres (m), which give scale and frame: CSV or COLMAP's images.txt.
    focal_px : float, optional
        Focal length to start from.
    camera : path, optional
        A known lens: folder with COLMAP's cameras.txt.
    region : (centre, radius), optional
        What is wanted, in the frame of the references (m).

    Returns
    -------
    Model
        Its `summary()` holds the figures.

    Raises
    ------
    InputError, StageError
        If photographs or references cannot be used; if too little of them fits together.

    Examples
    --------
    >>> import wakewise as ww
    >>> ww.reconstruct("photos", "runs/photos").summary()["registered_images"]  # doctest: +SKIP
    """
    need("ww.reconstruct", "photos")
    from wakewise.vision.reconstruction import ReconstructionSettings, read_lens, read_reference_cameras
    from wakewise.vision.reconstruction import reconstruct as build

    if region is not None and (not isinstance(region, (tuple, list)) or len(region) != 2):
        raise InputError(f"region: {quoted(region)}, must be a centre and a radius, ((x, y, z), r) in m")
    sphere = None if region is None else (frozen(region[0], (3,), "region"), finite_number(region[1], "region", 0.0))
    pictures, place = path_of(photos, "photos"), path_of(out, "out")
    lens = None if camera is None else path_of(camera, "camera")
    references = None if reference_cameras is None else path_of(reference_cameras, "reference_cameras")
    return build(
        pictures,
        place,
        None if settings is None else instance_of(settings, ReconstructionSettings, "settings"),
        focal_px=None if focal_px is None else finite_number(focal_px, "focal_px", above=0.0),
        lens=None if lens is None else read_lens(lens),
        reference_positions=None if references is None else read_reference_cameras(references),
        region=sphere,
    )


def evaluate(
    cloud: str | Path | ArrayLike,
    reference: str | Path | Mesh,
    *,
    bed_z_m: float | None = None,
    camera_centres_m: ArrayLike | None = None,
    icp: bool = True,
) -> SurfaceScore:
    """A cloud against a true surface: accuracy, completeness, F-score.

    Parameters
    ----------
    cloud : path or array_like, shape (n, 3)
        Points in m.
    reference : path or Mesh
        The true surface, in m and in the same frame up to a few millimetres.
    bed_z_m : float, optional
        Depth of the bed: what lies less than 10 mm above it does not count.
    camera_centres_m : array_like, shape (k, 3), optional
        With them the surface that at least three cameras see is judged apart.
    icp : bool
        Move the cloud onto the surface first, rigidly.

    Raises
    ------
    InputError, StageError
        If a file cannot be used; if the cloud is no model of the reference.

    Examples
    --------
    >>> import numpy as np, wakewise as ww
    >>> coral = ww.load_target("brain").mesh
    >>> corners = coral.triangles_m.reshape(-1, 3)
    >>> score = ww.evaluate(corners, coral)
    >>> bool(score.rmse_mm < 0.01)
    True
    """
    need("ww.evaluate", "photos", only=("embreex", "small_gicp"))
    from wakewise.scene.targets import Mesh, read_mesh
    from wakewise.vision.evaluation import Crop, evaluate_surface
    from wakewise.vision.reconstruction import read_cloud

    icp = boolean(icp, "icp")
    if isinstance(cloud, (str, os.PathLike)):
        points = read_cloud(path_of(cloud, "cloud")).points_m
    else:
        points = frozen(cloud, (None, 3), "cloud")
    bed = None if bed_z_m is None else finite_number(bed_z_m, "bed_z_m")
    if isinstance(reference, (str, os.PathLike)):
        mesh = read_mesh(path_of(reference, "reference"))
    else:
        mesh = instance_of(reference, Mesh, "reference")
    centres = None if camera_centres_m is None else frozen(camera_centres_m, (None, 3), "camera_centres_m")
    return evaluate_surface(points, mesh, crop=Crop(bed_z_m=bed), camera_centres_W_m=centres, icp=icp)


def load_target(kind: str | Path, *, bed_z_m: float = 1.5, seed: int = 0, size_m: float | None = None) -> Target:
    """A target standing on the bed: a procedural coral by name, a mesh file, or one from outside.

    Parameters
    ----------
    kind : str or Path
        "branching", "brain", "plate", the path of a mesh file, a plug-in's name, or ``package.module:make``.
    bed_z_m : float
        Depth of the bed, more than 0.
    seed : int
        Which individual of a procedural one; a mesh file has but one.
    size_m : float, optional
        Scale a mesh file's largest extent to this; a procedural target has its own size.

    Raises
    ------
    InputError
        If there is no such target, or its file is not usable.

    Examples
    --------
    >>> import wakewise as ww
    >>> ww.load_target("plate").bed_z_m
    1.5
    """
    if seed_number(seed) != 0 and is_mesh_file(kind):
        raise InputError(f"seed: {seed}, a mesh file has but one individual, leave it out")
    return find_target(kind, bed_z_m, seed, size_m)


def methods() -> list[str]:
    """Names of the methods that a scenario may ask for: ours, then those that installed packages offer.

    Examples
    --------
    >>> import wakewise as ww
    >>> "wake-aware" in ww.methods()
    True
    """
    return names("method", MAKERS)
