"""A target in the stream of a vehicle that drifts past it, with stand-in, session and tracker as at sea."""

from __future__ import annotations

import math
import socket
import time
from collections import deque
from typing import Any

import numpy as np
import pytest
from ball_on_sand import BED_M, CAMERA, CENTRE_W_M, RADIUS_M, BallOnSand

from loopback_sea import VEHICLE, Sea, session_at, until
from wakewise.core.geometry import Pose
from wakewise_ardusub.physics.datagrams import PhysicsState
from wakewise_ardusub.physics.surface import FreeWater
from wakewise_ardusub.session.video_stream import VideoSource

BALL_W_M = np.array([1.1, 0.35, 2.5])
DOWN_DEG, DELAY_S = 25.0, 0.2
FOV_DEG = math.degrees(2.0 * math.atan(0.5 * CAMERA.width / CAMERA.fx))
ACCEPTED = 0


class DriftingBody(FreeWater):
    """A vehicle that a current of 5 cm/s carries to the right; keeps where it was."""

    def __init__(self) -> None:
        super().__init__(VEHICLE, current=lambda _: np.array([0.0, 0.05, 0.0]))
        self.poses: deque[tuple[float, Pose]] = deque(maxlen=500)

    def step(self, thrusts_N: np.ndarray, dt_s: float) -> PhysicsState:
        state = super().step(thrusts_N, dt_s)
        self.poses.append((time.monotonic(), Pose(state.p_WB_m, state.q_WB)))
        return state


class CameraAtSea:
    """The stream of its camera, which shows a ball on sand as it was `DELAY_S` ago; as `cv2.VideoCapture`."""

    def __init__(self, sea: Sea, body: DriftingBody) -> None:
        self._sea, self._body, self._water = sea, body, BallOnSand()
        u, v = np.meshgrid(np.arange(CAMERA.width), np.arange(CAMERA.height))
        self._rays_C = np.stack([(u - CAMERA.cx) / CAMERA.fx, (v - CAMERA.cy) / CAMERA.fy, np.ones(u.shape)], axis=-1)

    def grab(self) -> bool:
        time.sleep(0.03)
        return True

    def retrieve(self) -> tuple[bool, Any]:
        then_s = time.monotonic() - DELAY_S
        before = [X_WB for time_s, X_WB in list(self._body.poses) if time_s <= then_s]
        if not before:
            return False, None
        X_WC = before[-1] @ VEHICLE.X_BC_at(math.radians(self._sea.autopilot.mount_deg))
        seen_from = Pose(X_WC.p_m - BALL_W_M + CENTRE_W_M, X_WC.q)
        grey = self._water.grey(seen_from)
        grey[(self._rays_C @ seen_from.R.T)[..., 2] < 0.12] = 90  # no bed towards the horizon
        return True, np.repeat(grey[:, :, None], 3, axis=2)

    def release(self) -> None:
        pass


@pytest.mark.slow
def test_a_target_in_the_stream_is_mapped_while_the_vehicle_drifts_past(tmp_path, monkeypatch):
    """From a frustum at a stated distance, 0.3 m off, to the ball itself: its near side, for it has seen no other."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = int(free.getsockname()[1])
    body = DriftingBody()
    sea = Sea(port, body)
    sea.autopilot.mount_target_deg = -DOWN_DEG
    camera = CameraAtSea(sea, body)
    monkeypatch.setattr("wakewise_ardusub.session.video_stream.open_video", lambda place: camera)
    fields = {"imaging.fov_deg": FOV_DEG, "imaging.width": CAMERA.width, "imaging.height": CAMERA.height}
    video = VideoSource(place="rtsp://127.0.0.1:9/none", delay_s=DELAY_S)
    session, close = session_at(port, tmp_path / "sea", fields=fields, video=video, distance_m=1.3)
    try:
        until(lambda: session._seen_from() is not None and session.tracking.pictures > 3, "pictures")
        X_WC = session._seen_from()[1]
        p_C = (BALL_W_M - X_WC.p_m) @ X_WC.R
        (u, v), half = CAMERA.pixels(p_C[None])[0], CAMERA.fx * RADIUS_M / p_C[2]
        box = (
            (u - half) / CAMERA.width,
            (v - half) / CAMERA.height,
            (u + half) / CAMERA.width,
            (v + half) / CAMERA.height,
        )
        assert sea.order(2005, *map(float, box)) == ACCEPTED
        assert np.linalg.norm(session.boxes.target.centre_W_m - BALL_W_M) > 0.2
        until(lambda: session.boxes.target.distance_from == "mapped", "the ball", 40.0)
        assert np.linalg.norm(session.boxes.target.centre_W_m - BALL_W_M) < 0.06
        assert session.boxes.target.radius_m == pytest.approx(RADIUS_M, abs=0.04)
        assert session.boxes.target.region.points_W_m[:, 2].max() < BALL_W_M[2] + BED_M - CENTRE_W_M[2] + 0.05
        assert session.sea.parts.pilot.inner.target_W_m == pytest.approx(session.boxes.target.centre_W_m, abs=0.06)
        assert session.tracking.figures()["picture_to_region_ms_p99"] > 1e3 * DELAY_S
    finally:
        close()
        sea.close()
    assert session.fault is None
