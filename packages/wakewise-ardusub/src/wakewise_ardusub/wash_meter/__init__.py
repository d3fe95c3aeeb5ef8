"""Wash meter: live wash of a vehicle's thrusters on its target, as flown and with gentler allocations. It only listens.

- `meter.py`: `WashMeter.read` gives a `MeterReading`, ten times per second; history, totals, the dive's record, JSON.
  Read this first.
- `vehicle_listener.py`: latest messages of the vehicle, and the MAVLink socket.
- `server.py`, `page/`: the web page. `run.py`: the loop and its settings.
- `embedded.py`: `python -m wakewise_ardusub.wash_meter.embedded`, for computers with NumPy and pymavlink only, such as
  a BlueROV2's.
"""
