"""The part of a trial's report about its model: in 3D, in the photographs' colours, by its errors, and its coverage."""

from __future__ import annotations

import numpy as np
from scipy.spatial import KDTree

from wakewise.core.arrays import Array, BoolArray
from wakewise.core.errors import InputError
from wakewise.experiments.trials.coverage import Shot, coverage_of
from wakewise.operation import Scenario
from wakewise.operation.scenario.calibration_error import target_with_error
from wakewise.operation.scenario.randomization import Seeds
from wakewise.scene.missions import Coverage, find_coverage_gaps
from wakewise.scene.targets import Mesh, Target
from wakewise.ui.reports import figures
from wakewise.ui.reports.errors import CloudErrors, ModelErrors, cloud_errors, model_errors
from wakewise.ui.reports.media import coloured_model
from wakewise.ui.reports.page import (
    PageParts,
    error_scale,
    legend_entry,
    missing,
    missing_text,
    panel,
    parts,
    pictures,
    plot,
    scene_box,
    section,
    template,
)
from wakewise.ui.reports.scene3d import CAMERA_RGB, HULL_RGB, PATH_RGB, PLANNED_RGB, scene_html
from wakewise.ui.reports.svg_style import NOT_COUNTED, NOT_COVERED, OVER_LIMIT, error_colours, rgb
from wakewise.ui.reports.text import number
from wakewise.ui.reports.trial import Trial, TrialMesh
from wakewise.ui.reports.views import OUTLOOK, SIDES, Drawing, ViewBounds, coverage_colours, draw_cloud, draw_surface

VIEW_PIXELS = 360


def before_mesh(trial: Trial, draft: PageParts) -> None:
    """Make what of the part shows neither mesh nor colours."""
    cloud = draft.once("cloud", lambda: cloud_errors(trial))
    if cloud is not None:
        _covered(trial, cloud, draft)
        _spread(cloud, draft)


def before_colours(trial: Trial, draft: PageParts) -> None:
    """Make what of the part shows the mesh but not its colours."""
    errors = _errors(trial, draft)
    if errors is not None and trial.truth is not None:
        _accuracy(trial.truth, errors, draft)


def _errors(trial: Trial, draft: PageParts) -> ModelErrors | None:
    cloud = draft.once("cloud", lambda: cloud_errors(trial))
    return draft.once("errors", lambda: None if cloud is None else model_errors(trial, cloud))


def _covered(trial: Trial, cloud: CloudErrors, draft: PageParts) -> list[str]:
    """The truth by its distance to the cloud, from all sides."""

    def make() -> list[str]:
        if trial.truth is None:
            return []
        frame = ViewBounds.around(trial.truth.vertices_m[cloud.counts])
        colours = coverage_colours(cloud.coverage_m, cloud.counts)
        return draw_surface(trial.truth, colours, SIDES, frame, VIEW_PIXELS)

    return draft.once("covered", make)


def _accuracy(truth: TrialMesh, errors: ModelErrors, draft: PageParts) -> list[str]:
    """The mesh, or else the cloud, by its distance to the truth, from all sides."""
    frame = ViewBounds.around(truth.vertices_m[errors.counts])

    def make() -> list[str]:
        if errors.model is not None and errors.model_accuracy_m is not None:
            return draw_surface(errors.model, error_colours(errors.model_accuracy_m), SIDES, frame, VIEW_PIXELS)
        return draw_cloud(errors.points_m, error_colours(errors.accuracy_m), SIDES, frame, VIEW_PIXELS)

    return draft.once("accuracy", make)


def _spread(errors: CloudErrors, draft: PageParts) -> str:
    return draft.once(
        "spread",
        lambda: plot(
            figures.error_histogram(errors),
            "distribution of errors",
            f"From {number(len(errors.points_m))} points of the cloud, thinned to one per 0.8 mm. The last bar holds "
            "everything beyond.",
            narrow=figures.error_histogram(errors, narrow=True),
        ),
    )


def model_section(trial: Trial, draft: PageParts) -> str:
    """HTML of the part; what `draft` holds is taken from there."""
    errors = _errors(trial, draft)
    coloured = coloured_model(trial)
    drawing = None if coloured is None else Drawing(coloured[0])
    scene = _scene(trial, errors, _poster(trial, errors, coloured, drawing))
    if errors is None or trial.truth is None:
        why = missing_text(trial, "dense.ply", "truth.ply")
        gap = missing("the model's error", why)
        return section("model", "The model", "There is nothing to measure.", scene + gap)
    aligned = "after rigid alignment to the truth" if errors.fine_aligned else "as it came, without fine alignment"
    return section(
        "model",
        "The model",
        f"How far the reconstruction is from the true surface, {aligned}. What stands less than 10 mm above the bed "
        "does not count: sand touches it.",
        scene
        + _in_colour(coloured, drawing)
        + panel(
            "Accuracy",
            "The reconstruction, coloured by its distance to the true surface.",
            error_scale("error (mm)", ((OVER_LIMIT, "more"),)),
            pictures(_accuracy(trial.truth, errors, draft), SIDES, "model"),
        )
        + panel(
            "Completeness",
            "The true surface, coloured by its distance to the nearest reconstructed point.",
            error_scale("distance (mm)", ((NOT_COVERED, "not covered"), (NOT_COUNTED, "does not count"))),
            pictures(_covered(trial, errors, draft), SIDES, "true surface"),
        )
        + _spread(errors, draft),
    )


def _poster(
    trial: Trial, errors: ModelErrors | None, coloured: tuple[TrialMesh, Array] | None, drawing: Drawing | None
) -> str:
    """The model as the 3D scene opens on it, for as long as the scene loads; empty where there is none."""
    if trial.truth is None:
        return ""
    frame = ViewBounds.around(trial.truth.vertices_m)
    if coloured is not None and drawing is not None:
        return drawing.pictures(coloured[1], (OUTLOOK,), frame, VIEW_PIXELS)[0]
    if errors is not None and errors.model is not None and errors.model_accuracy_m is not None:
        return draw_surface(errors.model, error_colours(errors.model_accuracy_m), (OUTLOOK,), frame, VIEW_PIXELS)[0]
    return ""


def _in_colour(coloured: tuple[TrialMesh, Array] | None, drawing: Drawing | None) -> str:
    if coloured is None or drawing is None:
        return ""
    surface, colours = coloured
    views = drawing.pictures(colours, SIDES, ViewBounds.around(surface.vertices_m), VIEW_PIXELS)
    text = "The model in the colours of its photographs, as mesh.glb has it for other programs."
    return panel("Likeness", text, "", pictures(views, SIDES, "model in colour"))


def _scene(trial: Trial, errors: ModelErrors | None, poster: str) -> str:
    """The 3D scene, opened on the model, and what its layers are."""
    html = scene_html(trial, errors)
    if html is None:
        return missing("the 3D scene", missing_text(trial, "steps.parquet", "images.csv", "truth.ply"))
    layers = {"path": PATH_RGB, "photographs": CAMERA_RGB, "planned viewpoints": PLANNED_RGB, "vehicle": HULL_RGB}
    legend = "".join(legend_entry("rgb({},{},{})".format(*colour), name) for name, colour in layers.items())
    if errors is not None:
        legend = error_scale("model by error (mm)") + legend
    hint = str(template("trial.html").scene_hint())
    return scene_box(html, hint + legend, poster)


WELL_SEEN, IN_PART = "#2f8a5b", "#ebc35a"
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
            (reasons.seldom, "is shown, but not well enough by three photographs that make pairs"),
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
    colours = ((WELL_SEEN, "seen well"), (IN_PART, "by too few"), (NOT_COVERED, "not"), (NOT_COUNTED, "does not count"))
    legend = str(parts().chips([parts().chip(*entry) for entry in colours]))
    surface = TrialMesh(vertices_m=target.mesh.vertices_m, faces=target.mesh.faces)
    painted, counts = _painted(coverage, surface.vertices_m)
    frame = ViewBounds.around(surface.vertices_m[counts] if counts.any() else surface.vertices_m)
    drawn = draw_surface(surface, painted, SIDES, frame, PIXELS)
    return panel("Coverage", text, legend, pictures(drawn, SIDES, "coverage"))


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
    return target_with_error(target, settings.calibration_error, Seeds(settings.seed).survey()[0])


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
