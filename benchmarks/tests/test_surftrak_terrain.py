"""The public terrains of SURFTRAK under a survey."""

from __future__ import annotations

import pytest

from wakewise_benchmarks.surftrak_terrain import DEPTH_M, SPEED_M_S, TERRAINS, ReplayedTerrain, surftrak_figures


def test_a_terrain_repeats_with_its_heights() -> None:
    """The trapezoid is 5 m high, rises by 0.2 m/s at 0.1 m/s, and begins again after 90 s."""
    bed = ReplayedTerrain(corners=TERRAINS["trapezoid"], depth_m=DEPTH_M)
    at = [bed.bed_m(SPEED_M_S * seconds, 0.0) for seconds in (10.0, 30.0, 31.0, 55.0, 100.0)]
    assert at == pytest.approx([20.0, 18.0, 17.8, 15.0, 20.0])


@pytest.mark.slow
def test_a_step_of_a_metre_is_followed() -> None:
    """1.2 m over the sawtooth's step: the error is that of the step, and does not last."""
    found = surftrak_figures("sawtooth", 1.2)
    assert found["finished"]
    assert 5.0 < found["altitude_rms_cm"] < 80.0
    assert found["altitude_p95_cm"] < 115.0
