"""Slow surveys on stock ArduSub: lines at an altitude above the bed, flown by GUIDED targets.

- `survey_plan.py`: lines, their order and headings, and the speed along them.
- `map_files.py`: lines of a GeoJSON or KML file.
- `bed_following.py`: from a late and noisy rangefinder to a depth that keeps the altitude.
- `hold_current.py`: the current that a vehicle holds its place against.
- `survey_safety.py`: what ends a survey, as one pure function.
- `transect_session.py`: consent, targets at 10 Hz, pause, and the end in the firmware's own hold. Read this first.
"""
