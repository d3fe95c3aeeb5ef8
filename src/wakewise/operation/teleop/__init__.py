"""Teleoperation: an operator's inputs become goals, with assists, in flights without a fixed end.

- `input/`: sources of the inputs. `operator_state.py`: the operator's settings.
- `assisted.py`: the pilot from inputs to goals. `motion.py`: its motion reference. `arbitration.py`: the reference by
  sticks, with camera on the target and collision limits. `resumable_mission.py`: a mission that can be interrupted.
- `target_tracking.py`: the target that the pilot designates in live pictures. `region_methods.py`: the flight's methods
  for a protected region that may change.
- `human_pilot.py`: simulated operators.
- `live.py`: real-time flights, their photographs and folders. `replay.py`: flights from recorded inputs.
"""
