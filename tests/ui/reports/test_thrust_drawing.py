"""Drawings of thrust curves: whole, well-formed, and true to the numbers."""

import xml.etree.ElementTree as ET

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.robot.thrusters.thrust_table import library_curve, parse_thrust_table
from wakewise.ui.reports.vehicle.thrust_drawing import curve_svg

SVG = "{http://www.w3.org/2000/svg}"


def test_every_voltage_is_drawn_and_the_chosen_one_last() -> None:
    root = ET.fromstring(curve_svg(library_curve("t200"), 15.0))
    lines = root.findall(f"{SVG}polyline")
    assert len(lines) == 2 * 6
    assert lines[5].get("stroke") == lines[11].get("stroke") != lines[0].get("stroke")
    said = " ".join(element.text or "" for element in root.iter(f"{SVG}text"))
    assert all(f"{voltage:g} V" in said for voltage in (10, 12, 14, 15, 16, 20))
    assert "Blue Robotics" in said


def test_everything_lies_on_the_page() -> None:
    root = ET.fromstring(curve_svg(library_curve("t200"), 16.0))
    for line in root.findall(f"{SVG}polyline"):
        points = np.array([[float(v) for v in pair.split(",")] for pair in line.get("points", "").split()])
        assert np.all((points >= 0.0) & (points <= [980.0, 500.0]))
        # To the right is more pulse or thrust, and the page never runs backwards.
        assert np.all(np.diff(points[:, 0]) >= 0.0)


def test_a_table_without_power_and_with_an_odd_name_is_drawn() -> None:
    text = "supply_V,pwm_us,thrust_N\n12,1100,-20\n12,1500,0\n12,1900,30\n"
    drawing = curve_svg(parse_thrust_table(text, "a<b>&c.csv", "a<b>&c"), 12.0)
    assert "The table has no power." in drawing
    assert len(ET.fromstring(drawing).findall(f"{SVG}polyline")) == 1


def test_a_voltage_outside_the_table_is_refused() -> None:
    with pytest.raises(InputError, match="supply_V = 30"):
        curve_svg(library_curve("t200"), 30.0)
