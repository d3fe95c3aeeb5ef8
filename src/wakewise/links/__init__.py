"""Links: from the tank to the programs and vehicles that people have.

`exports/` writes what a flight was into files that other tools open. Plain arrays and paths come in; who reads a
trial's folder is `trials`.
"""
