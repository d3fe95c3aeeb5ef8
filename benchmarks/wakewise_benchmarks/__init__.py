"""Benches: speed and quality of one part, side by side with a peer or the readable twin in the same run.

One module per bench, named like it, with `run(options) -> dict` returning the keys that the command prints. Figures
depend on the machine, so no test holds them; `wakewise bench NAME` and `make bench` print them.
"""
