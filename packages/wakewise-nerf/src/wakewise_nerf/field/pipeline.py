"""The whole way from posed photos to a neural field, its score on held-out views, and its surface; stage by stage."""

from __future__ import annotations

import hashlib
import time
from pathlib import Path
from typing import Any

import numpy as np

from wakewise.core.errors import InputError, StageError
from wakewise.core.files import write_json
from wakewise.core.interfaces import Progress, no_progress
from wakewise.vision.reconstruction.outputs.clouds import write_cloud
from wakewise.vision.reconstruction.outputs.meshing import FIGURES as MESH_FIGURES
from wakewise.vision.reconstruction.outputs.meshing import mesh_points
from wakewise.vision.reconstruction.settings import ReconstructionSettings
from wakewise.vision.reconstruction.sfm.registered_photos import RegionOfInterest
from wakewise.vision.reconstruction.stages import StageResult, fingerprint, make_folder, run_stage
from wakewise_nerf.field.geometry import depth_camera, depth_map, fuse_depth
from wakewise_nerf.field.posed import PosedPhoto, read_model, read_posed, sees, surroundings
from wakewise_nerf.field.settings import FieldSettings, pick_device

# Part of every stage's fingerprint: raise it when a stage's result changes for the same input.
VERSION = 1
_JUST_HOW = {"threads", "checkpoint_every", "depth_px", "agreeing_views"}
"""Settings that training does not depend on, but for the last digits."""


def build_field(
    folder: Path,
    photos: Path,
    out: Path,
    settings: FieldSettings,
    *,
    region: tuple[Any, float] | None = None,
    device: str = "auto",
    mesh: bool = True,
    progress: Progress = no_progress,
) -> dict[str, Any]:
    """Train a field on a model's photos and leave checkpoint.pt, views/, points.ply, mesh.ply and field.json in `out`.

    A stage whose files are there, made from the same photos and poses with the same settings, is skipped; a training
    that was stopped goes on from its last checkpoint.

    `folder`: a folder that `reconstruct` left: sparse/ is read. `photos`: the folder of photos that it was made from.
    `region`, (centre, radius): what the field is wanted of, in the model's frame: shape (3,) in m, and m. If not given,
    where the sparse points are. `device`: auto, cpu or cuda. `progress`: called with (done, total, note) in units of a
    stage's own work. Returns psnr_db, psnr_min_db, ssim (means over held-out views on the rectangle about the region),
    train_views, held_out_views, views (by name), loss, steps, rays_per_step, occupied_pct, points, point_spacing_mm,
    mesh_vertices, mesh_faces, mesh_points_left_out, parameters, device, stages_s, skipped, wall_s, and why for what is
    None. Raises InputError if PyTorch, CUDA, the model or the photos are missing or of no use; StageError if too little
    can be learnt from them.
    """
    began = time.perf_counter()
    where = pick_device(device)
    model = read_model(folder / "sparse")
    ball = surroundings(model) if region is None else _ball(region)
    posed = read_posed(model, photos, ball, settings.photo_px)
    # PyTorch is an extra, so what needs it is imported only now.
    from wakewise_nerf.field import held_out_views, rendering, training

    learn, held_out = held_out_views.split(posed, settings.held_out_every)
    used = settings.model_dump(exclude=_JUST_HOW)
    train_key = fingerprint(VERSION, "train", used, _digest(posed), ball.centre_W_m.tolist(), ball.radius_m)
    checkpoint = out / "checkpoint.pt"
    make_folder(out)
    held: list[training.TrainingState] = []

    def trained() -> training.TrainingState:
        """Return the trained field, from the checkpoint where this run did not train it."""
        if not held:
            kept = training.read_checkpoint(checkpoint, where)
            if kept is None or kept["key"] != train_key:
                raise StageError(f"{checkpoint}: is damaged; remove it and run the same command again")
            fresh = training.TrainingState(settings, where)
            fresh.restore(kept["training"])
            held.append(fresh)
        return held[0]

    def learnt() -> dict[str, Any]:
        table = rendering.RayTable(learn, ball, where)
        held.append(training.train(table, settings, where, checkpoint, train_key, progress))
        return {
            "loss": held[0].losses[-1],
            "rays_per_step": held[0].rays,
            "occupied_pct": 100.0 * held[0].occupancy.share(),
            "parameters": sum(p.numel() for p in held[0].field.parameters()),
            "device": str(where),
        }

    def fused() -> dict[str, Any]:
        maps = []
        for index, photo in enumerate(posed):
            progress(index, len(posed), "depth")
            camera = depth_camera(photo, settings.depth_px)
            if camera is None:
                continue
            rays_C = camera.directions_C()
            # The rectangle's corners look past the region.
            rays_C[~sees(rays_C, camera.R_CW @ (ball.centre_W_m - camera.p_WC_m), ball.radius_m)] = np.nan
            directions = (rays_C @ camera.R_CW).astype(np.float32)
            colours, distance = held_out_views.draw_surface(trained(), rendering.origin_in(photo, ball), directions)
            shown = np.rint(255.0 * np.clip(colours, 0.0, 1.0)).astype(np.uint8)
            maps.append(depth_map(index, camera, ball.radius_m * distance, shown, ball))
        cloud, spacing = fuse_depth(maps, settings.agreeing_views, progress)
        write_cloud(out / "points.ply", cloud)
        return {"points": len(cloud.points_m), "point_spacing_mm": 1e3 * spacing}

    results: dict[str, StageResult] = {}
    results["train"] = run_stage(out, "train", train_key, (checkpoint,), learnt)
    results["views"] = run_stage(
        out,
        "views",
        fingerprint(train_key, "views"),
        tuple(out / "views" / f"{Path(photo.name).stem}.png" for photo in held_out),
        lambda: held_out_views.judge(trained(), held_out, ball, out / "views", progress),
    )
    points_key = fingerprint(train_key, "points", settings.depth_px, settings.agreeing_views)
    results["points"] = run_stage(out, "points", points_key, (out / "points.ply",), fused)
    if mesh:
        spacing_m = 1e-3 * results["points"].figures["point_spacing_mm"]
        results["mesh"] = run_stage(
            out,
            "mesh",
            fingerprint(points_key, "mesh"),
            (out / "mesh.ply",),
            lambda: mesh_points(
                out / "points.ply",
                out / "mesh.ply",
                ReconstructionSettings(threads=settings.threads),
                spacing_m=spacing_m,
                progress=progress,
            ),
        )
    figures: dict[str, Any] = dict.fromkeys(MESH_FIGURES)
    for result in results.values():
        figures |= result.figures
    figures |= {
        "steps": settings.steps,
        "train_views": len(learn),
        "held_out_views": len(held_out),
        "stages_s": {name: result.wall_s for name, result in results.items()},
        "skipped": [name for name, result in results.items() if result.skipped],
        "wall_s": time.perf_counter() - began,
    }
    reasons = {"ssim": "the region is less than 11 px wide in the held-out photos"}
    figures["why"] = {k: reasons.get(k, "no mesh was asked for") for k, value in figures.items() if value is None}
    write_json(out / "field.json", figures)
    return figures


def _digest(posed: tuple[PosedPhoto, ...]) -> str:
    """Fingerprint of names, poses, rendering and colours."""
    digest = hashlib.blake2b(digest_size=16)
    for photo in posed:
        digest.update(photo.name.encode())
        for array in (photo.R_CW, photo.p_WC_m, photo.directions_W, photo.colours):
            digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()


def _ball(region: tuple[Any, float]) -> RegionOfInterest:
    centre, radius = region
    if not (np.isfinite(radius) and radius > 0.0):
        raise InputError(f"region of interest: radius {radius:g} m, must be above 0")
    return RegionOfInterest(centre_W_m=np.asarray(centre, dtype=np.float64), radius_m=float(radius))
