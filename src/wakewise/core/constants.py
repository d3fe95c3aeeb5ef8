"""Constants that several packages compute with, each in one place."""

GRAVITY_M_S2 = 9.80665
"""Standard gravity (3rd CGPM, 1901)."""

FRESH_WATER_KG_M3 = 998.0
"""Density in the laws and measurements of jets: the paper's fresh water at 20-21 deg C (CRC Handbook: 998.2 at 20)."""

TRIM_WATER_KG_M3 = 1000.0
"""Density that vehicles are trimmed in and the tank is filled with if nothing else is said.

It is the round figure in which makers and the literature state buoyancy and added mass, 0.2 % off the jets' water: that
changes a jet's speed by 0.1 %, far below what any wake model knows, whereas a tank of 998 would sink every vehicle by
0.2 % of its weight.
"""
