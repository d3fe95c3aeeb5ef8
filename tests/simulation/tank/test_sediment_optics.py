"""The optics of silt against turbidity and backscatter measured in the laboratory."""

import os
from pathlib import Path

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.simulation.tank import beam_attenuation_per_m
from wakewise_benchmarks.laboratory_sediment import QUARTZ_KG_M3, grain_sizes_m, mass_exponents, read_samples

DATA = Path(os.environ.get("WAKEWISE_DATA", Path(__file__).parents[4] / "shared" / "data"))
FILE = DATA / "sediment_turbidity" / "All.mat"


@pytest.fixture(scope="module")
def samples():
    """Concentration, backscatter and turbidity of ten mixtures of six samples each."""
    if not FILE.exists():
        pytest.skip(f"{FILE.name} of the reference data is not there")
    return read_samples(FILE)


def test_a_file_of_another_kind_is_refused(tmp_path):
    """Text under the laboratory's name is no HDF5."""
    (tmp_path / "All.mat").write_text("nothing of the kind" * 99)
    with pytest.raises(InputError, match=r"MATLAB 7\.3"):
        read_samples(tmp_path / "All.mat")


def test_attenuation_is_proportional_to_mass(samples):
    """Backscatter and turbidity of a mixture go with its mass as the law has it: median exponents 0.98 and 0.92.

    A mixture scatters about its own proportion by 10 % in the median, and by 60 % in the worst case: sand alone, of
    which part is on the bottom and not in the beam.
    """
    exponents, scatter = mass_exponents(samples)
    assert np.median(exponents[0]) == pytest.approx(1.0, abs=0.05)
    assert np.median(exponents[1]) == pytest.approx(1.0, abs=0.10)
    assert np.median(scatter) < 0.12
    assert scatter.max() < 0.60
    C = samples[0]
    law = beam_attenuation_per_m(C[0], 20e-6, QUARTZ_KG_M3)
    assert np.polyfit(np.log(C[0]), np.log(law), 1)[0] == pytest.approx(1.0, abs=1e-12)


def test_the_law_finds_the_laboratorys_grain_sizes(samples):
    """Backscatter over 0.018 is an attenuation whose grain, by c = 3 C / (rho d), is silt for mud and sand for sand.

    Both series run from mud alone to mostly sand: the law gives 9 um for mud, 27 and 51 um for the sandiest, rising all
    the way. A factor of two is what the backscatter ratio leaves open.
    """
    grains_m = grain_sizes_m(samples)
    assert 4e-6 < grains_m[0] < 20e-6
    assert 25e-6 < grains_m[-1] < 120e-6
    for first in (0, 5):
        assert np.all(np.diff(grains_m[first : first + 5]) > 0.0)
