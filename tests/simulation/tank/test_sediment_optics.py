"""The optics of silt against turbidity and backscatter measured in the laboratory.

Tran et al. 2024 (doi 10.5281/zenodo.12819148): mixtures of mud and sand at known concentrations.
"""

import os
import struct
from pathlib import Path

import numpy as np
import pytest

from wakewise.simulation.tank import beam_attenuation_per_m

DATA = Path(os.environ.get("WAKEWISE_DATA", Path(__file__).parents[4] / "shared" / "data"))
FILE = DATA / "sediment_turbidity" / "All.mat"
BASE = 512  # a MATLAB 7.3 file is HDF5 after this many bytes
BACKSCATTER_RATIO = 0.018  # of mineral grains: particulate backscatter over scatter (Petzold 1972)
QUARTZ_KG_M3 = 2650.0


def _entries(data, tree, heap):
    """Names and object headers of an HDF5 group of the oldest kind (symbol table)."""
    (names,) = struct.unpack_from("<Q", data, BASE + heap + 24)
    (level, used) = struct.unpack_from("<BH", data, BASE + tree + 5)
    for k in range(used):
        (child,) = struct.unpack_from("<Q", data, BASE + tree + 32 + 16 * k)
        if level:
            yield from _entries(data, child, heap)
            continue
        (symbols,) = struct.unpack_from("<H", data, BASE + child + 6)
        for i in range(symbols):
            at = BASE + child + 8 + 40 * i
            name, header, cached = struct.unpack_from("<QQI", data, at)
            start = BASE + names + name
            scratch = struct.unpack_from("<QQ", data, at + 24) if cached == 1 else None
            yield data[start : data.index(b"\0", start)].decode(), header, scratch


def _doubles(data, header):
    """Doubles of a dataset, stored inside its header or in one piece elsewhere."""
    at = BASE + header
    (size,) = struct.unpack_from("<I", data, at + 8)
    at += 16
    end = at + size
    while at < end:
        kind, length = struct.unpack_from("<HH", data, at)
        if kind == 8:
            version, layout = struct.unpack_from("<BB", data, at + 8)
            assert version == 3
            if layout == 0:
                (count,) = struct.unpack_from("<H", data, at + 10)
                return np.frombuffer(data, dtype="<f8", count=count // 8, offset=at + 12)
            assert layout == 1
            where, count = struct.unpack_from("<QQ", data, at + 10)
            return np.frombuffer(data, dtype="<f8", count=count // 8, offset=BASE + where)
        at += 8 + length
    raise AssertionError("no layout")


@pytest.fixture(scope="module")
def samples():
    """Concentration in kg/m3, backscatter at 532 nm in 1/m and turbidity in NTU, ten mixtures of six samples each."""
    if not FILE.exists():
        pytest.skip(f"{FILE.name} of the reference data is not there")
    data = FILE.read_bytes()
    assert data[BASE : BASE + 8] == b"\x89HDF\r\n\x1a\n"
    root = struct.unpack_from("<QQ", data, BASE + 56 + 24)
    groups = {name: scratch for name, _, scratch in _entries(data, *root)}
    sets = {name: _doubles(data, header) for name, header, _ in _entries(data, *groups["all"])}
    found = np.stack([1e-3 * sets["C"], sets["hydro2"], sets["wet"]])
    assert found.shape == (3, 60)
    return found.reshape(3, 10, 6)


def test_attenuation_is_proportional_to_mass(samples):
    """Backscatter and turbidity of a mixture go with its mass as the law has it: median exponents 0.98 and 0.92.

    A mixture scatters about its own proportion by 10 % in the median, and by 60 % in the worst case: sand alone, of
    which part is on the bottom and not in the beam.
    """
    C = samples[0]
    exponents, scatter = [], []
    for signal in samples[1:]:
        for mass, seen in zip(C, signal, strict=True):
            good = np.isfinite(mass) & np.isfinite(seen)
            exponents.append(np.polyfit(np.log(mass[good]), np.log(seen[good]), 1)[0])
            scatter.append(np.std(np.log(seen[good] / mass[good])))
    assert np.median(exponents[:10]) == pytest.approx(1.0, abs=0.05)
    assert np.median(exponents[10:]) == pytest.approx(1.0, abs=0.10)
    assert np.median(scatter) < 0.12
    assert max(scatter) < 0.60
    law = beam_attenuation_per_m(C[0], 20e-6, QUARTZ_KG_M3)
    assert np.polyfit(np.log(C[0]), np.log(law), 1)[0] == pytest.approx(1.0, abs=1e-12)


def test_the_law_finds_the_laboratorys_grain_sizes(samples):
    """Backscatter over 0.018 is an attenuation whose grain, by c = 3 C / (rho d), is silt for mud and sand for sand.

    Both series run from mud alone to mostly sand: the law gives 9 um for mud, 27 and 51 um for the sandiest, rising all
    the way. A factor of two is what the backscatter ratio leaves open.
    """
    C, backscatter, _ = samples
    per_mass = np.nanmedian(backscatter / C, axis=1) / BACKSCATTER_RATIO
    grains_m = 1.0 / (per_mass / beam_attenuation_per_m(1.0, 1.0, QUARTZ_KG_M3))
    assert 4e-6 < grains_m[0] < 20e-6
    assert 25e-6 < grains_m[-1] < 120e-6
    for first in (0, 5):
        assert np.all(np.diff(grains_m[first : first + 5]) > 0.0)
