"""The 3D scene is a picture: it moves with the flight, listens on loopback alone, and opens no tunnel for anybody."""

from __future__ import annotations

import socket
import time
from collections.abc import Iterator

import numpy as np
import pytest
from standin import POINTS_W_M

from wakewise.core.geometry import Pose, quat_from_euler
from wakewise.robot.vehicles import load_vehicle
from wakewise.ui.cockpit import scene as room
from wakewise.ui.cockpit.scene import SPEED_RGB, ViserScene, open_scene, speed_colours

viser = pytest.importorskip("viser")
msgpack = pytest.importorskip("msgspec").msgpack


@pytest.fixture(scope="module")
def scene() -> Iterator[ViserScene]:
    opened = open_scene(load_vehicle("paper"), POINTS_W_M)
    assert opened is not None
    yield opened
    opened.close()


def test_a_share_request_opens_no_connection(scene: ViserScene, monkeypatch: pytest.MonkeyPatch) -> None:
    """A client's request reaches the server, which answers nothing, starts no process and connects to nobody."""
    from websockets.sync.client import connect

    asked: list[str] = []
    outside: list[object] = []
    monkeypatch.setattr("viser._viser.ViserTunnel", lambda *a: outside.append(a))
    original = type(scene._server).request_share_url
    monkeypatch.setattr(
        type(scene._server), "request_share_url", lambda self, *a: asked.append("share") or original(self, *a)
    )
    url = scene.url.replace("http", "ws")
    with connect(url, subprotocols=[f"viser-v{viser.__version__}"], max_size=None, proxy=None) as client:
        dialled = socket.socket.connect
        monkeypatch.setattr(socket.socket, "connect", lambda *a: outside.append(a) or dialled(*a))
        client.send(msgpack.encode({"type": "ShareUrlRequest"}))
        client.send(msgpack.encode({"type": "ShareUrlDisconnect"}))
        end_s = time.monotonic() + 10.0
        while not asked and time.monotonic() < end_s:
            time.sleep(0.02)
        time.sleep(0.3)
    assert asked == ["share"]
    assert outside == []
    assert scene._server._share_tunnel is None


def test_it_listens_on_loopback_and_has_nothing_to_press(scene: ViserScene) -> None:
    """No other interface, no control, no share button."""
    assert scene.url.startswith("http://127.0.0.1:")
    assert scene._server.get_host() == "127.0.0.1"
    assert not scene._server.gui._gui_input_handle_from_uuid


def test_a_moment_moves_vehicle_thrusts_and_colours(scene: ViserScene) -> None:
    """Pose, jets against the thrust, wash by colour; in world NED as it is."""
    vehicle = load_vehicle("paper")
    pose = Pose(np.array([-0.8, 0.1, -0.2]), quat_from_euler(0.0, 0.1, 0.5))
    thrusts = np.arange(len(vehicle.thrusters), dtype=float)
    wash = np.zeros(len(POINTS_W_M))
    wash[3] = 1.0
    scene.show(pose, thrusts, wash)
    scene.show(Pose(pose.p_m + 0.1, pose.q), thrusts, wash[:5])
    np.testing.assert_allclose(scene._handles["vehicle"].position, pose.p_m + 0.1)
    np.testing.assert_allclose(scene._handles["vehicle"].wxyz, pose.q)
    jets = scene._handles["jets"].points
    along = np.einsum("ij,ij->i", jets[:, 1] - jets[:, 0], np.array([t.axis_B for t in vehicle.thrusters]))
    np.testing.assert_allclose(along, -0.01 * thrusts, atol=1e-6)
    assert scene._handles["target"].colors[3].tolist() == SPEED_RGB[-1].tolist()
    assert scene._handles["way"].points.shape == (1, 2, 3)


def test_colours_rise_with_the_wash() -> None:
    """Ends are the ends of the scale; what is not known is drawn as still."""
    sand_m_s = 1e-3 * (101.0**0.3 - 1.0)
    colours = speed_colours(np.array([0.0, np.nan, sand_m_s, 0.1, 9.0]))
    assert colours.tolist() == SPEED_RGB[[0, 0, 1, 3, 3]].tolist()


def test_without_viser_there_is_no_scene(monkeypatch: pytest.MonkeyPatch) -> None:
    """The page is whole without it."""
    monkeypatch.setattr(room, "find_spec", lambda name: None)
    assert open_scene(load_vehicle("paper"), POINTS_W_M) is None
