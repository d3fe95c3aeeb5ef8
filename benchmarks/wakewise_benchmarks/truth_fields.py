"""Water optics, silt, velocity fields, camera paths and meshes against what others published or measured."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from wakewise.core.errors import InputError
from wakewise.core.interfaces import Progress
from wakewise.scene.targets.mesh import load_mesh
from wakewise.wake.calibration import family
from wakewise_benchmarks.laboratory_sediment import grain_sizes_m, mass_exponents, read_samples
from wakewise_benchmarks.optics_tables import band_errors
from wakewise_benchmarks.trajectory_error import paired_instants, read_tum, trajectory_error
from wakewise_benchmarks.truth_records import Asked, Part
from wakewise_paper.flows import read_air_jet
from wakewise_paper.wake_piv import process_real_pairs
from wakewise_paper.wake_validation import MeasuredFlow, ValidationOptions, judge

EVO_RIGID_M, EVO_SIMILARITY_M = 0.008118977562045396, 0.006123163030157291
"""Rms of the camera path's error that evo prints (github.com/MichaelGrupp/evo), after either alignment."""

_CORAL_EXTENT_M = np.array([0.368, 0.379, 0.219])
_JET_MODEL = "jet-fitted"


def ocean_figures(folder: Path, _: Progress) -> dict[str, float]:
    """Shipped coefficients of the water types against the published spectra."""
    return band_errors(folder)


def sediment_figures(folder: Path, _: Progress) -> dict[str, float]:
    """The law of the silt's attenuation against mixtures measured in the laboratory."""
    samples = read_samples(folder / "All.mat")
    exponents, _scatter = mass_exponents(samples)
    grains = 1e6 * grain_sizes_m(samples)
    return {
        "backscatter_exponent": float(np.median(exponents[0])),
        "turbidity_exponent": float(np.median(exponents[1])),
        "mud_um": float(grains[0]),
        "sand_um": float(grains[-1]),
    }


def jet_figures(folder: Path, progress: Progress) -> dict[str, float | None]:
    """The velocimetry on real image pairs, and the fitted jet against a snapshot that it was not fitted to."""
    progress(0, 2, "image pairs")
    pairs = process_real_pairs(folder / "pairs")
    progress(1, 2, "air jet")
    jet = read_air_jet(folder / "jet_decoded.npz")
    flow = MeasuredFlow(name="air-jet", title="", note="", samples=jet.samples, split=jet.split)
    fitted = judge(family(_JET_MODEL), flow, ValidationOptions(progress=progress)).scores.r2_core
    return {
        "valid_pct": pairs.valid_pct,
        "along_pct": pairs.along_jet_pct,
        "jet_r2": fitted,
        "jet_gain": None if fitted is None else fitted - jet.snapshots_r2_core,
    }


def path_figures(folder: Path, _: Progress) -> dict[str, float]:
    """The error of a real camera path against the figures of another program."""
    truth_s, truth_m = read_tum(folder / "fr2_desk_groundtruth.txt")
    found_s, found_m = read_tum(folder / "fr2_desk_ORB.txt")
    mine, true = paired_instants(found_s, truth_s)
    rigid = trajectory_error(found_m[mine], truth_m[true], "rigid")
    similar = trajectory_error(found_m[mine], truth_m[true], "similarity")
    return {
        "rigid_mm": abs(rigid.rmse_mm - 1e3 * EVO_RIGID_M),
        "similarity_mm": abs(similar.rmse_mm - 1e3 * EVO_SIMILARITY_M),
    }


def coral_figures(folder: Path, _: Progress) -> dict[str, float]:
    """A laser-scanned coral as it is read: faces, and size in metres."""
    mesh = load_mesh(folder / "mcap.ply")
    return {"faces": float(len(mesh.faces)), "extent_mm": 1e3 * float(np.abs(mesh.extent_m - _CORAL_EXTENT_M).max())}


def bunny_figures(folder: Path, _: Progress) -> dict[str, float]:
    """A watertight scan as it is read."""
    mesh = load_mesh(folder / "bunny.ply", 0.12)
    if not mesh.is_closed:
        raise InputError(f"{folder / 'bunny.ply'}: is read as an open mesh, it is stated to be watertight")
    return {"faces": float(len(mesh.faces)), "vertices": float(len(mesh.vertices_m))}


_BAR = "bound of the package's own test"
PARTS = (
    Part(
        name="ocean_optics",
        source="Solonenko and Mobley 2015; cameras of Jiang et al. 2013",
        asked=(
            Asked(key="signal_per_m", what="attenuation of the target's light, 7 water types: largest error",
                  unit="1/m", high=6e-4, how="rounding of the shipped table"),
            Asked(key="veil_per_m", what="attenuation of the veil: largest error", unit="1/m", high=6e-4,
                  how="rounding of the shipped table"),
            Asked(key="backscatter_per_m", what="backscatter: largest error", unit="1/m", high=6e-6,
                  how="rounding of the shipped table"),
            Asked(key="veil", what="colour of the veil: largest error", high=6e-5, how="rounding of the shipped table"),
        ),
        compute=ocean_figures,
    ),
    Part(
        name="sediment_turbidity",
        source="Tran et al. 2024, laboratory",
        asked=(
            Asked(key="backscatter_exponent", what="exponent of backscatter with mass, 1 by the silt's law",
                  low=0.95, high=1.05, how=_BAR),
            Asked(key="turbidity_exponent", what="exponent of turbidity with mass, 1 by the silt's law",
                  low=0.9, high=1.1, how=_BAR),
            Asked(key="mud_um", what="grain that the silt's law finds for mud", unit="um", low=4.0, high=20.0,
                  how="silt, and a factor of two for the backscatter ratio"),
            Asked(key="sand_um", what="grain that the silt's law finds for the sandiest mixture", unit="um", low=25.0,
                  high=120.0, how="fine sand, and a factor of two for the backscatter ratio"),
        ),
        compute=sediment_figures,
    ),
    Part(
        name="piv_jet",
        source="F. Moisy, Lab FAST (velocity field); PIV image pairs of pivpy",
        asked=(
            Asked(key="valid_pct", what="velocimetry on a real image pair: valid vectors", unit="%", low=75.0,
                  how=_BAR),
            Asked(key="along_pct", what="velocimetry on a real image pair: fast vectors along the jet", unit="%",
                  low=95.0, how=_BAR),
            Asked(key="jet_gain", what="fitted jet on a third snapshot: R2 above that of the other two's mean",
                  low=0.0, how="as good as the measurement itself repeats"),
        ),
        compute=jet_figures,
    ),
    Part(
        name="trajectories",
        source="TUM RGB-D fr2/desk, ORB-SLAM; figures of evo",
        asked=(
            Asked(key="rigid_mm", what="rigid alignment of a camera path: its rms error against evo's", unit="mm",
                  high=1e-6, how="evo's printed figure"),
            Asked(key="similarity_mm", what="similarity of a camera path: its rms error against evo's", unit="mm",
                  high=1e-6, how="evo's printed figure"),
        ),
        compute=path_figures,
    ),
    Part(
        name="coral_mesh",
        source="habtools (J. Madin), laser scan of Montipora capitata",
        asked=(
            Asked(key="faces", what="faces of the scanned coral", low=10939.0, high=10939.0,
                  how="stated with the file"),
            Asked(key="extent_mm", what="extent of the scanned coral: largest error", unit="mm", high=0.5,
                  how="rounding of the stated extent"),
        ),
        compute=coral_figures,
    ),
    Part(
        name="mesh_bunny",
        source="Stanford bunny, npm package bunny",
        asked=(
            Asked(key="faces", what="faces of the watertight bunny", low=3674.0, high=3674.0,
                  how="stated with the file"),
            Asked(key="vertices", what="vertices of the watertight bunny", low=1839.0, high=1839.0,
                  how="stated with the file"),
        ),
        compute=bunny_figures,
    ),
)  # fmt: skip
