"""A target that has moved is seen where it is, in the colours that it has at rest."""

import numpy as np
import pytest
from imaging_helpers import box, box_scene, view

from wakewise.core.errors import InputError
from wakewise.vision.imaging import ImagingSettings, photograph, render
from wakewise.vision.imaging.photograph import mean_view

SETTINGS = ImagingSettings(width=320, height=240)
SHIFT = np.array([0.012, -0.02, 0.0])


def shifted(scene, way):
    moved = np.tile(np.asarray(way, float), (scene.first_bed_vertex, 1))
    return scene.posed(moved, scene.target_normals.astype(np.float64))


def seen(scene, X_WC, samples=1):
    return render(scene, SETTINGS.camera(), X_WC, SETTINGS.lights(), samples)


def test_a_target_moved_by_nothing_looks_as_before():
    """The same bytes, so that a target in still water costs no photograph its repeatability."""
    scene, X_WC = box_scene(), view()
    here, there = seen(scene, X_WC, 2), seen(shifted(scene, [0.0, 0.0, 0.0]), X_WC, 2)
    np.testing.assert_array_equal(here.radiance, there.radiance)
    np.testing.assert_array_equal(here.depth_m, there.depth_m)


def test_the_texture_goes_along_with_the_target():
    """Seen by a camera that moves along, each point of the target has the colour that it had at rest."""
    scene, X_WC = box_scene(), view()
    lights = ImagingSettings(lamp=0.0).lights()
    along = type(X_WC)(X_WC.p_m + SHIFT, X_WC.q)
    camera = SETTINGS.camera()
    rest = render(scene, camera, X_WC, lights, 1)
    moved = render(shifted(scene, SHIFT), camera, along, lights, 1)
    both = (rest.target_fraction == 1.0) & (moved.target_fraction == 1.0)
    assert both.sum() > 1000
    np.testing.assert_allclose(moved.radiance[both], rest.radiance[both], atol=2e-3)
    # As it would be if the colours stood still in the world, most points would differ by more than a fifth.
    swimming = render(scene, camera, along, lights, 1)
    still = both & (swimming.target_fraction == 1.0)
    apart = np.abs(swimming.radiance[still] - rest.radiance[still]).max(axis=1) / rest.radiance[still].max(axis=1)
    assert np.median(apart) > 0.1


def test_the_target_is_seen_where_it_is():
    """Its outline moves by the shift, what it uncovers shows the bed, and posing it again starts from rest."""
    scene, X_WC = box_scene(), view()
    moved = seen(shifted(scene, SHIFT), X_WC)
    again = seen(shifted(shifted(scene, [0.05, 0.0, 0.0]), SHIFT), X_WC)
    np.testing.assert_array_equal(moved.target_fraction, again.target_fraction)
    camera, middle = SETTINGS.camera(), box().centre_W_m
    rows, columns = np.nonzero(moved.target_fraction)
    before_rows, before_columns = np.nonzero(seen(scene, X_WC).target_fraction)
    went = np.array([columns.mean() - before_columns.mean(), rows.mean() - before_rows.mean()])
    there, here = (camera.project(X_WC.inverse().apply(point[None]))[0] for point in (middle + SHIFT, middle))
    np.testing.assert_allclose(went, there - here, atol=1.5)
    assert np.isfinite(moved.depth_m[before_rows, before_columns]).all()


def test_a_moving_target_is_the_mean_of_where_it_was():
    """Several scenes of an exposure give the mean of their light, and the photograph shows the smear."""
    scene, X_WC = box_scene(), view()
    scenes = [shifted(scene, [0.0, y, 0.0]) for y in (-0.004, 0.0, 0.004)]
    views = [seen(each, X_WC) for each in scenes]
    mean = mean_view(views)
    np.testing.assert_allclose(mean.radiance, sum(v.radiance.astype(float) for v in views) / 3, atol=1e-6)
    np.testing.assert_array_equal(mean.depth_m, views[1].depth_m)
    camera = SETTINGS.camera()
    sharp, smeared = (
        photograph(what, camera, [X_WC], None, SETTINGS, np.random.default_rng(1)).sharpness for what in (scene, scenes)
    )
    assert smeared < 0.7 * sharp


def test_moves_that_do_not_fit_are_refused():
    """One row for each vertex of the target."""
    with pytest.raises(InputError, match="moves"):
        box_scene().posed(np.zeros((3, 3)), np.zeros((3, 3)))
