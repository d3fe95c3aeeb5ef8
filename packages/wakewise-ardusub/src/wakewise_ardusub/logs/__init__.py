"""Logs of real vehicles: what any of their formats says on one clock, and what gentler thrusts would have done.

Start reading in `read.py` (a file becomes a `VehicleLog`). `mavlink.py`, `dataflash.py` and `mavlink.py` are the
formats, `mavlink.py` what MAVLink messages say, `channels.py` where it is collected, `channels.py` one clock of one
that jumps, `channels.py` what vehicle it is. `table.py` is the log as rows, `replay_allocation.py` holds the flown
thrusts against others, `table.py` writes both.
"""
