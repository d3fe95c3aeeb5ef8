"""Small trials made by hand, whose truth and estimates differ by what is known."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import polars as pl

from wakewise.core.geometry import quat_from_euler
from wakewise.scene.targets import Mesh, coral, write_mesh

POSE = ("x_m", "y_m", "z_m", "qw", "qx", "qy", "qz")
TWIST = ("u_m_s", "v_m_s", "w_m_s", "p_rad_s", "q_rad_s", "r_rad_s")
WRENCH = ("X_N", "Y_N", "Z_N", "K_Nm", "M_Nm", "N_Nm")


@cache
def target_mesh() -> Mesh:
    """The target of all of them."""
    return coral("brain", 1)


def make_trial(folder: Path, seed: int = 1, thrusters: int = 3, photographs: int = 2, real: bool = False) -> Path:
    """A flight of six steps, estimates 1 cm north of the truth; of a real vehicle nobody knows that."""
    (folder / "images").mkdir(parents=True)
    n = 6
    steps: dict[str, object] = {"time_s": np.arange(n) * 0.02}
    turns = np.array([quat_from_euler(0.02, -0.01, 0.1 * k + seed) for k in range(n)])
    for who, north in (("true", 0.0), ("est", 0.01), ("goal", 0.0)):
        places = np.column_stack([np.arange(n) * 0.1 + north, np.full(n, 0.5), np.full(n, 1.2)])
        state = np.column_stack([places, turns, np.full((n, 6), 0.01 * seed)])
        if real and who == "true":
            state[:] = np.nan
        steps |= {f"{who}_{what}": column for what, column in zip((*POSE, *TWIST), state.T, strict=True)}
    for k in range(thrusters):
        steps[f"thrust_{k + 1}_N"] = np.full(n, np.nan if real else 0.9 * k)
        steps[f"command_{k + 1}_N"] = np.full(n, 1.0 * k)
    steps |= {f"wrench_{axis}": np.ones(n) for axis in WRENCH} | {f"load_{axis}": np.zeros(n) for axis in WRENCH}
    steps |= {"disturbance": np.full(n, 1e-4), "target_speed_mean_m_s": np.full(n, np.nan if real else 0.004)}
    steps |= {"power_W": np.full(n, np.nan if real else 30.0), "new_secret_m": np.full(n, np.nan if real else 5.0)}
    steps |= {"exposing": np.arange(n) < photographs, "collision": np.zeros(n, bool)}
    steps |= {"fallback": [""] * n, "leg": ["orbit"] * n}
    pl.DataFrame(steps).write_parquet(folder / "steps.parquet")
    rng = np.random.default_rng(seed)
    lines = [
        "name,time_s," + ",".join(f"{w}_{p}" for w in ("est", "true") for p in POSE) + ",sharpness,turbidity_per_m"
    ]
    for k in range(photographs):
        cv2.imwrite(str(folder / "images" / f"{k:03}.png"), rng.integers(0, 255, (6, 8, 3), np.uint8))
        true = "," * 7 if real else ",0.1,0.5,1.2,1,0,0,0"
        lines.append(f"{k:03}.png,{0.02 * k},0.11,0.5,1.2,1,0,0,0{true},{seed},{'' if real else 0.2}")
    (folder / "images.csv").write_text("\n".join(lines) + "\n")
    (folder / "cameras.txt").write_text("1 OPENCV 8 6 9.5 9.5 4 3 0.01 0 0 0\n")
    kind = "/home/somebody/reef scans/coral.ply" if seed == 2 else "brain"
    (folder / "scenario.yaml").write_text(
        f"# wakewise 0.1.0\nname: quick\nseed: {seed}\nmethod: {'dp' if seed % 2 else 'wake-aware'}\nvehicle: paper\n"
        f"pilot: route\nworld: payload\ntarget:\n  kind: {kind}\n"
    )
    if not real:
        write_mesh(folder / "truth.ply", target_mesh())
        camera = {"width": 8, "height": 6, "fx": 9.0, "fy": 9.0, "cx": 4.0, "cy": 3.0}
        (folder / "camera.json").write_text(json.dumps(camera))
        (folder / "metrics.json").write_text(
            json.dumps({"rmse_mm": 0.5 + seed, "success": True, "why": {}, "seed": seed})
        )
    return folder
