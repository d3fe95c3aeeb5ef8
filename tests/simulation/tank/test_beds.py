"""Beds by name: what each is made of, and the range from which a world may draw it."""

import numpy as np
import pytest
from pydantic import ValidationError

from wakewise.simulation.tank.grains import STRESS_INTENSITY
from wakewise.simulation.tank.sediment import SiltProperties
from wakewise.simulation.tank.settings import SILTS, SiltSettings

_MUD_RANGES = {"grain_m": (5e-6, 15e-6), "settling_m_s": (5e-5, 1e-3), "erosion_kg_m2_s": (1e-5, 5e-4)}
SILT_RANGES: dict[str, dict[str, tuple[float, float]]] = {
    "silt": {"load_kg_m2": (0.03, 0.86), "grain_m": (10e-6, 40e-6), "erosion_kg_m2_s": (1e-5, 1e-4)},
    "fresh-mud": _MUD_RANGES | {"threshold_Pa": (0.037, 0.305)},
    "fluff": _MUD_RANGES | {"threshold_Pa": (0.025, 0.05), "load_kg_m2": (1.03, 1.3)},
    "sand": {"grain_m": (1.3e-4, 5e-4)},
}
"""From (low, high) of each figure a world may draw; `load_kg_m2` of fluff counts the firm layer's 1.0 as well."""


@pytest.mark.parametrize("kind", list(SILTS))
def test_every_bed_is_named_and_says_all_that_another_may_have_said(kind):
    """Settings know every kind, and each sets the same figures, so that nothing of another kind is left over."""
    settings = SiltSettings(kind=kind)
    for field, value in SILTS[kind].items():
        assert getattr(settings, field) == value
    plain = set(SILTS["clear"])
    assert plain <= set(SILTS[kind])


@pytest.mark.parametrize("kind", list(SILT_RANGES))
def test_values_lie_in_their_ranges(kind):
    """Each figure of a bed lies within the range from which a world draws it, whose ends settings allow."""
    for field, (low, high) in SILT_RANGES[kind].items():
        assert low < high
        assert low <= getattr(SiltSettings(kind=kind), field) <= high
        for end in (low, high):
            assert getattr(SiltSettings(kind=kind, **{field: end}), field) == end


def test_fluff_moves_before_mud_and_mud_before_its_firm_layer():
    """The order of strengths is fluff, fresh mud, firm mud; loose grains of sand need more than fluff."""
    fluff, mud, sand = (SiltSettings(kind=kind) for kind in ("fluff", "fresh-mud", "sand"))
    assert fluff.threshold_Pa < mud.threshold_Pa < 10 * fluff.threshold_Pa
    laws = SiltProperties.of(sand.grain_m, sand.grain_density_kg_m3, 1000.0, sand.erosion_kg_m2_s)
    assert laws.sand
    assert fluff.threshold_Pa < laws.threshold_Pa


def test_fluff_is_gone_where_its_firm_layer_is_not():
    """Under 0.1 Pa the fluff erodes and the layer below it does not, even with its turbulence."""
    bed = SiltSettings(kind="fluff")
    laws = SiltProperties.of(
        bed.grain_m, bed.grain_density_kg_m3, 1000.0, bed.erosion_kg_m2_s, bed.threshold_Pa,
        stress_intensity=STRESS_INTENSITY, firm_kg_m2=bed.consolidated_load_kg_m2,
    )  # fmt: skip
    loose, firm = laws.lifted_kg_m2_s(np.array([0.1, 0.1]), np.array([1.1, 1.0]))
    assert firm < 1e-3 * loose


def test_a_firm_part_is_a_part():
    """A firm layer heavier than the whole bed is refused."""
    with pytest.raises(ValidationError, match="consolidated_load_kg_m2: 2, is a part of load_kg_m2"):
        SiltSettings(load_kg_m2=1.0, consolidated_load_kg_m2=2.0)
