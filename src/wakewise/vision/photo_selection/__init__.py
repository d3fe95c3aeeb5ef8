"""Photographs of a dive matched to its log: clock offset from motion, sharp photographs at even steps of the track.

- `dive_track.py`: poses of the vehicle against time, from a table or a log; read this first.
- `photo_times.py`: when each photograph was taken. `picture_statistics.py`: motion, sharpness, brightness of pictures.
- `clock_offset.py`: the offset of two clocks by cross-correlation of predicted and measured image motion.
- `spacing.py`: which photographs are chosen. `pick.py`: all of it together, and the files.
"""
