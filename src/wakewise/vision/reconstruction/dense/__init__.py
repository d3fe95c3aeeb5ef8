"""Dense points: stereo of image pairs, and fusion of depth maps.

- `dense_points.py`: sparse model to dense.ply, by semi-global matching here or by COLMAP's patch-match with CUDA.
- `stereo.py`: rectification and semi-global matching of one pair. `fusion.py`: consistency of depth maps, filtering.
"""
