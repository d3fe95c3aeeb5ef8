"""The whole way to a field's surface on a small sphere, what a second run skips, and what is said when it cannot be."""

import json

import numpy as np
import pytest
from analytic_sphere import RADIUS, REGION, photograph
from pydantic import ValidationError

from wakewise.core import optional_dependencies
from wakewise.core.errors import InputError
from wakewise.ui.cli.main import run
from wakewise.vision.reconstruction import read_cloud
from wakewise.vision.reconstruction.outputs.meshing import FIGURES
from wakewise_nerf.field import PROFILES, FieldSettings, build_field, pick_device, profile

SHORT = FieldSettings(
    levels=4,
    table_log2=12,
    coarsest=8,
    finest=48,
    steps=80,
    rays=2048,
    samples_per_step=2**13,
    samples=24,
    occupancy=16,
    warmup_steps=20,
    grid_rate=0.05,
    network_rate=0.02,
    last_rate=0.1,
    checkpoint_every=40,
    agreeing_views=1,
    threads=1,
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return photograph(tmp_path_factory.mktemp("sphere") / "model", over=2)


def said(capsys, code, *words):
    """One line on standard error for a command that must fail."""
    assert run([str(w) for w in words]) == code
    out, err = capsys.readouterr()
    assert out == ""
    assert len(err.strip().splitlines()) == 1
    return err


def test_gpu_profile_is_the_papers():
    """L = 16, T = 2^19, F = 2, N from 16, 10,000 steps of 2^18 points; the CPU's is smaller in all and says so."""
    gpu, cpu = PROFILES["gpu"], PROFILES["cpu"]
    assert (gpu.levels, gpu.table_log2, gpu.features, gpu.coarsest, gpu.steps) == (16, 19, 2, 16, 10_000)
    assert gpu.samples_per_step == 2**18
    assert cpu.levels == 8 and 15 <= cpu.table_log2 <= 17 and 500 <= cpu.steps <= 1000 and 512 <= cpu.rays <= 1024
    with pytest.raises(InputError, match="--profile tpu: there is no such profile; allowed are cpu, gpu"):
        profile("tpu")
    with pytest.raises(ValidationError, match="less than or equal to 32"):
        FieldSettings(levels=50)


def test_missing_torch_is_one_line_with_the_remedy(folder, capsys, monkeypatch):
    """Exit code 2, and what to install."""
    monkeypatch.setattr(optional_dependencies, "_is_here", lambda module: module != "torch")
    line = said(capsys, 2, "nerf", folder)
    assert line.startswith("wakewise: wakewise nerf needs torch, which is not installed: pip install -e '.[nerf]'")


def test_what_cannot_be_is_one_line(folder, tmp_path, capsys):
    """CUDA that is not there, an unknown device, a folder without a model, a region that is none: exit code 2."""
    torch = pytest.importorskip("torch", reason="needs the extra `nerf` (PyTorch)")
    if not torch.cuda.is_available():
        assert "--device cuda: " in said(capsys, 2, "nerf", folder, "--device", "cuda")
    assert "allowed are auto, cpu, cuda" in said(capsys, 2, "nerf", folder, "--device", "tpu")
    assert "holds no model (sparse/images.bin is missing)" in said(capsys, 2, "nerf", tmp_path, "--device", "cpu")
    assert "must be four numbers X,Y,Z,R" in said(capsys, 2, "nerf", folder, "--device", "cpu", "--region", "1,2,3")
    assert "radius 0 m" in said(capsys, 2, "nerf", folder, "--device", "cpu", "--region", "1,2,3,0")
    assert "allowed are cpu, gpu" in said(capsys, 2, "nerf", folder, "--device", "cpu", "--profile", "tpu")
    assert "--photos must name" in said(capsys, 2, "nerf", folder, "--device", "cpu", "--photos", tmp_path)


def test_stages_leave_files_and_are_skipped_when_done(folder, tmp_path):
    """Points lie about the sphere; a second run does nothing and says the same; another number of steps trains anew."""
    pytest.importorskip("torch", reason="needs the extra `nerf` (PyTorch)")
    first = build_field(folder, folder / "images", tmp_path, SHORT, region=REGION, device="cpu")
    assert first["skipped"] == [] and first["why"] == {}
    assert (first["train_views"], first["held_out_views"]) == (21, 3)
    assert first["psnr_db"] > 15.0 and first["psnr_min_db"] <= first["psnr_db"]
    assert sorted(p.name for p in (tmp_path / "views").iterdir()) == ["001.png", "009.png", "017.png"]
    cloud = read_cloud(tmp_path / "points.ply")
    assert len(cloud.points_m) == first["points"] > 100
    assert np.linalg.norm(cloud.points_m, axis=1).max() < 1.05
    above = cloud.points_m[cloud.points_m[:, 2] < 0.3]
    assert np.median(np.abs(np.linalg.norm(above, axis=1) - RADIUS)) < 0.2
    assert (tmp_path / "mesh.ply").stat().st_size > 1000 and first["mesh_faces"] > 50
    assert json.loads((tmp_path / "field.json").read_text()) == first
    again = build_field(folder, folder / "images", tmp_path, SHORT, region=REGION, device="cpu")
    assert again["skipped"] == ["train", "views", "points", "mesh"]
    assert {k: v for k, v in again.items() if k not in ("skipped", "wall_s")} == {
        k: v for k, v in first.items() if k not in ("skipped", "wall_s")
    }
    (tmp_path / "points.ply").unlink()
    points = build_field(folder, folder / "images", tmp_path, SHORT, region=REGION, device="cpu", mesh=False)
    assert points["skipped"] == ["train", "views"]
    assert points["why"] == dict.fromkeys(FIGURES, "no mesh was asked for")
    np.testing.assert_array_equal(read_cloud(tmp_path / "points.ply").points_m, cloud.points_m)
    fewer = SHORT.model_copy(update={"steps": 20})
    assert build_field(folder, folder / "images", tmp_path, fewer, region=REGION, device="cpu")["skipped"] == []


def test_device_is_chosen_by_name():
    """Auto takes CUDA where there is one, and the CPU where not."""
    torch = pytest.importorskip("torch", reason="needs the extra `nerf` (PyTorch)")
    assert pick_device("cpu").type == "cpu"
    assert pick_device("auto").type == ("cuda" if torch.cuda.is_available() else "cpu")
