"""A show without a flight, for tests of server and page: a point that the sticks move before a ball, at once.

Run by itself it serves the page, so that one can be written and looked at with no flight behind it:
`python tests/ui/cockpit/rehearsal.py --port 8765`.
"""

from __future__ import annotations

import argparse
import math
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import cv2
import numpy as np

from wakewise.core.errors import InputError
from wakewise.ui.cockpit.control_mailbox import ControlMailbox
from wakewise.ui.cockpit.server import PAGE, CockpitServer
from wakewise.ui.cockpit.view_model import CameraPicture, StatusMessage
from wakewise.ui.web.files import StaticFiles

_THRUSTERS = 8
_RANGES = {"w_track": [0.5, 50.0], "gain": [0.1, 1.0], "mode": ["operator", "hold", "scan"]}


@dataclass(eq=False)
class Rehearsal:
    """A `Show` whose vehicle is a point: it moves as the sticks say."""

    mailbox: ControlMailbox = field(default_factory=ControlMailbox)
    edition: int = 0
    settings: dict[str, Any] = field(
        default_factory=lambda: {
            "mode": "hold",
            "method": "wake-aware",
            "w_track": 5.0,
            "gain": 0.5,
            "precise": False,
            "watch_target": False,
            "orbit": False,
            "regime": "work",
        }
    )

    def __post_init__(self) -> None:
        self.p, self.heading, self.energy = np.array([-0.8, 0.0, -0.1]), 0.0, 0.0
        self.axes, self.photos, self.frames = np.zeros(5), 0, 0
        self.flown: list[tuple[float, np.ndarray]] = []
        self._notes: list[StatusMessage] = []
        self.designated: list[tuple[tuple[float, ...] | None, int]] = []
        self.proposals: list[str] = []
        self._began_s, self._last_s = time.monotonic(), time.monotonic()
        angle, height = np.linspace(0.0, 2.0 * math.pi, 200, endpoint=False) * 7.0, np.linspace(-0.95, 0.95, 200)
        ring = np.sqrt(1.0 - height**2)
        self.points = 0.15 * np.stack([ring * np.cos(angle), ring * np.sin(angle), height], axis=1)
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._fly, daemon=True)
        self._thread.start()

    @property
    def time_s(self) -> float:
        return time.monotonic() - self._began_s

    def close(self) -> None:
        self._over.set()
        self._thread.join()

    def _fly(self) -> None:
        """The loop, at 50 Hz, as a flight's would read the seat."""
        while not self._over.wait(0.02):
            controls = self.mailbox.read(self.time_s)
            self.axes = np.zeros(5) if controls is None else controls.axes
            self.flown.append((time.monotonic(), self.axes))
            for what in () if controls is None else controls.pressed:
                self.photos += what == "capture"
                if what in ("hold", "scan", "operator"):
                    self.settings["mode"] = what
                self._notes.append(StatusMessage(text=what, time_s=self.time_s))
            self.mailbox.flown()
            self.heading += 0.5 * self.axes[3] * 0.02
            c, s = math.cos(self.heading), math.sin(self.heading)
            u, v, w = 0.3 * self.axes[:3]
            self.p = self.p + 0.02 * np.array([c * u - s * v, s * u + c * v, w])
            self.energy += 0.02 * 40.0

    def welcome(self) -> dict[str, Any]:
        turn = np.linspace(0.0, 2.0 * math.pi, _THRUSTERS, endpoint=False)
        return {
            "scenario": {"name": "rehearsal", "world": "none", "method": "wake-aware", "target": "ball"},
            "vehicle": {
                "name": "point",
                "thrusters": [
                    {
                        "name": f"T{k + 1}",
                        "position_B_m": [0.2 * math.cos(a), 0.2 * math.sin(a), 0.0],
                        "axis_B": [math.cos(a + 0.8), math.sin(a + 0.8), 0.0],
                        "limit_N": [-40.0, 50.0],
                    }
                    for k, a in enumerate(turn)
                ],
            },
            "target": {"points_W_m": self.points.tolist(), "centre_W_m": [0.0, 0.0, 0.0], "radius_m": 0.15},
            "settings": {**self.settings, "ranges": _RANGES},
            "scene_url": None,
            "preparing": None,
        }

    def state(self) -> dict[str, Any]:
        away = np.linalg.norm(self.points - self.p, axis=1)
        wash = 0.02 * float(np.abs(self.axes[:3]).sum()) / np.maximum(away, 0.1)
        aware = self.settings["method"] == "wake-aware"
        thrusts = 5.0 * np.sin(np.arange(_THRUSTERS) + self.time_s) * (0.2 + np.abs(self.axes[:4]).sum())
        asked = (0.3 * self.axes[:3]).tolist()
        direct = float(np.mean(wash**2))
        return {
            "time_s": round(self.time_s, 2),
            "mode": self.settings["mode"],
            "settings": self.settings,
            "controls": self.axes.tolist(),
            "thrusts_N": thrusts.tolist(),
            "commanded_m_s": asked,
            "velocity_m_s": asked,
            "deviation_pct": 4.2,
            "disturbance": 0.3 * direct if aware else direct,
            "direct_disturbance": direct,
            "rms_m_s": math.sqrt((0.3 if aware else 1.0) * direct),
            "direct_rms_m_s": math.sqrt(direct),
            "saved_pct": 70.0 if aware and direct else 0.0,
            "predicted_m_s": np.round((0.55 if aware else 1.0) * wash, 4).tolist(),
            "true_m_s": np.round(0.5 * wash, 4).tolist(),
            "depth_m": 1.0 + float(self.p[2]),
            "roll_deg": 0.5,
            "pitch_deg": -2.0,
            "heading_deg": math.degrees(self.heading) % 360.0,
            "tilt_deg": 10.0 * float(self.axes[4]),
            "power_W": 40.0,
            "energy_J": self.energy,
            "position_W_m": self.p.tolist(),
            "goal_W_m": self.p.tolist(),
            "coverage": {
                "share": min(1.0, 0.1 * self.photos),
                "patches": [min(1.0, 0.2 * self.photos)] * 12,
                "next": {"position_W_m": [-0.5, 0.3, -0.2], "words": "go right and up, 0.4 m"},
            },
            "photos": self.photos,
            "loop": {
                "behind_ms": 0.4,
                "solve_ms_p99": 3.1,
                "stick_to_thrust_ms_p99": self.mailbox.stick_to_thrust_ms_p99,
            },
            "fallback": None,
        }

    def notes(self) -> Sequence[StatusMessage]:
        told, self._notes = self._notes, []
        return told

    def change_settings(self, changes: dict[str, Any]) -> None:
        for name, value in changes.items():
            allowed = _RANGES.get(name)
            if name not in self.settings or (name in ("w_track", "gain") and not allowed[0] <= value <= allowed[1]):
                raise InputError(f"settings: {name} {value}, allowed {allowed}")
        self.settings.update(changes)

    def designate(self, box: tuple[float, ...] | None, frame: int) -> None:
        """Keep the box; the first picture is of no use."""
        if box is not None and frame == 0:
            raise InputError("designate: no pictures are drawn")
        self.designated.append((box, frame))

    def propose(self, what: str) -> None:
        """Keep what was asked; there is nothing to accept before anything was asked for."""
        if what != "ask" and not self.proposals:
            raise InputError("proposal: no target is proposed")
        self.proposals.append(what)

    def picture(self) -> CameraPicture:
        image = np.full((270, 480, 3), (120, 90, 30), np.uint8)
        away = max(float(np.linalg.norm(self.p)), 0.2)
        bearing = math.atan2(-self.p[1], -self.p[0]) - self.heading
        at = (int(240 + 400 * math.tan(max(-1.2, min(1.2, bearing)))), int(135 - 400 * float(self.p[2]) / away))
        cv2.circle(image, at, int(60 / away), (80, 120, 220), -1)
        self.frames += 1
        jpeg = cv2.imencode(".jpg", image)[1].tobytes()
        return CameraPicture(number=self.frames, time_s=self.time_s, jpeg=jpeg)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--port", type=int, default=0)
    server = CockpitServer(Rehearsal(), port=parser.parse_args().port, files=StaticFiles(folder=PAGE))
    server.start()
    print(server.address, flush=True)
    try:
        threading.Event().wait()
    except KeyboardInterrupt:
        server.stop()
