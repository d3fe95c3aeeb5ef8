"""The socket of the physics link."""

import socket
import threading

import pytest

from wakewise.core.errors import InputError
from wakewise.robot.vehicles import load_vehicle
from wakewise_ardusub.physics import FreeWater, PhysicsServer, PulseTable
from wakewise_ardusub.physics.physics import LOOPBACK, open_socket, serve
from wakewise_ardusub.sitl.udp_endpoints import UdpPhysics

HEAVY = load_vehicle("bluerov2-heavy")


def test_frames_over_a_socket_move_the_vehicle() -> None:
    """The stand-in's own client in lock step, with strangers' bytes in between."""
    physics = PhysicsServer(lambda: FreeWater(HEAVY), PulseTable.of(HEAVY).thrusts)
    over = threading.Event()
    with open_socket(LOOPBACK, 0) as listening:
        port = listening.getsockname()[1]
        serving = threading.Thread(target=serve, args=(physics, listening, lambda: not over.is_set()))
        serving.start()
        client = UdpPhysics(LOOPBACK, port)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
            times_s = []
            for _ in range(50):
                stranger.sendto(b"no request", (LOOPBACK, port))
                motion = client.exchange((1500,) * 16, 400)
                assert motion is not None
                times_s.append(motion.time_s)
        client.close()
        over.set()
        serving.join()
    assert times_s == pytest.approx([k / 400 for k in range(1, 51)])
    assert physics.figures().refused == 50
    assert physics.figures().lost == 0


def test_nobody_there_is_no_answer() -> None:
    """The client says so and sends the same frame again later."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receive_blocked:
        receive_blocked.bind((LOOPBACK, 0))
        client = UdpPhysics(LOOPBACK, receive_blocked.getsockname()[1])
        assert client.exchange((1500,) * 16, 400) is None
        assert client.exchange((1500,) * 16, 400) is None
        assert receive_blocked.recv(100) == receive_blocked.recv(100)
        assert client.resent == 1
        client.close()


def test_a_port_in_use_is_said() -> None:
    """In one line, with what it may be."""
    with open_socket(LOOPBACK, 0) as first, pytest.raises(InputError, match="another program listens"):
        open_socket(LOOPBACK, first.getsockname()[1])
