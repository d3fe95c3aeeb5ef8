"""Simulation: the truth. Water (`water/`), lattice Boltzmann reference (`lattice/`), the tank (`tank/`).

It never imports wake, planning or control.
"""
