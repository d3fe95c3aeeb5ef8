"""Flights that find the target with the camera: pictures, estimator, controller and mission.

- `camera_frames.py`: a plant whose measurements have pictures of the camera.
- `camera_estimator.py`: an estimator that localises the vehicle by the map of those pictures.
- `region_controller.py`: a controller whose protected region follows the estimate.
- `find_mission.py`: look, detect, approach, scan and photograph what was missed, without the target's place.
- `missed_parts.py`: coverage of the mapped surface by the photographs, and views of what they missed.
- `found_film.py`: a film of the pictures with the region over them.
- `find_parts.py`: the parts of such a flight, and what it leaves in a trial's folder.
"""

SURFACE_FILE = "found_surface.ply"
"""In a trial's folder, the surface that was mapped in flight, in one colour where photographs saw it well."""
SEEN_RGB, MISSED_RGB = (0.18, 0.55, 0.34), (0.9, 0.6, 0.1)
