"""A flight faster than the clock, under a page that flies, one that looks and one that never reads.

`WAKEWISE_SOAK_S=3600 pytest -s -m slow tests/ui/cockpit/test_soak.py` flies an hour and prints what it took.
"""

from __future__ import annotations

import asyncio
import json
import os
import socket
from collections.abc import AsyncIterable
from pathlib import Path

import numpy as np
import pytest
from test_server import _masked, _opening, page

from wakewise.operation import Scenario
from wakewise.ui.cockpit.server import CockpitServer
from wakewise.ui.cockpit.session import CockpitSession

BEGINS_S, ENDS_S = 15.0, float(os.environ.get("WAKEWISE_SOAK_S", "50"))
MOST_MB_PER_MINUTE = 3.0
"""Of the process that flies: an hour may not cost 200 MB."""


def resident_mb() -> float:
    """Memory of this process, MB."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * 4096 / 1e6


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="memory is read from /proc")
def test_a_flight_leaves_memory_as_it_is(tmp_path: Path) -> None:
    """Once all is loaded the process stays as large as it is, and the flight goes on whatever a client does."""
    scenario = Scenario.preset("quick", world="paper").replace(**{"target.points": 60})
    session = CockpitSession(scenario, tmp_path / "flight", paced=False, pictures=False)
    server = CockpitServer(session)
    server.start()
    session.start()
    marks: list[tuple[float, float]] = []

    async def fly() -> None:
        with socket.socket() as deaf:
            deaf.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            deaf.connect(("127.0.0.1", server.port))
            deaf.sendall(_opening(server) + _masked('{"type":"hello","token":null,"name":"deaf","wants":"watch"}'))
            async with page(server, "helm") as one, page(server) as two:
                asyncio.get_running_loop().create_task(_drain(two.socket))
                await one.until(lambda told: told["type"] == "state", within_s=120.0)
                await one.say(type="helm", want=True)
                await one.helm(lambda told: told["yours"] and told["flying"])
                await one.say(type="press", what="operator", lease=one.lease)
                time_s = 0.0
                while time_s < ENDS_S:
                    told = await one.until(lambda told: told["type"] == "state")
                    time_s = told["time_s"]
                    await one.sticks(0.5 * np.sin(time_s))
                    if not marks or time_s > marks[-1][0] + 2.5:
                        marks.append((time_s, resident_mb()))

    try:
        asyncio.run(fly())
    finally:
        session.stop()
        server.stop()
    assert session.fault is None
    at_s, mb = np.array([mark for mark in marks if mark[0] >= BEGINS_S]).T
    grows_mb = 60.0 * float(np.polyfit(at_s, mb, 1)[0])
    print(json.dumps({"grows_MB_per_minute": round(grows_mb, 3), "marks": [[round(v, 1) for v in m] for m in marks]}))
    assert grows_mb < MOST_MB_PER_MINUTE


async def _drain(socket: AsyncIterable[object]) -> None:
    async for _ in socket:
        pass
