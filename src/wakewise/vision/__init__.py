"""Vision: rendered photographs, photogrammetry, texture, scores and particle image velocimetry.

- `imaging/`: the simulated camera. `reconstruction/`: photographs to 3D models. `texturing/`: colours of models.
- `evaluation/`: scores of models, views and flights. `piv/`: particle image velocimetry.
- `photo_selection/`: photographs matched to a dive's log and picked along its track.
- `image_decoding.py`: pictures of bytes and files, after a check of their size.
"""
