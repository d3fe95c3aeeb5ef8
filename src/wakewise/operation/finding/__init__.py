"""Flights that find the target with the camera: pictures, estimator, controller and mission.

- `camera_frames.py`: a plant whose measurements have pictures of the camera.
- `camera_estimator.py`: an estimator that localises the vehicle by the map of those pictures.
- `region_controller.py`: a controller whose protected region follows the estimate.
- `find_mission.py`: look, detect, approach and scan, without the target's place.
- `find_parts.py`: the parts of such a flight, and what it leaves in a trial's folder.
"""
