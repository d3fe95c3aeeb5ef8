"""What PIV sees at the target in a flight, on water made up for the purpose."""

from dataclasses import dataclass

import numpy as np
import pytest

from wakewise.scene.targets import coral, place_on_bed
from wakewise.vision.piv.images import LightSheet
from wakewise_paper.reproduction.piv_flights import FIGURES, NEAR_M, PivRecorder


@dataclass
class Water:
    """A stream of its own, and wash on top, all of one speed."""

    own: tuple[float, float, float]
    wash: tuple[float, float, float]

    def ambient_velocity(self, points):
        """Without the vehicle."""
        return np.broadcast_to(self.own, points.shape)

    def excess_velocity(self, points):
        """What the vehicle adds."""
        return np.broadcast_to(self.wash, points.shape)


class FixedTruth:
    """Has a tank with that water."""

    def __init__(self, water):
        self.tank = type("Tank", (), {"water": water})()


def watch(times=(1.0,)):
    """Over a brain coral on the bed."""
    target = place_on_bed("brain", coral("brain", 0), 1.5)
    sheet = LightSheet(
        centre_W_m=target.centre_W_m,
        right_W=np.array([1.0, 0.0, 0.0]),
        down_W=np.array([0.0, 0.0, 1.0]),
        half_thickness_m=4e-3,
    )
    return PivRecorder(target=target, sheet=sheet, times_s=list(times), rng=np.random.default_rng(0))


def test_wash_in_the_sheet_is_seen_in_a_stream_and_noise_is_told():
    """A tenth of a metre a second of wash in a stream three times as fast: within the noise that it states."""
    piv = watch()
    piv.look(0.5, FixedTruth(Water((0.3, 0.0, 0.0), (0.0, 0.0, 0.1))))
    assert piv.figures() == {}
    piv.look(1.0, FixedTruth(Water((0.3, 0.0, 0.0), (0.0, 0.0, 0.1))))
    found = piv.figures()
    assert tuple(found) == FIGURES
    assert found["piv_speed_m_s"] == pytest.approx(0.1, abs=0.012)
    assert found["piv_true_speed_m_s"] == pytest.approx(0.1, abs=1e-9)
    assert 0.0 < found["piv_floor_m_s"] < 0.02 and found["piv_error_m_s"] < 0.015


def test_without_wash_it_reads_its_own_noise():
    """Which is the floor, not zero."""
    piv = watch()
    piv.look(1.0, FixedTruth(Water((0.05, 0.0, 0.0), (0.0, 0.0, 0.0))))
    found = piv.figures()
    assert found["piv_speed_m_s"] == pytest.approx(found["piv_floor_m_s"], rel=0.5)


def test_places_count_in_the_water_near_the_target_alone():
    """Not inside it, not in the bed, not far off."""
    piv = watch()
    target = piv.target
    top = np.array([*target.centre_W_m[:2], float(target.mesh.vertices_m[:, 2].min())])
    places = np.array([top - [0, 0, 0.02], top - [0, 0, 2 * NEAR_M], target.centre_W_m, np.add(top, [0.0, 0.0, 1.0])])
    assert piv._near(places).tolist() == [True, False, False, False]


def test_each_time_is_looked_at_once():
    """And none twice, however often it is asked."""
    piv = watch((1.0, 2.0))
    still = FixedTruth(Water((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)))
    for at in (1.0, 1.1, 1.2, 2.5, 3.0):
        piv.look(at, still)
    assert len(piv.rows) == 2 and piv.times_s == []
