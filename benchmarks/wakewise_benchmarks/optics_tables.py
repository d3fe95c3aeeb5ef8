"""The water types' coefficients for red, green and blue, averaged anew from the published spectra.

Solonenko and Mobley 2015 (doi 10.1364/AO.54.005392) give absorption, scattering and the attenuation of daylight by
wavelength; 28 cameras' spectral sensitivities (J. Jiang et al. 2013, doi 10.1109/WACV.2013.6475015) weigh them.
"""

from __future__ import annotations

import csv
from collections import defaultdict
from pathlib import Path

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.vision.imaging.optics import BACKSCATTER_RATIO, water_optics, water_types


def band_errors(folder: Path) -> dict[str, float]:
    """Largest difference of each shipped coefficient from the published spectra's average, over all water types.

    `folder` holds camspec_database.csv and solonenko2015_iop.csv. Returns signal_per_m, veil_per_m, backscatter_per_m
    and veil. Raises InputError if a table does not hold what it should.
    """
    with (folder / "camspec_database.csv").open(encoding="utf-8") as file:
        rows = list(csv.reader(file))
    with (folder / "solonenko2015_iop.csv").open(encoding="utf-8") as file:
        values = list(csv.DictReader(file))
    try:
        nm = np.array(rows[0][2:], dtype=float)
        curves = {band: [np.array(r[2:], dtype=float) for r in rows[1:] if r[1] == band] for band in "RGB"}
        spectra: dict[tuple[str, str], dict[float, float]] = defaultdict(dict)
        for row in values:
            if row["value_per_m"]:
                spectra[row["water_type"], row["quantity"]][float(row["wavelength_nm"])] = float(row["value_per_m"])
    except (IndexError, KeyError, ValueError) as fault:
        raise InputError(f"{folder}: its tables are not the published ones ({fault})") from fault
    sensitivity = [np.mean([c / c.max() for c in curves[band]], axis=0) for band in "RGB"]

    def spectrum(kind: str, quantity: str) -> Array:
        table = spectra[kind, quantity]
        if not table:
            raise InputError(f"{folder}: no {quantity} of water type {kind}")
        return np.interp(nm, sorted(table), [table[w] for w in sorted(table)])

    worst = dict.fromkeys(("signal_per_m", "veil_per_m", "backscatter_per_m", "veil"), 0.0)
    for kind in water_types():
        a, b, daylight = spectrum(kind, "a"), spectrum(kind, "b"), np.exp(-spectrum(kind, "Kd"))
        back = BACKSCATTER_RATIO * b
        veil, kept = 0.33 * back / (a + back), np.exp(-0.5 * (a + b))
        water = water_optics(kind)
        for k in range(3):
            w = sensitivity[k] * daylight
            stated = {
                "signal_per_m": -2 * np.log((w @ kept) / w.sum()),
                "veil_per_m": -2 * np.log(((w * veil) @ kept) / (w @ veil)),
                "backscatter_per_m": (w @ back) / w.sum(),
                "veil": (w @ veil) / w.sum(),
            }
            for name, value in stated.items():
                worst[name] = max(worst[name], float(abs(getattr(water, name)[k] - value)))
    return worst
