"""Structure from motion: features, matches, registered images and sparse points.

- `features.py`: SIFT features, matching and two-view geometry into COLMAP's database.
- `pairs.py`: which photographs are matched; image retrieval (VLAD).
- `guided_matching.py`: matches along the epipolar lines of roughly known poses.
- `mapping.py`: database to sparse model, filtered, adjusted and aligned. `colmap_mappers.py`: COLMAP's mappers.
- `pose_mapping.py`: bundle adjustment from approximate poses; triangulation at known, fixed poses.
- `per_photo_intrinsics.py`: intrinsics for each photograph, and whether photographs really share theirs.
- `registered_photos.py`: registered photographs as the dense stages use them. `colmap.py`: pycolmap's blocking calls.
"""
