"""From stick to thrust, and what the page does to the loop: a flight by the clock, flown through a real socket.

What is flown is `wakewise cockpit` itself without its window: the session, its server on a port of this computer, and a
client in a process of its own that holds the helm, sends sticks at 25 Hz and takes every picture.
"""

from __future__ import annotations

import json
import subprocess
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from wakewise.core.errors import StageError
from wakewise.core.interfaces import no_progress
from wakewise.core.subprocesses import end_process, start_python
from wakewise.operation import Scenario
from wakewise.ui.cockpit.server import CockpitServer
from wakewise.ui.cockpit.session import CockpitSession

STICKS_HZ = 25.0
BEGIN_WITHIN_S = 180.0
_SETTLES_S = 2.0


@dataclass(frozen=True, kw_only=True)
class LoopTiming:
    """How a flight under a page kept its time.

    `latency_ms_*` count from a message's arrival at the server to thrusts that know of it on their way to the plant;
    `late_ms_p99` how late control steps came; `solve_ms_p99` is thread CPU.
    """

    latency_ms_p50: float
    latency_ms_p99: float
    late_ms_p99: float
    lost_s: float
    solve_ms_p99: float
    sticks: int
    pictures_per_s: float
    states_per_s: float
    first_light_s: float

    def figures(self) -> dict[str, float | int]:
        """As a bench prints them."""
        return {name: round(value, 3) if isinstance(value, float) else value for name, value in vars(self).items()}


def measure(
    scenario: Scenario,
    flight_s: float = 20.0,
    *,
    pictures: bool = True,
    busy: int = 0,
    progress: Callable[..., None] = no_progress,
) -> LoopTiming:
    """Fly for a while with a page that holds the helm.

    `pictures`: whether the page looks at the camera's picture. `busy`: processes that do nothing but keep a core busy
    meanwhile.

    Raises StageError if no flight came about.
    """
    session = CockpitSession(scenario, None, pictures=pictures)
    server = CockpitServer(session)
    server.start()
    began_s = time.monotonic()
    session.start()
    others: list[subprocess.Popen[str]] = []
    try:
        while session.preparing is not None:
            progress(0, flight_s, session.preparing)
            if not session.running or time.monotonic() - began_s > BEGIN_WITHIN_S:
                raise StageError(f"latency: no flight came about ({session.fault or session.preparing})")
            time.sleep(0.1)
        first_light_s = time.monotonic() - began_s
        others += [_python("while True: pass") for _ in range(busy)]
        page = _python(_PAGE, str(server.port), str(flight_s))
        others.append(page)
        told, _ = page.communicate(timeout=flight_s + 60.0)
        if page.returncode != 0:
            raise StageError(f"latency: the page that flies ended with exit status {page.returncode}")
        counted: dict[str, Any] = json.loads(told)
        waits_ms = 1e3 * np.array(session.mailbox.waits_s)
        live, snapshots = session.live, session.snapshots
        if live is None or snapshots is None or not len(waits_ms):
            raise StageError("latency: no stick was flown")
        return LoopTiming(
            latency_ms_p50=float(np.percentile(waits_ms, 50)),
            latency_ms_p99=float(np.percentile(waits_ms, 99)),
            late_ms_p99=1e3 * live.pace.late_s(),
            lost_s=live.pace.lost_s,
            solve_ms_p99=snapshots.solve_ms_p99,
            sticks=len(waits_ms),
            pictures_per_s=counted["pictures"] / counted["seconds"],
            states_per_s=counted["states"] / counted["seconds"],
            first_light_s=first_light_s,
        )
    finally:
        for other in others:
            end_process(other)
        session.stop()
        server.stop()


def _python(code: str, *arguments: str) -> subprocess.Popen[str]:
    return start_python("-c", code, *arguments, stdin=None, stderr=None, text=True)


_PAGE = """
import asyncio, json, sys, time
from websockets.asyncio.client import connect

port, flight_s = int(sys.argv[1]), float(sys.argv[2])
told = {"pictures": 0, "states": 0, "lease": None, "first": None}

async def fly(page):
    seq = 0
    while told["lease"] is None:
        await asyncio.sleep(0.01)
    await page.send(json.dumps({"type": "press", "what": "operator", "lease": told["lease"]}))
    began = time.monotonic()
    while time.monotonic() - began < flight_s:
        seq += 1
        way = 0.5 if int((time.monotonic() - began) / 2.0) % 2 else -0.5
        sticks = {"type": "sticks", "seq": seq, "t": 1e3 * time.monotonic(), "axes": [0, way, 0, 0, 0]}
        await page.send(json.dumps(sticks | {"lease": told["lease"]}))
        await asyncio.sleep(0.04)
    told["seconds"] = time.monotonic() - began

async def look(page):
    async for message in page:
        if isinstance(message, bytes):
            told["pictures"] += told["lease"] is not None
            await page.send(json.dumps({"type": "seen", "frame": int.from_bytes(message[:4], "little")}))
            continue
        message = json.loads(message)
        told["states"] += message["type"] == "state" and told["lease"] is not None
        told["lease"] = message["lease"] if message["type"] == "helm" else told["lease"]

async def main():
    home = f"127.0.0.1:{port}"
    async with connect(f"ws://{home}/ws", origin=f"http://{home}", max_queue=None, close_timeout=1) as page:
        await page.send(json.dumps({"type": "hello", "token": None, "name": "bench", "wants": "helm"}))
        looking = asyncio.create_task(look(page))
        await fly(page)
        looking.cancel()

asyncio.run(main())
print(json.dumps({name: told[name] for name in ("pictures", "states", "seconds")}))
"""
