"""The study of worlds: what each method leaves of every world of the library (`wakewise bench worlds`).

- `bench.py`: which flights and scans are made, and the answer of the command. `flight.py`: one flight, one scan.
- `lattice_comparison.py`: the same hovers in the tank and in the lattice.
"""
