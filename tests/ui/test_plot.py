"""Plots of flights and allocations: what is drawn is what was flown, in the axes that were given."""

import subprocess
import sys
from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.contour import QuadContourSet

import wakewise as ww
from wakewise.core.errors import InputError
from wakewise.ui import plot


@pytest.fixture(scope="module")
def flights():
    """A second of the preset with each of two methods: of the hover before the first leg."""
    parts = ww.Scenario.preset("quick", seed=1).parts()
    return {method: ww.fly(parts.replace(method=method), duration_s=1.0) for method in ("dp", "wake-aware")}


@pytest.fixture
def ax():
    """Axes of a figure that is closed afterwards."""
    figure, axes = plt.subplots()
    yield axes
    plt.close(figure)


@pytest.fixture(autouse=True)
def closed():
    """No figure stays open."""
    yield
    plt.close("all")


def test_matplotlib_is_imported_with_the_first_plot_and_not_before():
    """`import wakewise` leaves it out; `ww.plot` brings it."""
    there = "print('matplotlib' in sys.modules)"
    code = f"import sys, wakewise as ww; {there}; ww.plot; {there}"
    assert subprocess.check_output([sys.executable, "-c", code], text=True).split() == ["False", "True"]


def test_each_plot_draws_into_the_axes_that_are_given(flights, ax):
    """And returns them."""
    rov = ww.load_vehicle("bluerov2-heavy")
    assert plot.wake_field(rov, np.ones(8), [0, 0, 1, 0, 0, 0], cells=10, ax=ax) is ax
    for draw in (plot.thrusts, plot.null_space, plot.disturbance, plot.wash_energy):
        axes = plt.figure().subplots()
        assert draw(flights["dp"], ax=axes) is axes
        assert axes.get_xlabel()


def test_without_axes_a_new_figure_is_made(flights):
    """A plot is one line."""
    first, second = plot.thrusts(flights["dp"]), plot.thrusts(flights["dp"])
    assert isinstance(first, Axes) and first.figure is not second.figure


@pytest.mark.parametrize(("plane", "labels"), [("horizontal", (1, 0)), ("vertical", (0, 2))])
def test_the_wake_field_is_the_velocity_of_the_package(ax, plane, labels):
    """In each plane the contours hold the speeds that `ww.velocity` has there; north is up, down is down."""
    rov, thrusts_N, pose = ww.load_vehicle("bluerov2-heavy"), np.linspace(-3.0, 3.0, 8), [0.2, -0.1, 1.0, 0.0, 0.0, 0.4]
    plot.wake_field(rov, thrusts_N, pose, plane=plane, cells=12, half_width_m=0.8, region=[[0.5, 0.1, 1.2]], ax=ax)
    (contours,) = (drawn for drawn in ax.collections if isinstance(drawn, QuadContourSet))
    right, up = np.meshgrid(*(np.linspace(-0.8, 0.8, 12) + pose[axis] for axis in labels))
    points = np.tile(pose[:3], (144, 1))
    points[:, labels[0]], points[:, labels[1]] = right.ravel(), up.ravel()
    speeds = 100.0 * np.linalg.norm(ww.velocity(rov, thrusts_N, pose, points), axis=1)
    assert contours.zmax == pytest.approx(speeds.max()) and contours.zmin == pytest.approx(speeds.min())
    assert ax.yaxis_inverted() == (plane == "vertical")


def test_thrusts_are_those_of_the_record(flights, ax):
    """A row for each thruster with the vehicle's names; no row is longer than the flight."""
    flight = flights["wake-aware"]
    plot.thrusts(flight, ax=ax)
    (image,) = ax.images
    recorded = flight.steps.select([f"thrust_{i}_N" for i in range(1, 9)]).to_numpy()
    np.testing.assert_allclose(image.get_array(), recorded.T)
    assert [label.get_text() for label in ax.get_yticklabels()] == [t.name for t in flight.parts.vehicle.thrusters]


def test_thrusts_of_two_flights_can_have_one_scale(flights, ax):
    """`limit_N` is the end of the colour scale; one that is not more than 0 is refused."""
    assert plot.thrusts(flights["dp"], limit_N=3.0, ax=ax).images[0].get_clim() == (-3.0, 3.0)
    with pytest.raises(InputError, match="limit_N: 0, must be finite and more than 0"):
        plot.thrusts(flights["dp"], limit_N=0.0, ax=ax)


def test_null_space_coordinates_are_what_exceeds_the_minimum_norm(flights, ax):
    """The sum of their squares and the squared minimum norm of the same wrench make the squared norm of the thrusts."""
    flight = flights["wake-aware"]
    plot.null_space(flight, ax=ax)
    B = flight.parts.vehicle.allocation_matrix
    thrusts_N = flight.steps.select([f"thrust_{i}_N" for i in range(1, 9)]).to_numpy()
    least = thrusts_N @ B.T @ np.linalg.pinv(B).T
    drawn = [line.get_ydata() for line in ax.lines[: flight.parts.vehicle.null_space.shape[1]]]
    np.testing.assert_allclose(sum(np.square(drawn)) + (least**2).sum(axis=1), (thrusts_N**2).sum(axis=1), atol=1e-9)


def test_disturbance_and_speed_are_columns_of_the_record(flights, ax):
    """D as it is, the speed in mm/s; flights in a list are named by their methods."""
    plot.disturbance(list(flights.values()), ax=ax)
    assert [line.get_label() for line in ax.lines] == ["dp", "wake-aware"]
    np.testing.assert_allclose(ax.lines[0].get_ydata(), flights["dp"].steps["disturbance"].to_numpy())
    speed = plot.disturbance(flights["dp"], measure="speed")
    assert np.nanmax(speed.lines[0].get_ydata()) == pytest.approx(
        1e3 * flights["dp"].steps["target_speed_mean_m_s"].max()
    )


def test_flights_of_one_method_are_told_apart(flights, ax):
    """By their number."""
    plot.disturbance([flights["dp"], flights["dp"]], ax=ax)
    assert [line.get_label() for line in ax.lines] == ["dp 1", "dp 2"]


def test_wash_against_energy_are_the_figures(flights, ax):
    """A point for each flight at its energy and its mean water speed at the target."""
    plot.wash_energy(flights, ax=ax)
    for line, flight in zip(ax.lines, flights.values(), strict=True):
        figures = flight.figures
        assert line.get_xydata().tolist() == [[figures["energy_kJ"], 1e3 * figures["target_speed_mean_m_s"]]]
    assert [text.get_text() for text in ax.texts] == list(flights)


@pytest.mark.parametrize(
    ("draw", "said"),
    [
        (
            lambda flight: plot.disturbance(flight, measure="speeds"),
            "measure: 'speeds', allowed are disturbance, speed",
        ),
        (lambda flight: plot.disturbance({}), "none is given"),
        (lambda flight: plot.disturbance(["dp"]), "must be a Flight"),
        (lambda flight: plot.thrusts("dp"), "must be a Flight"),
        (lambda flight: plot.thrusts(flight, ax=plt.figure()), "must be a Axes"),
        (lambda flight: plot.wake_field(flight.parts.vehicle, np.ones(8), [0] * 6, plane="side"), "plane: 'side'"),
        (lambda flight: plot.film("nothing", colour=True), "no option colour"),
        (lambda flight: plot.film("nothing"), "nothing"),
    ],
)
def test_what_cannot_be_drawn_is_refused_in_one_line(flights, draw, said):
    """With what is wrong and what would be right."""
    with pytest.raises(InputError, match=said) as refused:
        draw(flights["dp"])
    assert "\n" not in str(refused.value)


def test_a_vehicle_without_a_null_space_has_none_to_plot(flights):
    """Five thrusters that each push another way leave nothing to choose."""
    flight = flights["dp"]
    vehicle = flight.parts.vehicle
    five = replace(vehicle, thrusters=tuple(vehicle.thrusters[i] for i in (0, 1, 2, 4, 5)))
    with pytest.raises(InputError, match="5 thrusters leave no null space"):
        plot.null_space(replace(flight, parts=flight.parts.replace(vehicle=five)))
