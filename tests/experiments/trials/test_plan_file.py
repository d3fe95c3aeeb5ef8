"""The plan on disk names the photographs as they will be stored."""

import csv

import pytest

from wakewise.operation import load_scenario
from wakewise.operation.trial_folder import write_plan


@pytest.mark.parametrize(("photo_format", "suffix"), [("png", ".png"), ("jpeg", ".jpg")])
def test_planned_names_are_those_of_the_photographs(tmp_path, photo_format, suffix):
    """planned.csv lists 000, 001, ... with the suffix of the format that the scenario asks for."""
    scenario = load_scenario("quick", None, {"imaging.photo_format": photo_format})
    parts = scenario.parts()
    write_plan(parts, tmp_path)
    with (tmp_path / "planned.csv").open(encoding="utf-8") as file:
        names = [row["name"] for row in csv.DictReader(file)]
    assert names == [f"{k:03d}{suffix}" for k in range(len(parts.route.exposure_names))]
