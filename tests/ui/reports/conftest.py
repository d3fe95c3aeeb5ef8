"""A made-up trial folder, so that the report can be tested before and without a flight; nothing here is a result."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import cv2
import numpy as np
import polars as pl
import pytest
import trimesh
import yaml

from wakewise.core.geometry import Pose, look_at

BED_Z_M = 1.5
CENTRE_W_M = np.array([0.0, 0.0, BED_Z_M - 0.08])
THRUSTERS = 8
# Camera C (x right, y down, z forward) in a body whose x axis looks forward.
R_BC = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])

UNKNOWN = {"turbidity_mean_per_m": "the made-up trial has no silt record"}
DEFINITIONS = {
    "rmse_mm": "Root mean square distance from model points to the true surface, capped.",
    "completeness_pct": "Share of the true surface with a model point within 3 mm.",
    "target_speed_mean_m_s": "Mean excess water speed on the target, over the flow without thrusters.",
}


def _target(rng: np.random.Generator) -> trimesh.Trimesh:
    """A knobbly ball of 16 cm, standing on the bed, in world NED."""
    mesh = trimesh.creation.icosphere(subdivisions=3, radius=0.08)
    knobs = rng.normal(size=(9, 3))
    knobs /= np.linalg.norm(knobs, axis=1, keepdims=True)
    directions = np.asarray(mesh.vertices) / 0.08
    bump = 1.0 + 0.28 * np.exp(-((1.0 - directions @ knobs.T) / 0.06)).max(axis=1)
    vertices = np.asarray(mesh.vertices) * bump[:, None]
    vertices[:, 2] += BED_Z_M - vertices[:, 2].max()
    return trimesh.Trimesh(vertices, mesh.faces, process=False)


def _photograph(rng: np.random.Generator, haze: float, angle_rad: float) -> np.ndarray:
    """A grainy blob on grainy sand under haze, shape (240, 320, 3), BGR."""
    sand = cv2.GaussianBlur(rng.normal(0, 1, (240, 320)).astype(np.float32), (0, 0), 1.2) * 90 + 130
    rows, columns = np.mgrid[:240, :320]
    u, v = columns - 160 - 20 * np.cos(angle_rad), rows - 130
    blob = np.clip(1.4 - np.hypot(u / 62, v / 56), 0, 1)[..., None]
    texture = cv2.GaussianBlur(rng.normal(0, 1, (240, 320)).astype(np.float32), (0, 0), 2.0)[..., None]
    coral = np.array([60.0, 110.0, 190.0]) + 160 * texture
    image = sand[..., None] * np.array([0.75, 0.95, 0.9]) * (1 - blob) + coral * blob
    water = np.array([120.0, 105.0, 40.0])
    return np.clip(image * (1 - haze) + water * haze, 0, 255).astype(np.uint8)


def make_trial(folder: Path, *, seed: int = 7, wash: float = 1.0, method: str = "wake-aware") -> Path:
    """Write a trial folder with every part that a report reads; `wash` scales the speed of the water at the target."""
    rng = np.random.default_rng(seed)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "images").mkdir(exist_ok=True)
    duration_s, dt_s = 60.0, 0.1
    time_s = np.arange(0.0, duration_s, dt_s)
    layers_deg = (20.0, 40.0, 60.0)
    layer = np.minimum((time_s / duration_s * 3).astype(int), 2)
    elevation = np.deg2rad(np.interp(time_s, [0, 18, 22, 38, 42, 60], np.repeat(layers_deg, 2)))
    azimuth = 2 * np.pi * 3 * time_s / duration_s
    away = np.stack([np.cos(azimuth) * np.cos(elevation), np.sin(azimuth) * np.cos(elevation), -np.sin(elevation)], 1)
    goal = CENTRE_W_M + 0.55 * away
    true = goal + 0.006 * np.stack([np.sin(0.9 * time_s + k) for k in range(3)], 1)
    estimated = true + rng.normal(0, 0.002, true.shape)
    body = [Pose.from_matrix(look_at(p, CENTRE_W_M), p) for p in true]
    q_WB = np.array([pose.q for pose in body])

    columns: dict[str, object] = {"time_s": time_s}
    for prefix, p in (("true", true), ("est", estimated), ("goal", goal)):
        columns |= {f"{prefix}_{axis}_m": p[:, i] for i, axis in enumerate("xyz")}
        columns |= {f"{prefix}_q{axis}": q_WB[:, i] for i, axis in enumerate("wxyz")}
    for i in range(THRUSTERS):
        thrust = 6 * np.sin(0.35 * time_s + i) + rng.normal(0, 1.0, len(time_s))
        columns[f"thrust_{i + 1}_N"] = thrust
        columns[f"command_{i + 1}_N"] = thrust
    exposing = np.zeros(len(time_s), bool)
    shots = np.arange(20, len(time_s) - 20, 40)
    exposing[shots] = True
    speed = wash * (0.012 + 0.008 * np.sin(0.2 * time_s) ** 2 + 0.004 * rng.random(len(time_s)))
    turbidity = 0.3 + 0.004 * time_s + 0.05 * rng.random(len(time_s))
    columns |= {
        "disturbance": 40 * speed**2,
        "target_speed_mean_m_s": speed,
        "target_speed_p95_m_s": 2.2 * speed,
        "bed_speed_p95_m_s": 1.6 * speed,
        "turbidity_per_m": turbidity,
        "power_W": 40 + 10 * rng.random(len(time_s)),
        "exposing": exposing,
        "collision": np.zeros(len(time_s), bool),
        "fallback": [""] * len(time_s),
        "leg": [
            f"orbit {layers_deg[k]:.0f} deg" if k == layer[max(i - 1, 0)] else "transit" for i, k in enumerate(layer)
        ],
    }
    pl.DataFrame(columns).write_parquet(folder / "steps.parquet")

    rows, planned = [], []
    for k, i in enumerate(shots):
        name = f"{k:04d}.png"
        haze = float(np.clip(0.15 + 0.5 * k / len(shots) + 0.05 * rng.random(), 0, 0.9))
        cv2.imwrite(str(folder / "images" / name), _photograph(rng, haze, float(azimuth[i])))
        X_WC = Pose.from_matrix(body[i].R @ R_BC, true[i])
        desired = Pose.from_matrix(look_at(goal[i], CENTRE_W_M) @ R_BC, goal[i])
        row: dict[str, object] = {"name": name, "time_s": time_s[i]}
        for prefix in ("est", "true"):
            row |= {f"{prefix}_{axis}_m": X_WC.p_m[j] for j, axis in enumerate("xyz")}
            row |= {f"{prefix}_q{axis}": X_WC.q[j] for j, axis in enumerate("wxyz")}
        rows.append(row | {"sharpness": 220 * (1 - haze) + 10 * rng.random(), "turbidity_per_m": turbidity[i]})
        planned.append(
            {"name": name}
            | {f"{axis}_m": desired.p_m[j] for j, axis in enumerate("xyz")}
            | {f"q{axis}": desired.q[j] for j, axis in enumerate("wxyz")}
        )
    pl.DataFrame(rows).write_csv(folder / "images.csv")
    pl.DataFrame(planned).write_csv(folder / "planned.csv")

    truth = _target(rng)
    truth.export(folder / "truth.ply")
    points, faces = trimesh.sample.sample_surface(truth, 12_000, seed=seed)
    seen = points[:, 2] < BED_Z_M - 0.025
    noise = rng.normal(0, 0.0007, len(points)) * (1 + 3 * (points[:, 0] > 0.03))
    cloud = (points + noise[:, None] * truth.face_normals[faces])[seen]
    trimesh.PointCloud(cloud).export(folder / "dense.ply")
    model = truth.copy()
    model.vertices = model.vertices + rng.normal(0, 0.0006, model.vertices.shape)
    model.export(folder / "mesh.ply")

    write_metrics(
        folder,
        rmse_mm=1.42,
        completeness_pct=88.6,
        success=True,
        method=method,
        seed=seed,
        target_speed_mean_m_s=float(speed.mean()),
        target_speed_p95_m_s=float(np.quantile(2.2 * speed, 0.95)),
        disturbance=float((40 * speed**2).mean()),
    )
    scenario = {
        "seed": seed,
        "vehicle": "paper",
        "method": method,
        "tank": {"silt": {"load_kg_m2": 0.02}, "size_m": [6, 5, 1.5]},
        "versions": {"wakewise": "0.1.0"},
    }
    (folder / "scenario.yaml").write_text(yaml.safe_dump(scenario, sort_keys=False), encoding="utf-8")
    return folder


def write_metrics(folder: Path, **changes: object) -> None:
    """Write metrics.json with the keys of a scan, some replaced."""
    values: dict[str, object] = {
        "rmse_mm": None, "rmse_cap_mm": 20.0, "accuracy_median_mm": 0.61, "completeness_pct": None,
        "completeness_visible_pct": 94.0, "completeness_1mm_pct": 62.0, "completeness_2mm_pct": 81.0, "f_score": 0.91,
        "features_per_image": 2412.0, "inlier_matches": 51234, "registered_images": 14, "images": 14, "success": False,
        "exposure_speed_mean_m_s": 0.011, "bed_speed_p95_m_s": 0.031, "turbidity_mean_per_m": None,
        "position_rmse_mm": 7.3, "path_rmse_mm": 6.1, "velocity_deviation_pct": 4.0, "roll_pitch_rms_deg": 0.8,
        "energy_kJ": 5.4, "sign_flips_per_s": 1.2, "duration_s": 60.0, "solve_ms_median": 0.21, "solve_ms_p99": 0.4,
        "fallbacks": 0, "collisions": 0, "wall_s": 75.0, "cpu_s": 121.0,
    }  # fmt: skip
    values |= changes
    why = {key: UNKNOWN.get(key, "reconstruction failed") for key, value in values.items() if value is None}
    text = json.dumps(values | {"why": why, "definitions": DEFINITIONS})
    (folder / "metrics.json").write_text(text, encoding="utf-8")


@pytest.fixture(scope="session", autouse=True)
def small_views() -> Iterator[None]:
    """Render small pictures: what is tested does not depend on their size."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("wakewise.ui.reports.model.VIEW_PIXELS", 48)
        patch.setattr("wakewise.ui.reports.compare.VIEW_PIXELS", 48)
        patch.setattr("wakewise.ui.reports.model.PIXELS", 48)
        yield


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Figures are put together, but not drawn: for what a page says in words."""
    monkeypatch.setattr("wakewise.ui.reports.svg_style.inline_svg", lambda *_: "<svg></svg>")


@pytest.fixture(scope="session")
def made_up(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A whole made-up trial; read only."""
    return make_trial(tmp_path_factory.mktemp("trials") / "wake-aware")


@pytest.fixture(scope="session")
def report_text(made_up: Path) -> str:
    """The report of the whole made-up trial."""
    from wakewise.ui.reports import write_report

    return write_report(made_up).read_text(encoding="utf-8")


@pytest.fixture
def new_metrics() -> Callable[..., None]:
    """Replace metrics.json of a made-up trial, with changes."""
    return write_metrics


if __name__ == "__main__":
    print(make_trial(Path(sys.argv[1]), method="dp", wash=2.5, seed=3))
