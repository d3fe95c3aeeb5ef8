"""The description for people and programs, whole vehicles and drafts alike."""

import json
from dataclasses import replace

import numpy as np
import pytest

from wakewise.robot.vehicles import (
    VehicleDraft,
    check_report,
    compare_matrix,
    describe,
    draft_names,
    load_draft,
    load_vehicle,
    summary_line,
)


@pytest.fixture(scope="module", params=draft_names())
def draft(request: pytest.FixtureRequest) -> VehicleDraft:
    return load_draft(request.param)


def test_the_description_is_plain_json_that_says_what_matters(draft: VehicleDraft) -> None:
    said = json.loads(json.dumps(describe(draft), allow_nan=False))
    n = len(draft.thrusters)
    assert said["rank"] + len(said["null_space"]) == n
    assert said["under_actuated"] == (said["rank"] < 6)
    assert [t["number"] for t in said["thrusters"]] == list(range(1, n + 1))
    assert said["does_not_claim"]
    assert said["missing"] == list(draft.missing)
    assert np.allclose(np.array(said["allocation_matrix"]), draft.allocation_matrix)


def test_a_whole_vehicle_is_described_like_its_draft() -> None:
    """Notes live in the file alone; all else is the same."""
    vehicle = describe(load_vehicle("bluerov2-heavy"))
    assert vehicle == describe(load_draft("bluerov2-heavy"))


def test_the_heavy_sinks_by_its_published_tenth_of_a_kilogram() -> None:
    assert np.isclose(describe(load_vehicle("bluerov2-heavy"))["trim_N"], -0.980665)
    assert describe(load_vehicle("paper"))["trim_N"] == 0.0
    assert describe(load_draft("orca"))["trim_N"] is None


def test_the_check_holds_the_keys_that_programs_rely_on(draft: VehicleDraft) -> None:
    said = json.loads(json.dumps(check_report(draft), allow_nan=False))
    n = len(draft.thrusters)
    assert said["thrusters"] == n
    assert len(said["failure_rank"]) == n
    assert {"name", "thrusts", "words"} == set(said["null_space"][0])
    assert isinstance(said["mixing_disagreements"], list)
    assert isinstance(said["missing"], list)
    for vector in said["null_space"]:
        assert np.abs(draft.allocation_matrix @ vector["thrusts"]).max() < 1e-6
    assert set(said["achievable_wrench"]) == {"surge", "sway", "heave", "roll", "pitch", "yaw"}


def test_the_matrix_that_a_file_ships_is_compared_unasked() -> None:
    assert len(check_report(load_draft("bluerov2-heavy-wu"))["mixing_disagreements"]) == 12
    rexrov = check_report(load_draft("rexrov"))
    assert (rexrov["mixing"]["agree"], rexrov["mixing_disagreements"]) == (48, [])
    assert check_report(load_draft("orca"))["mixing"] is None


def test_ardusubs_frame_is_named_where_it_fits_whole() -> None:
    said = check_report(load_draft("bluerov2-heavy"))["mixing"]
    assert said["stated_by"] == "ArduSub, frame vectored_6dof (signs)"
    assert (said["compared"], said["agree"]) == (48, 48)


def test_a_given_comparison_is_the_one_reported() -> None:
    paper = load_draft("paper")
    wrong = paper.allocation_matrix.copy()
    wrong[3, 2] *= -1.0
    said = check_report(paper, compare_matrix(paper, wrong, "mine.csv"))
    assert [d["text"] for d in said["mixing_disagreements"]] == [
        "row roll, thruster 3 (rear right horizontal): file says +0.03536, geometry says -0.03536, sign wrong"
    ]


def test_failures_are_told_in_words() -> None:
    words = [f["words"] for f in check_report(load_draft("bluerov2"))["failures"]]
    assert words[0] == "loses no axis, keeps surge 44 %, sway 44 %, yaw 44 %"
    assert words[5] == "loses heave and roll, every other axis as strong as before"


def test_what_limits_would_tell_has_a_reason_when_it_is_missing() -> None:
    orca = load_draft("orca")
    said = check_report(replace(orca, thrusters=tuple(replace(t, max_forward_N=None) for t in orca.thrusters)))
    assert said["achievable_wrench"] is None
    assert said["why"] == {"achievable_wrench": "the thrust limits are not stated"}


def test_one_line_says_whether_it_flies() -> None:
    assert summary_line(load_draft("paper")) == "8 thrusters, rank 6; can fly"
    assert summary_line(load_draft("bluerov2")) == "6 thrusters, rank 5, under-actuated; can fly"
    assert summary_line(load_draft("orca")).startswith("8 thrusters, rank 6; cannot fly, lacks size, displaced")
