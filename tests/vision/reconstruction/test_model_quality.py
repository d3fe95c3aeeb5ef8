"""A model is trusted only with every figure in its bounds, and each reason not to is a line with its figure."""

from dataclasses import replace

import pytest

from wakewise.vision.reconstruction.quality.model_quality import (
    ModelEvidence,
    known_pose_warnings,
    quality_warnings,
    registration_warnings,
)

SOUND = ModelEvidence(
    observations_per_photo=400.0, coverage_pct=60.0, angle_deg=20.0, agreeing_pairs_pct=100.0, held_out_px=0.6
)


def test_a_sound_model_is_not_doubted():
    """Nor one of which something could not be looked into."""
    assert quality_warnings(SOUND, uncut_px=0.6, cut_pct=5.0) == []
    assert quality_warnings(replace(SOUND, agreeing_pairs_pct=None, held_out_px=None), uncut_px=0.6, cut_pct=5.0) == []


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"observations_per_photo": 38.0}, "a photo sees 38 points"),
        ({"coverage_pct": 4.0}, "points cover 4 %"),
        ({"angle_deg": 1.8}, "rays meet at 1.8 deg"),
        ({"agreeing_pairs_pct": 43.0}, "43 % of the pairs"),
        ({"held_out_px": 2.5}, "points are 2.5 px off"),
    ],
)
def test_each_figure_out_of_bounds_is_a_reason_of_its_own(change, words):
    """One figure, one line, which holds the figure."""
    (line,) = quality_warnings(replace(SOUND, **change), uncut_px=0.6, cut_pct=5.0)
    assert line.startswith(words) and "\n" not in line


@pytest.mark.parametrize(("uncut_px", "cut_pct"), [(1.3, 5.0), (0.6, 31.0)])
def test_what_was_cut_away_is_told(uncut_px, cut_pct):
    """A small error after cutting half of the observations is none."""
    (line,) = quality_warnings(SOUND, uncut_px=uncut_px, cut_pct=cut_pct)
    assert f"{uncut_px:.2f} px and {cut_pct:.0f} %" in line


@pytest.mark.parametrize(("registered", "doubted"), [(12, False), (6, False), (5, True)])
def test_a_model_of_less_than_half_of_the_photos_is_doubted(registered, doubted):
    """Of twelve, six are half."""
    assert bool(registration_warnings(registered, 12)) is doubted


def test_cameras_that_were_given_are_doubted_where_the_photos_disagree():
    """Features or pairs that do not fit, and photos that tell nothing at all."""
    assert known_pose_warnings(SOUND, error_px=0.6, kept_pct=90.0) == []
    assert "39 % of the matched features" in known_pose_warnings(SOUND, error_px=0.6, kept_pct=39.0)[0]
    assert "nothing in the photos confirms" in known_pose_warnings(SOUND, error_px=0.6, kept_pct=None)[0]
    assert len(known_pose_warnings(replace(SOUND, agreeing_pairs_pct=30.0), error_px=1.54, kept_pct=39.0)) == 3
