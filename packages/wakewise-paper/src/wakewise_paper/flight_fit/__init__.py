"""Our jet calibrated in place, from minutes of flight: what the camera sees of drifting flakes, and no truth.

Start reading in `flake_tracks.py` (flakes that were found again in the next frame, as pixels), `flake_likelihood.py`
(width and strength of the jets by the likelihood of those pixels, each flake's depth unknown) and `curve.py` (flights
in a world, and the error against minutes).
"""
