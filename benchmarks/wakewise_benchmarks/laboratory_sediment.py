"""Laboratory measurements of suspended sediment, and what they say of the law that the tank's silt follows.

Tran et al. 2024 (doi 10.5281/zenodo.12819148): mixtures of mud and sand at known concentrations. The file is MATLAB's
7.3, an HDF5 file of the oldest kind, of which this reads no more than it needs, so that no library is needed for it.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.simulation.tank import beam_attenuation_per_m

BASE = 512
"""A MATLAB 7.3 file is HDF5 after this many bytes."""
BACKSCATTER_RATIO = 0.018
"""Particulate backscatter over scatter of mineral grains (Petzold 1972)."""
QUARTZ_KG_M3 = 2650.0

_Entry = tuple[str, int, tuple[int, int] | None]


def _entries(data: bytes, tree: int, heap: int) -> Iterator[_Entry]:
    """Names and object headers of an HDF5 group of the oldest kind (symbol table)."""
    (names,) = struct.unpack_from("<Q", data, BASE + heap + 24)
    level, used = struct.unpack_from("<BH", data, BASE + tree + 5)
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


def _doubles(data: bytes, header: int) -> Array:
    """Doubles of a dataset, stored inside its header or in one piece elsewhere."""
    at = BASE + header
    (size,) = struct.unpack_from("<I", data, at + 8)
    at += 16
    end = at + size
    while at < end:
        kind, length = struct.unpack_from("<HH", data, at)
        if kind == 8:
            version, layout = struct.unpack_from("<BB", data, at + 8)
            if version != 3 or layout not in (0, 1):
                break
            if layout == 0:
                (count,) = struct.unpack_from("<H", data, at + 10)
                return np.frombuffer(data, dtype="<f8", count=count // 8, offset=at + 12)
            where, count = struct.unpack_from("<QQ", data, at + 10)
            return np.frombuffer(data, dtype="<f8", count=count // 8, offset=BASE + where)
        at += 8 + length
    raise ValueError("a dataset without a layout that is read here")


def read_samples(path: Path) -> Array:
    """Concentration in kg/m3, backscatter at 532 nm in 1/m and turbidity in NTU, shape (3, 10, 6).

    Ten mixtures of six samples each. Raises InputError if the file is not that one.
    """
    data = path.read_bytes()
    try:
        if data[BASE : BASE + 8] != b"\x89HDF\r\n\x1a\n":
            raise ValueError("no HDF5")
        root = struct.unpack_from("<QQ", data, BASE + 56 + 24)
        groups = {name: scratch for name, _, scratch in _entries(data, *root)}
        group = groups["all"]
        if group is None:
            raise ValueError("a group without a table")
        sets = {name: _doubles(data, header) for name, header, _ in _entries(data, *group)}
        found = np.stack([1e-3 * sets["C"], sets["hydro2"], sets["wet"]])
        return found.reshape(3, 10, 6)
    except (ValueError, KeyError, struct.error) as fault:
        raise InputError(f"{path}: not the laboratory's MATLAB 7.3 file ({fault})") from fault


def mass_exponents(samples: Array) -> tuple[Array, Array]:
    """Exponent of backscatter and of turbidity with mass, per mixture, both shape (2, 10), and the scatter about 1.

    The second is the standard deviation of the logarithm of signal over mass. Samples that are not finite are left out.
    """
    exponents, scatter = np.empty((2, 10)), np.empty((2, 10))
    for row, signal in enumerate(samples[1:]):
        for k, (mass, seen) in enumerate(zip(samples[0], signal, strict=True)):
            good = np.isfinite(mass) & np.isfinite(seen)
            exponents[row, k] = np.polyfit(np.log(mass[good]), np.log(seen[good]), 1)[0]
            scatter[row, k] = np.std(np.log(seen[good] / mass[good]))
    return exponents, scatter


def grain_sizes_m(samples: Array) -> Array:
    """Grain by c = 3 C / (rho d) that each mixture's backscatter has, shape (10,)."""
    C, backscatter, _ = samples
    per_mass = np.nanmedian(backscatter / C, axis=1) / BACKSCATTER_RATIO
    one_metre = float(beam_attenuation_per_m(1.0, 1.0, QUARTZ_KG_M3))
    return np.asarray(one_metre / per_mass)
