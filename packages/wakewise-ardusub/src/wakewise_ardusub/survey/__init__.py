"""Slow surveys on ArduSub: lines and orbits at an altitude above the bed, by GUIDED targets or allocated thrusts.

- `survey_plan.py`: lines, their order and headings, and the speed along them.
- `orbit_plan.py`: circles round a centre, their direction and ways to them.
- `map_files.py`: lines of a GeoJSON or KML file.
- `bed_following.py`: from a late and noisy rangefinder to a depth that keeps the altitude.
- `guided_messages.py`: the targets, as ArduSub's GUIDED takes them.
- `hold_current.py`: the current that a vehicle holds its place against.
- `survey_safety.py`: what ends a survey, as one pure function.
- `survey_figures.py`: what a survey came to.
- `allocated_session.py`: the same survey by thrusts through the script; `survey_control.py`: its controller;
  `moving_region.py`: the bed that it spares, under and ahead of the vehicle.
- `transect_session.py`: consent, targets at 10 Hz, pause, and the end in the firmware's own hold. Read this first.
"""
