"""What comes in: photographs, masks, films, intrinsics and known cameras.

- `photo_folder.py`: the photographs of a folder, checked and decoded once; what EXIF says of the camera.
- `masks.py`: which pixels are used. `video_frames.py`: sharp frames of a film.
- `lenses.py`: intrinsics and distortion (OPENCV, OPENCV_FISHEYE). `lens_groups.py`: which photographs share intrinsics.
- `calibration.py`: intrinsics from a ChArUco board. `known_cameras.py`: poses and intrinsics from files.
"""
