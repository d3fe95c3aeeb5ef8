"""LED panels: fall-off as Lambert's law and the squared distance have it, and shade where something is between."""

import numpy as np
import pytest
from imaging_helpers import BED_Z, R_BC, box_scene
from scipy.integrate import dblquad

from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose, look_at
from wakewise.vision.imaging import LedPanels, Lights, PinholeCamera, render

DOWN = np.array([[0.0, 0.0, -1.0]])


def test_irradiance_is_the_integral_over_the_panels():
    """Level and tilted points get the integral of cos cos / (pi r^2) over the panels' faces, within 1 %."""
    panels = LedPanels.over_tank(6.0, 5.0)
    tilted = np.array([[0.6, 0.0, -0.8]])
    for point, normal in (((0.0, 0.0, 1.5), DOWN), ((0.9, -0.4, 1.45), DOWN), ((0.1, 0.2, 1.4), tilted)):
        place = np.array([point])

        def spot(y, x, place=place, normal=normal):
            way = np.array([x, y, 0.0]) - place[0]
            r2 = way @ way
            return max(way @ normal[0], 0.0) * max(-way[2], 0.0) / (np.pi * r2 * r2)

        expected = sum(
            dblquad(spot, cx - 0.3, cx + 0.3, cy - 0.15, cy + 0.15, epsrel=1e-4)[0] for cx, cy, _ in panels.centres_W_m
        )
        assert panels.irradiance(place, normal)[0] == pytest.approx(expected, rel=0.01)


def test_the_scene_is_lit_to_one_at_the_foot_and_less_farther_out():
    """Open bed near the foot gets 1, 2 m out where no panel is above clearly less; behind the box there is shade."""
    scene = box_scene()
    bed = np.unique(scene.faces[scene.first_face[1] : scene.first_face[2]])
    x, y, light = *scene.vertices_F_m[bed, :2].T, scene.panel_light[bed, 0]
    r = np.hypot(x, y)
    assert light[(r > 0.25) & (r < 0.4)].mean() == pytest.approx(1.0, abs=0.1)
    assert light[(r > 5.0) & (r < 6.0)].mean() < 0.2
    beside = (np.abs(x) < 0.075) & (np.abs(y) < 0.065) & ((np.abs(x) > 0.062) | (np.abs(y) > 0.052))
    assert 0.2 < light[beside].mean() < 0.9


def test_light_of_panels_adds_to_the_skys():
    """A picture under both is the sum of the pictures under either."""
    camera, none = PinholeCamera(64, 48, 1.0), np.zeros((0, 3))
    X_WC = Pose.from_matrix(look_at([0.4, 0.0, BED_Z - 0.3], [0, 0, BED_Z]) @ R_BC, np.array([0.4, 0.0, BED_Z - 0.3]))
    one, other, both = (
        render(box_scene(), camera, X_WC, Lights(ambient=a, panels=p, lamp=0.0, lamps_C_m=none)).radiance
        for a, p in ((0.4, 0.0), (0.0, 0.6), (0.4, 0.6))
    )
    assert np.allclose(one + other, both, atol=1e-5)
    assert other.max() > 0.05


def test_bad_panels_are_refused():
    """A panel without a face raises InputError; no panel at all gives no light."""
    with pytest.raises(InputError, match="panels"):
        LedPanels(centres_W_m=np.zeros((1, 3)), size_m=(0.0, 0.3))
    assert LedPanels(centres_W_m=np.zeros((0, 3))).irradiance(np.array([[0.0, 0.0, 1.0]]), DOWN)[0] == 0.0
