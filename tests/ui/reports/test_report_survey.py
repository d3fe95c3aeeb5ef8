"""What a report says of a survey's flight."""

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

from wakewise.ui.reports.media import found_html


def test_a_survey_tells_its_orbits_and_not_that_no_target_was_found(tmp_path: Path) -> None:
    """A survey has no single target: the parts that got an orbit are told, and what was seen well."""
    seen = {"seen_well_pct": 97.0, "unseen_pct": 1.0, "poorly_pct": 1.0, "seldom_pct": 1.0, "photographs": 100.0}
    told = {"found_s": 0.0, "accepted_s": 0.0, "centre_W_m": None, "radius_m": None, "centre_std_m": None}
    trial = cast("Any", SimpleNamespace(folder=tmp_path))
    (tmp_path / "found.json").write_text(json.dumps(told), encoding="utf-8")
    assert "No target was found" in found_html(trial)
    survey = told | {"orbits": [[0.0, 0.0, 2.0, 40.0]] * 4, "replanned_ms": 90.0, "photographed": seen}
    (tmp_path / "found.json").write_text(json.dumps(survey), encoding="utf-8")
    words = found_html(trial)
    assert "No target" not in words
    assert "close orbits round 4 parts" in words
    assert "97" in words


def test_a_target_tells_when_it_was_found_and_when_accepted(tmp_path: Path) -> None:
    """Both times are told; of what was never accepted, or never found, just that."""
    trial = cast("Any", SimpleNamespace(folder=tmp_path))
    centre = {"centre_W_m": [0.0, 0.0, 1.0], "radius_m": 0.1, "centre_std_m": 0.005}
    nothing = dict.fromkeys(centre)
    for told, words in (
        ({"found_s": 4.9, "accepted_s": 17.2, **centre}, "found after 4.90 s, and accepted after 17.2 s."),
        ({"found_s": 4.9, **centre}, "found after 4.90 s."),
        ({"found_s": 4.9, "accepted_s": None, **nothing}, "A target was found and not accepted."),
        ({"found_s": None, "accepted_s": None, **nothing}, "No target was found."),
    ):
        (tmp_path / "found.json").write_text(json.dumps(told), encoding="utf-8")
        assert words in found_html(trial)
