"""A neural field (NeRF with hash grids) that is trained on the photographs of a model: views and geometry.

Start reading in `field/` (encoding, rendering, training) and `neural.py` (from a trial or model folder to figures);
`command.py` is `wakewise nerf`. The package needs PyTorch.
"""
