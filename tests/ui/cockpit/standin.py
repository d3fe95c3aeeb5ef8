"""A server that speaks the cockpit's protocol with made-up, moving state, so that the page can be tested alone.

Nothing here is a result: wash, thrusts and pictures are drawn from sines. It records whatever a page sends it.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import math
import mimetypes
import struct
import threading
import time
from dataclasses import dataclass, field
from importlib.resources import files
from typing import Any

import cv2
import numpy as np
from websockets.asyncio.server import ServerConnection, serve
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

PAGE, SHARED = files("wakewise.ui.cockpit") / "page", files("wakewise.ui.web") / "page"
POLICY = "default-src 'self'; frame-src http://127.0.0.1:*; base-uri 'none'; form-action 'none'"
LAPSE_S = 1.0
QUIET = logging.getLogger("standin")
QUIET.disabled = True
AROUND = b"<input id=outside><iframe id=f width=480 height=400 src='/?widget=1'></iframe>"
"""Another ground station, with the page as a widget."""
CORNERS = [(x, y) for x in ("front", "rear") for y in ("right", "left")]
THRUSTERS = [{"name": f"{x} {y} {kind}", "position_B_m": [0.1, 0.1, 0.0], "axis_B": [1, 0, 0], "limit_N": [-40, 50]}
             for kind in ("horizontal", "vertical") for x, y in CORNERS]  # fmt: skip


def ball(count: int = 260, radius_m: float = 0.15) -> np.ndarray:
    """Points on a knobbly ball at the origin, world NED, shape (count, 3)."""
    k = np.arange(count) + 0.5
    z, turn = 1 - 2 * k / count, k * math.pi * (1 + math.sqrt(5))
    flat = np.sqrt(1 - z**2)
    directions = np.column_stack([flat * np.cos(turn), flat * np.sin(turn), z])
    return radius_m * directions * (1 + 0.18 * np.sin(5 * turn) * flat)[:, None]


POINTS_W_M = ball()


@dataclass
class Client:
    """One page that is connected."""

    socket: ServerConnection
    id: str
    name: str = ""
    seen: int = -1
    sent: int = -1


@dataclass
class StandIn:
    """Serves the page, lends the helm, and keeps what it is sent: `received` rows are (seconds, client id, message)."""

    tank: bool = True
    token: str | None = None
    picture_hz: float = 12.0
    width: int = 640
    quiet: bool = False
    received: list[tuple[float, str, dict[str, Any]]] = field(default_factory=list)
    clients: dict[str, Client] = field(default_factory=dict)
    settings: dict[str, Any] = field(default_factory=dict)
    holder: str | None = None
    lease: str | None = None
    asked_by: str | None = None
    photos: int = 0
    target: Any = None
    started_s: float = 0.0

    def __post_init__(self) -> None:
        self.settings = {"mode": "hold", "method": "wake-aware", "w_track": 5.0, "gain": 0.5, "precise": False,
                     "watch_target": False, "orbit": False}  # fmt: skip
        self._loop = asyncio.new_event_loop()
        self._ready = threading.Event()
        self._leases = self._ids = 0
        self._sticks_s = 0.0
        self.axes = [0.0] * 5
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> StandIn:
        self._thread.start()
        assert self._ready.wait(10)
        return self

    def __exit__(self, *_: object) -> None:
        self._loop.call_soon_threadsafe(self._stop.set)
        self._thread.join(10)

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}/"

    # ---- what tests ask and do, from their own thread

    def of(self, kind: str, since_s: float = 0.0) -> list[dict[str, Any]]:
        """Messages of one type, oldest first."""
        return [m for t, _, m in list(self.received) if m.get("type") == kind and t >= since_s]

    def times(self, kind: str, since_s: float = 0.0) -> list[float]:
        return [t for t, _, m in list(self.received) if m.get("type") == kind and t >= since_s]

    def tell(self, message: object) -> None:
        """Send an object as JSON, or text or bytes as they are, to every page."""
        data = message if isinstance(message, str | bytes) else json.dumps(message)
        asyncio.run_coroutine_threadsafe(self._all(data), self._loop).result(5)

    def drop(self) -> None:
        """Cut every connection without a word."""
        for client in list(self.clients.values()):
            self._loop.call_soon_threadsafe(client.socket.transport.abort)

    # ---- the server

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)
        self._loop.run_until_complete(self._serve())
        self._loop.close()

    async def _serve(self) -> None:
        self._stop = asyncio.Event()
        self.started_s = time.monotonic()
        async with serve(
            self._talk,
            "127.0.0.1",
            0,
            process_request=self._static,
            compression=None,
            close_timeout=0.3,
            logger=QUIET,
            select_subprotocol=lambda _, offered: "wakewise" if "wakewise" in offered else None,
        ) as server:
            self.port = next(iter(server.sockets)).getsockname()[1]
            ticking = [asyncio.create_task(self._states()), asyncio.create_task(self._pictures())]
            self._ready.set()
            await self._stop.wait()
            for task in ticking:
                task.cancel()
            await asyncio.gather(*ticking, return_exceptions=True)

    def _static(self, connection: ServerConnection, request: Request) -> Response | None:
        path = request.path.split("?")[0]
        if path == "/ws":
            return None
        if path == "/around":
            return Response(200, "OK", Headers({"Content-Type": "text/html"}), AROUND)
        name = "index.html" if path == "/" else path.removeprefix("/page/")
        entry = next((folder / name for folder in (PAGE, SHARED) if (folder / name).is_file()), PAGE / name)
        if "/" in path.removeprefix("/page/").strip("/") or not entry.is_file():
            return connection.respond(404, "no such file\n")
        kind = "text/javascript" if path.endswith(".js") else mimetypes.guess_type(entry.name)[0] or "text/plain"
        body = entry.read_bytes()
        headers = Headers({"Content-Type": kind, "Content-Length": str(len(body)), "Content-Security-Policy": POLICY})
        return Response(200, "OK", headers, body)

    def sticks_since(self, since_s: float) -> list[list[float]]:
        """Axes that came since, oldest first."""
        return [message["axes"] for message in self.of("sticks", since_s)]

    async def _talk(self, socket: ServerConnection) -> None:
        self._ids += 1
        client = Client(socket, f"c{self._ids}")
        try:
            async for text in socket:
                message = json.loads(text)
                self.received.append((time.monotonic(), client.id, message))
                if not client.name:
                    if message.get("type") != "hello" or (self.token and message.get("token") != self.token):
                        await socket.close(4401, "wrong token")
                        return
                    client.name = message["name"]
                    self.clients[client.id] = client
                    await self._send(client, self._welcome() | {"id": client.id})
                    await self._tell_helm()
                else:
                    await self._take(client, message)
        except ConnectionClosed:
            pass
        finally:
            self.clients.pop(client.id, None)
            if self.holder == client.id:
                await self._lend(None, f"{client.name} has left: the vehicle holds")

    async def _take(self, client: Client, message: dict[str, Any]) -> None:
        kind = message["type"]
        if kind == "helm":
            if not message["want"]:
                if self.holder == client.id:
                    await self._lend(None, f"{client.name} gave the helm back")
            elif self.holder is None or time.monotonic() - self._sticks_s > LAPSE_S:
                await self._lend(client.id, f"{client.name} has the helm")
            else:
                self.asked_by = client.id
                await self._tell_helm()
        elif kind == "consent" and self.holder == client.id:
            if message["yes"]:
                await self._lend(message["to"], "the helm was handed over")
            else:
                self.asked_by = None
                await self._tell_helm("the holder keeps the helm")
        elif kind == "seen":
            client.seen = message["frame"]
        elif message.get("lease") != self.lease or self.lease is None:
            return
        elif kind == "sticks":
            self._sticks_s = time.monotonic()
            self.axes = message["axes"]
        elif kind == "settings":
            self.settings |= message["set"]
        elif kind == "press":
            await self._press(message["what"])

    async def _press(self, what: str) -> None:
        if what in ("operator", "hold", "scan"):
            self.settings["mode"] = what
        elif what == "capture":
            self.photos += 1
        elif what == "precise":
            self.settings["precise"] = not self.settings["precise"]
        elif what.startswith("gain"):
            self.settings["gain"] = min(1.0, max(0.1, self.settings["gain"] + (0.1 if what == "gain_up" else -0.1)))
        await self._all(json.dumps({"type": "note", "level": "info", "text": what, "time_s": self.time_s}))

    async def _lend(self, to: str | None, why: str) -> None:
        self._leases += 1
        self.holder, self.lease = to, None if to is None else f"lease-{self._leases}"
        self.asked_by = None
        self._sticks_s = time.monotonic()
        await self._tell_helm(why)

    async def _tell_helm(self, why: str = "") -> None:
        name = self.clients[self.holder].name if self.holder in self.clients else None
        asked = self.clients.get(self.asked_by or "")
        for client in list(self.clients.values()):
            mine = client.id == self.holder
            await self._send(client, {
                "type": "helm", "yours": mine, "lease": self.lease if mine else None, "holder": name, "why": why,
                "asked_by": {"id": asked.id, "name": asked.name} if asked else None, "flying": name is not None,
            })  # fmt: skip

    async def _all(self, data: str | bytes) -> None:
        for client in list(self.clients.values()):
            await self._send(client, data)

    async def _send(self, client: Client, message: object) -> None:
        with contextlib.suppress(ConnectionClosed):
            await client.socket.send(message if isinstance(message, str | bytes) else json.dumps(message))

    async def _states(self) -> None:
        while True:
            await asyncio.sleep(0.1)
            if self.clients and not self.quiet:
                await self._all(json.dumps(self.state()))

    async def _pictures(self) -> None:
        number = 0
        while True:
            await asyncio.sleep(1.0 / self.picture_hz)
            idle = [c for c in self.clients.values() if c.seen >= c.sent]
            if idle and not self.quiet:
                number += 1
                data = struct.pack("<II", number, int(1e3 * self.time_s)) + picture(
                    self.time_s, self.width, 3 * self.width // 4
                )
                for client in idle:
                    client.sent = number
                    await self._send(client, data)

    # ---- what it makes up

    @property
    def time_s(self) -> float:
        return time.monotonic() - self.started_s

    def _welcome(self) -> dict[str, Any]:
        return {
            "type": "welcome", "id": "x", "protocol": 1, "preparing": None, "scene_url": None,
            "scenario": {"name": "coral, by hand", "world": "tank", "method": "wake-aware", "target": "coral"},
            "vehicle": {"name": "bluerov2-heavy", "thrusters": THRUSTERS},
            "target": {"points_W_m": POINTS_W_M.round(4).tolist(), "centre_W_m": [0, 0, 0], "radius_m": 0.17},
            "settings": self.settings | {"ranges": {"w_track": [0.5, 50], "gain": [0.1, 1]}},
        }  # fmt: skip

    def state(self) -> dict[str, Any]:
        t = self.time_s
        aware = self.settings["method"] == "wake-aware"
        direct = 2.4e-4 * (1.3 + math.sin(0.31 * t) + 0.3 * math.sin(1.7 * t))
        flown = direct * ((0.05 + 0.03 * math.sin(0.9 * t)) if aware else 1.0)
        bearing = 0.15 * t
        eye = np.array([-0.8 * math.cos(bearing), -0.8 * math.sin(bearing), -0.25])
        hit = np.exp(
            -(
                ((POINTS_W_M - 0.15 * np.array([-math.cos(bearing + 0.6), -math.sin(bearing + 0.6), -0.4])) / 0.07) ** 2
            ).sum(1)
        )
        wash = 1e-3 * (0.6 + hit * (9 if aware else 40) * (1 + 0.3 * math.sin(0.8 * t)))
        return {
            "type": "state", "time_s": round(t, 2), "mode": self.settings["mode"], "settings": self.settings,
            "controls": self.axes,
            "thrusts_N": [round(16 * math.sin(0.4 * t + k) * math.cos(0.11 * t * k), 2) for k in range(8)],
            "commanded_m_s": [0.12 * self.axes[0], 0.12 * self.axes[1], 0.12 * self.axes[2]],
            "velocity_m_s": [0.11 * math.sin(0.3 * t), 0.02, 0.0], "deviation_pct": 6.5 + 2.5 * math.sin(0.5 * t),
            "disturbance": flown, "direct_disturbance": direct, "saved_pct": 100 * (1 - flown / direct),
            "rms_m_s": math.sqrt(flown), "direct_rms_m_s": math.sqrt(direct),
            "predicted_m_s": wash.round(5).tolist(),
            "true_m_s": (wash * (0.8 + 0.2 * np.sin(60 * POINTS_W_M[:, 0]))).round(5).tolist() if self.tank else None,
            "depth_m": 1.23 + 0.02 * math.sin(t), "roll_deg": 1.4 * math.sin(0.7 * t),
            "pitch_deg": -4 + 2 * math.sin(0.4 * t),
            "heading_deg": math.degrees(bearing) % 360, "tilt_deg": -12.0, "power_W": 84 + 22 * math.sin(0.4 * t),
            "energy_J": 84 * t + 5200, "position_W_m": eye.round(3).tolist(), "goal_W_m": eye.round(3).tolist(),
            "coverage": {
                "share": 0.34,
                "patches": [max(0.0, min(1.0, 0.5 + 0.6 * math.sin(0.9 * k))) for k in range(96)],
                "next": {"position_W_m": (eye + 0.25).round(3).tolist(), "words": "its left flank, from higher up"},
            },
            "photos": self.photos + 12, "loop": {"behind_ms": 0.4, "solve_ms_p99": 7.2, "stick_to_thrust_ms_p99": 96.0},
            "fallback": None, "target": self.target, "helm": None, "spectators": max(0, len(self.clients) - 1),
        }  # fmt: skip


def picture(time_s: float, width: int = 640, height: int = 480) -> bytes:
    """A JPEG of something like a coral under water, which drifts."""
    y, x = np.mgrid[0:height, 0:width].astype(np.float32)
    cx, cy = width * (0.5 + 0.05 * math.sin(0.3 * time_s)), height * (0.56 + 0.03 * math.sin(0.5 * time_s))
    haze = np.exp(-((x - cx) ** 2 + (y - cy) ** 2) / (0.30 * width) ** 2)
    image = np.dstack([62 + 50 * haze, 58 + 46 * haze, 12 + 40 * haze])
    for k in range(14):
        a = 2.4 * k
        px, py, r = cx + 9 * k * math.cos(a), cy + 7 * k * math.sin(a), 46 - 2 * k
        near = np.clip(1 - ((x - px) ** 2 + (y - py) ** 2) / (r * r), 0, 1)[..., None]
        image += near * np.array([20.0, 55 + 4 * (k % 5), 70 + 9 * (k % 4)]) * 0.55
    image += 7 * np.sin(0.21 * x + 0.13 * y)[..., None] * haze[..., None]
    return cv2.imencode(".jpg", np.clip(image, 0, 255).astype(np.uint8), [cv2.IMWRITE_JPEG_QUALITY, 75])[1].tobytes()
