"""Rendered views against photographs: scores known in closed form, and what is refused."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.ui.cli.main import run
from wakewise.vision.evaluation import SPLAT_DEFINITIONS, VIEW_DEFINITIONS, read_split, score_views
from wakewise.vision.evaluation.rendered_views import psnr_db, ssim


@pytest.fixture
def folders(tmp_path: Path) -> tuple[Path, Path]:
    """Three photographs of grey level 100; views of 110, of the same, and of 100 with one colour at 110."""
    views, photos = tmp_path / "views", tmp_path / "photos"
    views.mkdir()
    photos.mkdir()
    for name in ("a", "b", "c"):
        cv2.imwrite(str(photos / f"{name}.png"), np.full((24, 32, 3), 100, np.uint8))
    cv2.imwrite(str(views / "a.png"), np.full((24, 32, 3), 110, np.uint8))
    cv2.imwrite(str(views / "b.png"), np.full((24, 32, 3), 100, np.uint8))
    one_colour = np.full((24, 32, 3), 100, np.uint8)
    one_colour[..., 2] = 110
    cv2.imwrite(str(views / "c.png"), one_colour)
    return views, photos


def _ssim_of_constants(one: float, two: float) -> float:
    """Without variance only the means are left: (2 m n + C) / (m^2 + n^2 + C), C = 0.01^2."""
    return (2.0 * one * two + 1e-4) / (one**2 + two**2 + 1e-4)


def test_constant_pictures_have_scores_in_closed_form(folders):
    """PSNR of a constant error d is -20 log10(d / 255); of one colour in three 10 log10(3) dB more; of none 120."""
    found = score_views(*folders).per_view
    flat = -20.0 * np.log10(10.0 / 255.0)
    assert found["a.png"].psnr_db == pytest.approx(flat)
    assert found["b.png"].psnr_db == pytest.approx(120.0)
    assert found["c.png"].psnr_db == pytest.approx(flat + 10.0 * np.log10(3.0))
    off = _ssim_of_constants(100.0 / 255.0, 110.0 / 255.0)
    assert found["a.png"].ssim == pytest.approx(off)
    assert found["b.png"].ssim == pytest.approx(1.0)
    assert found["c.png"].ssim == pytest.approx((off + 2.0) / 3.0)


def test_means_and_the_least_are_over_the_views(folders):
    figures = score_views(*folders).figures()
    per_view = figures["per_view"].values()
    assert figures["views"] == 3
    assert figures["psnr_db"] == pytest.approx(np.mean([one["psnr_db"] for one in per_view]))
    assert figures["psnr_min_db"] == min(one["psnr_db"] for one in per_view)
    assert figures["ssim"] == pytest.approx(np.mean([one["ssim"] for one in per_view]))
    assert figures.keys() == VIEW_DEFINITIONS.keys()


def test_noise_of_a_known_variance():
    """PSNR of Gaussian noise is -20 log10(sigma), to its own uncertainty; SSIM falls as it grows."""
    rng = np.random.default_rng(0)
    truth = rng.uniform(0.3, 0.7, (64, 64, 3))
    noisy = [truth + sigma * rng.standard_normal(truth.shape) for sigma in (0.01, 0.1)]
    assert psnr_db(noisy[0], truth) == pytest.approx(40.0, abs=0.2)
    assert psnr_db(noisy[1], truth) == pytest.approx(20.0, abs=0.2)
    assert ssim(noisy[0], truth) > ssim(noisy[1], truth)


def test_lpips_is_null_with_a_reason_without_its_package(folders, monkeypatch):
    monkeypatch.setitem(sys.modules, "lpips", None)
    found = score_views(*folders)
    assert found.figures()["lpips"] is None
    assert "not installed" in found.why["lpips"]


def test_lpips_takes_what_its_package_says(folders, monkeypatch):
    """Where the package is there it gets RGB bytes of both; where its weights cannot be had the reason is said."""

    class Network:
        def __init__(self, net: str, verbose: bool) -> None:
            assert (net, verbose) == ("alex", False)

        def __call__(self, one, two):
            return SimpleNamespace(item=lambda: float(np.abs(one.astype(float) - two)[..., 0].mean()))

    monkeypatch.setitem(sys.modules, "lpips", SimpleNamespace(LPIPS=Network, im2tensor=lambda picture: picture))
    found = score_views(*folders)
    assert [one.lpips for one in found.per_view.values()] == [10.0, 0.0, 10.0]
    assert "lpips" not in found.why

    def offline(**_: object) -> None:
        raise OSError("no network")

    monkeypatch.setitem(sys.modules, "lpips", SimpleNamespace(LPIPS=offline))
    assert "no network" in score_views(*folders).why["lpips"]


def test_pictures_below_the_window_have_no_ssim(tmp_path: Path):
    for name in ("views", "photos"):
        (tmp_path / name).mkdir()
        cv2.imwrite(str(tmp_path / name / "a.png"), np.zeros((10, 40, 3), np.uint8))
    found = score_views(tmp_path / "views", tmp_path / "photos")
    assert found.figures()["ssim"] is None
    assert "11 px" in found.why["ssim"]


def test_each_held_out_photograph_needs_its_view(folders, tmp_path):
    """The split of an export names the photographs; suffixes may differ; a view that is missing is refused."""
    views, photos = folders
    (tmp_path / "export.json").write_text(json.dumps({"split": {"held_out": ["a.jpg", "c.jpg"]}}))
    assert list(score_views(views, photos, read_split(tmp_path / "export.json")).per_view) == ["a.png", "c.png"]
    (views / "c.png").unlink()
    with pytest.raises(InputError, match="no picture c"):
        score_views(views, photos, read_split(tmp_path / "export.json"))
    for text in ("{}", "none", json.dumps({"split": {"held_out": []}})):
        (tmp_path / "export.json").write_text(text)
        with pytest.raises(InputError, match=r"export\.json"):
            read_split(tmp_path / "export.json")


def test_what_cannot_be_compared_is_refused(folders, tmp_path):
    """Another size, other names, no folder, no picture."""
    views, photos = folders
    cv2.imwrite(str(views / "a.png"), np.zeros((24, 30, 3), np.uint8))
    with pytest.raises(InputError, match="30 x 24"):
        score_views(views, photos)
    (views / "a.png").write_bytes(b"no picture")
    with pytest.raises(InputError, match="is no picture"):
        score_views(views, photos)
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match="none of its 0"):
        score_views(tmp_path / "empty", photos)
    with pytest.raises(InputError, match="no folder"):
        score_views(tmp_path / "nowhere", photos)


def test_the_command_prints_each_figure_with_its_definition(folders, capsys):
    """`--json`: the keys of VIEW_DEFINITIONS, with unit, definition, and why one is null."""
    views, photos = folders
    assert run(["evaluate", "--views", str(views), "--photos", str(photos), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert set(found) == {*VIEW_DEFINITIONS, "why", "units", "definitions"}
    assert found["definitions"].keys() == found["units"].keys() == VIEW_DEFINITIONS.keys()
    assert all(found[key] is not None or key in found["why"] for key in VIEW_DEFINITIONS)
    assert run(["evaluate", "--views", str(views), "--photos", str(photos)]) == 0
    assert "psnr_min_db" in capsys.readouterr().out


def test_every_key_is_in_the_docs():
    """docs/photographs.md defines the keys of views and of splats, and those of export.json."""
    page = (Path(__file__).parents[3] / "docs" / "photographs.md").read_text(encoding="utf-8")
    for key in (*VIEW_DEFINITIONS, *SPLAT_DEFINITIONS, "water.attenuation_per_m", "split", "undistorted", "dense"):
        assert f"`{key}`" in page, key
