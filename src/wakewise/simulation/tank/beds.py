"""Beds by name: what lies on them, what moves it, and from which range a world may draw each figure.

- `silt` is what it was from the start: a thin layer of loose 20 um carbonate grains without cohesion. - `fresh-mud` is
  harbour mud that settled hours to days ago. Its threshold grows with its bulk density, 0.037 to 0.305 Pa at 1050 to
  1250 kg/m3 (Witt, Patzke, Nehlsen and Froehle 2024, Front. Mar. Sci. 11, doi 10.3389/fmars.2024.1386081); the value is
  the geometric mean. Load: estimate, 2 cm of it at 250 kg/m3 dry, more than any flight lifts.
- `fluff` is a loose layer of recent deposits on firmer mud: it goes at 0.025 to 0.05 Pa, what lies below it at about
  ten times that (Schaaff, Boyer, El Ganaoui, Amielh and Anselmet 2007, J. Hydraul. Eng. 133, 1087). Load of the fluff:
  estimate, 2 mm (1 to 5) at 50 kg/m3 dry (30 to 60).
- `sand` is carbonate sand, whose threshold, settling and pickup follow from its grain (Soulsby 1997; van Rijn 1984).
  Grains: estimate, fine to medium sand; load: more than any flight lifts.

Mud's grains: estimate, 8 um (5 to 15) quartz and clay, which makes 0.14 m2 of beam attenuation per gram. They settle as
aggregates, which sink six times as fast as the single particles of the same water (Christiansen et al. 2002, J. Marine
Syst. 35, 133, south-western Baltic); a range reaches from single grains, since jets break aggregates, to a millimetre
per second (estimate). Partheniades' M of mud: estimate, within the 1e-5 to 1e-4 kg/m2/s usually taken for silts, and up
to five times that for the softest.
"""

from __future__ import annotations

_PLAIN: dict[str, float | None] = {
    "load_kg_m2": 0.0,
    "suspended_mg_l": 0.0,
    "firm_load_kg_m2": 0.0,
    "threshold_Pa": None,
    "settling_m_s": None,
    "erosion_kg_m2_s": 5e-5,
}
_MUD: dict[str, float | None] = {
    "grain_m": 8e-6,
    "grain_density_kg_m3": 2650.0,
    "settling_m_s": 3e-4,
    "erosion_kg_m2_s": 1e-4,
}
SILTS: dict[str, dict[str, float | None]] = {
    "clear": _PLAIN,
    "silt": _PLAIN | {"load_kg_m2": 0.1, "grain_m": 20e-6, "grain_density_kg_m3": 2710.0},
    # 50 mg/L of ground calcite with a median grain of 0.3 mm. It is sand: it sinks 4 cm/s, the water of a tank 1.5 m
    # deep is clear after 35 s, and no thruster keeps it up. What it tests is sand on the bed, not turbid water.
    "caco3-50mg": _PLAIN | {"suspended_mg_l": 50.0, "grain_m": 3e-4, "grain_density_kg_m3": 2710.0},
    "fresh-mud": _PLAIN | _MUD | {"load_kg_m2": 5.0, "threshold_Pa": 0.106},
    "fluff": _PLAIN | _MUD | {"load_kg_m2": 1.1, "threshold_Pa": 0.035, "firm_load_kg_m2": 1.0},
    "sand": _PLAIN | {"load_kg_m2": 20.0, "grain_m": 2.5e-4, "grain_density_kg_m3": 2710.0},
}
"""Fields that a kind of silt sets, unless they are given as well."""

_MUD_RANGES = {"grain_m": (5e-6, 15e-6), "settling_m_s": (5e-5, 1e-3), "erosion_kg_m2_s": (1e-5, 5e-4)}
SILT_RANGES: dict[str, dict[str, tuple[float, float]]] = {
    "silt": {"load_kg_m2": (0.03, 0.86), "grain_m": (10e-6, 40e-6), "erosion_kg_m2_s": (1e-5, 1e-4)},
    "fresh-mud": _MUD_RANGES | {"threshold_Pa": (0.037, 0.305)},
    "fluff": _MUD_RANGES | {"threshold_Pa": (0.025, 0.05), "load_kg_m2": (1.03, 1.3)},
    "sand": {"grain_m": (1.3e-4, 5e-4)},
}
"""From (low, high) of each figure a world may draw; `load_kg_m2` of fluff counts the firm layer's 1.0 as well."""
