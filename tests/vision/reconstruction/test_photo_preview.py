"""A look at photographs: what is blurred, dark, alone or far from the others is said."""

import shutil

import cv2
import numpy as np
import pytest

from wakewise.ui.reports.photo_preview import look_page
from wakewise.vision.reconstruction.quality.photo_preview import matches, preview_pairs, preview_photos
from wakewise.vision.reconstruction.settings import ReconstructionSettings
from wakewise.vision.reconstruction.sfm.features import photo_features


@pytest.fixture(scope="module")
def looked(relief_photos, tmp_path_factory):
    folder = tmp_path_factory.mktemp("look")
    for path in relief_photos[0].iterdir():
        shutil.copy(path, folder / path.name)
    image = cv2.imread(str(folder / "02.png"))
    cv2.imwrite(str(folder / "02.png"), cv2.GaussianBlur(image, (0, 0), 3.0))
    dark = cv2.imread(str(folder / "04.png"))
    cv2.imwrite(str(folder / "04.png"), (0.04 * dark).astype(np.uint8))
    noise = np.random.default_rng(0).integers(0, 255, (240, 320, 3), dtype=np.uint8)
    cv2.imwrite(str(folder / "99.png"), cv2.GaussianBlur(noise, (0, 0), 1.0))
    (folder / "dive.mp4").write_bytes(b"a film beside them")
    return preview_photos(folder)


def test_each_fault_is_told_of_its_photo(looked):
    """The blurred, the dark and the stranger, and none of the others."""
    look, _ = looked
    faults = {photo.name: " ".join(photo.faults) for photo in look.photos}
    assert "blurred" in faults["02.png"]
    assert "too dark" in faults["04.png"]
    assert "overlaps no other photo" in faults["99.png"]
    assert not any("blurred" in faults[name] for name in ("00.png", "01.png", "03.png", "05.png"))
    assert look.groups[0] >= 5
    assert look.photos[6].group != look.photos[0].group
    assert any("02.png" in line for line in look.advice)
    assert look.passed_over == {"video": 1}
    good = look.photos[0]
    assert len(good.partners) >= 3
    assert good.covered_pct > 50.0
    assert look.photos[6].covered_pct == 0.0


def test_the_page_shows_all_and_needs_no_network(looked):
    """Each photograph with its figures, those to shoot again first, nothing from elsewhere."""
    look, thumbs = looked
    page = look_page(look, thumbs, "a <dive>")
    assert page.count('class="photo') == len(look.photos)
    assert page.index("02.png") < page.index("To look at again") or page.index("To look at again") < page.index(
        "00.png"
    )
    assert "a &lt;dive&gt;" in page
    assert "<dive>" not in page
    assert "http://" not in page.replace("http://www.w3.org", "")
    assert "1 of video" in page


def test_matches_are_of_one_geometry(relief_photos):
    """Neighbours share many features, a picture and noise none; many photos are not all compared with all."""
    folder, _ = relief_photos
    settings = ReconstructionSettings(max_features=400, first_octave=0)
    one, two = (photo_features(cv2.imread(str(folder / name)), settings) for name in ("00.png", "01.png"))
    assert len(matches(one, two)) > 30
    noise = np.random.default_rng(0).integers(0, 255, (240, 320, 3), dtype=np.uint8)
    assert len(matches(one, photo_features(noise, settings))) == 0
    tiny = np.random.default_rng(0).normal(size=(300, 20))
    pairs = preview_pairs(tiny / np.linalg.norm(tiny, axis=1, keepdims=True))
    assert len(pairs) == 1600
    assert {(0, 1), (0, 4), (298, 299)} <= set(pairs)
    assert preview_pairs(tiny[:4]) == [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)]
