"""Links: from the tank to the programs and vehicles that people have; the only room that knows pymavlink.

`exports/` writes what a flight was into files that other tools open, `logs/` reads what real vehicles recorded. Plain
arrays and paths come in; who reads a trial's folder is `trials`.
"""
