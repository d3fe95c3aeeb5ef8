"""The part of a trial's report that says what its photographs saw well, as the coverage guide has it before leaving."""

from __future__ import annotations

import numpy as np
from scipy.spatial import KDTree

from wakewise.core.arrays import Array, BoolArray
from wakewise.core.errors import InputError
from wakewise.experiments.trials.coverage import Shot, coverage_of
from wakewise.operation import Scenario
from wakewise.operation.calibration_error import target_with_error
from wakewise.operation.seeds import Seeds
from wakewise.scene.missions import Coverage, find_coverage_gaps
from wakewise.scene.targets import Mesh, Target
from wakewise.ui.reports.page import legend_entry, missing, missing_text, panel, pictures
from wakewise.ui.reports.page_parts import PageParts
from wakewise.ui.reports.svg_style import NOT_COUNTED, NOT_COVERED, rgb
from wakewise.ui.reports.trial import Trial, TrialMesh
from wakewise.ui.reports.views import SIDES, ViewBounds, draw_surface

WELL_SEEN, IN_PART = "#3f9b6b", "#e3b341"
PIXELS = 300
LITTLE = 0.15
"""Patches that have come less far than this are shown as not seen."""


def coverage_html(trial: Trial, draft: PageParts) -> str:
    """Share seen well, a map of it, and why the rest was not; a gap that says why where parts are missing."""
    return draft.once("coverage", lambda: _made(trial))


def _made(trial: Trial) -> str:
    shots: list[Shot] = [(s.X_WC_est, s.sharpness) for s in trial.photographs if s.X_WC_est is not None]
    if trial.truth is None or trial.settings is None or not shots:
        gaps = missing_text(trial, "truth.ply", "scenario.yaml", "images.csv")
        return missing("what the photographs covered", "no poses on record" if gaps.startswith("model") else gaps)
    try:
        target = _found(trial.truth, trial.settings, trial.bed_z_m)
        lens = trial.settings.imaging.camera()
        coverage = coverage_of(target, lens, shots)
    except InputError as fault:
        return missing("what the photographs covered", str(fault))
    reasons = find_coverage_gaps(coverage, (X_WC for X_WC, _ in shots), lens)
    why = [
        f"{100.0 * share:.0f} % {words}"
        for share, words in (
            (reasons.unseen, "is in no photograph: hidden, or facing away from all of them"),
            (reasons.poorly, "is only seen at a slant or from too far"),
            (reasons.seldom, "is shown well, but not by three photographs that make pairs"),
        )
        if share >= 0.005
    ]
    text = (
        "What the coverage guide expects of the model, from the estimated places of the photographs alone: "
        f"{100.0 * coverage.share:.0f} % of the target is seen well, "
        f"{100.0 * coverage.sure:.0f} % with a photograph to spare"
        + (f"; {'; '.join(why)}" if why else "")
        + f". {_compared(trial)}{_blurred(coverage)}"
    )
    legend = "".join(
        legend_entry(colour, name)
        for colour, name in (
            (WELL_SEEN, "seen well"), (IN_PART, "by too few"), (NOT_COVERED, "not"), (NOT_COUNTED, "does not count"),
        )
    )  # fmt: skip
    surface = TrialMesh(vertices_m=target.mesh.vertices_m, faces=target.mesh.faces)
    colours, counts = _painted(coverage, surface.vertices_m)
    frame = ViewBounds.around(surface.vertices_m[counts] if counts.any() else surface.vertices_m)
    drawn = draw_surface(surface, colours, SIDES, frame, PIXELS)
    return panel("Coverage", text, f'<div class="chips">{legend}</div>', pictures(drawn, SIDES, "coverage"))


def _compared(trial: Trial) -> str:
    complete, agreed = trial.metrics.number("completeness_pct"), trial.metrics.number("coverage_agreement_pct")
    if complete is None:
        return ""
    patches = "" if agreed is None else f", and of {agreed:.0f} % of the patches the guide was right"
    return f"In the model {complete:.0f} % is complete{patches}. "


def _blurred(coverage: Coverage) -> str:
    if coverage.blurred == 0:
        return ""
    return f"{coverage.blurred} of {coverage.photos} photographs were too blurred to count."


def _found(truth: TrialMesh, settings: Scenario, bed_z_m: float) -> Target:
    """The target where the crew took it to be; its shape is known."""
    mesh = Mesh(truth.vertices_m, truth.faces)
    middle = 0.5 * (truth.vertices_m.min(axis=0) + truth.vertices_m.max(axis=0))
    radius_m = float(np.linalg.norm(truth.vertices_m - middle, axis=1).max())
    target = Target(name="found", mesh=mesh, centre_W_m=middle, radius_m=radius_m, bed_z_m=bed_z_m)
    return target_with_error(target, settings.survey, Seeds(settings.seed).survey()[0])


def _painted(coverage: Coverage, vertices_W_m: Array) -> tuple[Array, BoolArray]:
    """Colour of each vertex, shape (n, 3), by how far the patch about it has come, and which vertices count."""
    patches = coverage.patches
    distance, nearest = KDTree(patches.points_W_m).query(vertices_W_m)
    patch = patches.patch[np.asarray(nearest)]
    # What is near the bed has no samples: the nearest one is several spacings away.
    counts = np.asarray(distance < 3.0 * np.sqrt(patches.area_m2 / len(patches.points_W_m)), dtype=np.bool_)
    colours = np.where(coverage.well[patch, None], rgb(WELL_SEEN), rgb(IN_PART))
    colours[coverage.score[patch] < LITTLE] = rgb(NOT_COVERED)
    colours[np.logical_not(counts)] = rgb(NOT_COUNTED)
    return colours, counts
