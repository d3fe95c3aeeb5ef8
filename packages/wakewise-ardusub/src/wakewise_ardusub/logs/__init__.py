"""Logs of real vehicles: records of any format on one clock, and the same wrench with other thrusts.

- `read.py`: a file to a `VehicleLog`; read this first.
- `mavlink.py`: .tlog and BlueOS's .mcap. `dataflash.py`: ArduPilot's .BIN.
- `channels.py`: samples by channel, the log's clock and the vehicle's identity.
- `dive_track.py`: poses of a log for `wakewise photos pick`.
- `table.py`: the log as a table and as a folder. `replay_allocation.py`: flown thrusts against other allocations.
"""
