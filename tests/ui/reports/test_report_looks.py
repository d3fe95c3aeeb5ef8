"""Laws of what the report shows for people: the film inside, photographs in pairs, the model in its own colours."""

from __future__ import annotations

import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
import trimesh

from wakewise.ui.reports import media, write_comparison
from wakewise.ui.reports.media import coloured_model, colours_html, film_html
from wakewise.ui.reports.report import report_page
from wakewise.ui.reports.trial import read_trial
from wakewise.vision.texturing.textured import y_up_vertices

pytestmark = pytest.mark.usefixtures("undrawn")


@pytest.fixture
def own(made_up: Path, tmp_path: Path) -> Path:
    """A copy of the made-up trial that a test may change."""
    folder = tmp_path / "own"
    shutil.copytree(made_up, folder)
    return folder


def test_a_film_is_inside_the_page_unless_it_is_too_large(own: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No film, no frame; a small one is embedded, a large one is named; WebP is a picture, MP4 a video."""
    assert film_html(read_trial(own)) == ""
    (own / "film.webp").write_bytes(b"RIFF....WEBP")
    assert 'src="data:image/webp;base64,' in film_html(read_trial(own))
    (own / "film.mp4").write_bytes(b"0" * 100)
    assert "<video controls" in film_html(read_trial(own))
    monkeypatch.setattr(media, "MOST_FILM_BYTES", 50)
    assert 'src="film.mp4"' in film_html(read_trial(own))


def test_photographs_stand_beside_their_corrected_selves(own: Path) -> None:
    """Three pairs; without a model the page says that it is no physics; without pictures there is nothing."""
    html = colours_html(read_trial(own))
    assert html.count("as taken") == 3 * 3  # shown words, read words and the enlarged picture's
    assert "no physics" in html
    shutil.rmtree(own / "images")
    assert colours_html(read_trial(own)) == ""


def test_the_coloured_model_is_where_the_model_is(own: Path) -> None:
    """What mesh.glb holds in its own axes is back in the world's; a broken file leaves the report without it."""
    trial = read_trial(own)
    assert coloured_model(trial) is None
    mesh = trimesh.load(own / "mesh.ply", process=False)
    there = trimesh.Trimesh(y_up_vertices(np.asarray(mesh.vertices), trial.bed_z_m), mesh.faces, process=False)
    there.visual = trimesh.visual.TextureVisuals(material=trimesh.visual.material.PBRMaterial())
    there.visual.vertex_attributes["color"] = np.tile(np.array([100, 50, 25, 255], np.uint8), (len(there.vertices), 1))
    (own / "mesh.glb").write_bytes(trimesh.Scene({"model": there}).export(file_type="glb", include_normals=True))
    found = coloured_model(trial)
    assert found is not None
    assert np.allclose(found[0].vertices_m, mesh.vertices, atol=1e-5)
    assert np.all((found[1] > 0.2) & (found[1] < 0.8))
    assert "Likeness" in report_page(trial)
    (own / "mesh.glb").write_bytes(b"broken")
    assert coloured_model(trial) is None


def test_rows_beside_a_comparison_are_shown(made_up: Path, tmp_path: Path) -> None:
    """With rows.png in the folder the page has the section, without it not."""
    trials = {"dp": made_up, "wake-aware": made_up}
    assert 'id="rows"' not in write_comparison(trials, tmp_path).read_text(encoding="utf-8")
    cv2.imwrite(str(tmp_path / "rows.png"), np.full((60, 90, 3), 120, np.uint8))
    assert 'id="rows"' in write_comparison(trials, tmp_path).read_text(encoding="utf-8")
