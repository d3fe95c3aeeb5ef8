"""Simulation of the world: water (`water/`), lattice Boltzmann reference (`lattice/`), tank with vehicle (`tank/`).

It never imports `wake`, `planning` or `control`.
"""
