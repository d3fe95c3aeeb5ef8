"""Flights of a real vehicle: the loop, parts and record of every flight, joined to the output gate.

The loop runs from the first messages of the vehicle to the end of the session, so that the estimate has converged when
the operator consents. While the pilot flies, the controller rests, the estimator gets the servo outputs, and the goal
is the current pose; each engagement starts from there. A step belongs to the engagement in which its goal was
requested; thrusts of another engagement are not sent (`wakewise_ardusub.link.output_gate`).

- `session.py`: from a connection to a flight; the protected region. Read this first.
- `vehicle_flight.py`: a scenario's parts joined to the vehicle. `vehicle_plant.py`: plant and world. `engagement.py`:
  pilot, controller and estimator that take turns with the pilot. `link_thread.py`: reception of messages.
- `wash_figures.py`: disturbance, savings and coverage for ground stations. `warm_up.py`: the chain, run without output.
- `boxed_target.py`: the target that is designated by a box in the picture. `video_stream.py`, `video_tracking.py`:
  the camera's stream, in which it is mapped and tracked.
- `camera_mount.py`: the joint that tilts the camera.
- `cameras.py`: cameras of the session.
"""
