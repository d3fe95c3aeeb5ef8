"""Poses handed on as MAVLink are read as the same poses by the link to ArduSub."""

import json
import math
import socket
import threading
import time
from types import MappingProxyType

import numpy as np
import pytest

from wakewise.core.geometry import Pose, quat_from_euler
from wakewise.core.interfaces import Measurement
from wakewise.ui.cli.main import run
from wakewise_ardusub.link.message_state import MavlinkMessage
from wakewise_ardusub.link.telemetry_adapter import TelemetryAdapter, to_measurements
from wakewise_ardusub.sensors import PoseForwarder, PoseSample, UdpSocket, vision_position_estimate

common = pytest.importorskip("pymavlink.dialects.v20.common")
P, Q = np.array([1.5, -2.0, 3.25]), quat_from_euler(0.1, -0.2, 2.0)


def _parsed(data: bytes) -> object:
    (message,) = common.MAVLink(None).parse_buffer(data)
    return message


def test_a_pose_goes_through_the_air_and_is_the_same_pose() -> None:
    """Sent as bytes, parsed by pymavlink, taken by the link's own reader: place, attitude, time and covariance."""
    covariance = np.diag([1e-4, 1e-4, 4e-4, 1e-3, 1e-3, 2e-3])
    covariance[0, 1] = covariance[1, 0] = 5e-5
    with UdpSocket("0") as port:
        forwarder = PoseForwarder(f"127.0.0.1:{port.port}")
        for k in range(3):
            pose = PoseSample(measurement=Measurement(time_s=5.0 + k, X_WB=Pose(P + k, Q)), covariance=covariance)
            forwarder(pose)
        forwarder(Measurement(time_s=5.0, depth_m=1.0))
        forwarder(PoseSample(measurement=Measurement(time_s=5.0, p_WB_m=P)))
        assert (forwarder.sent, forwarder.lost) == (3, 1)
        forwarder.close()
        time.sleep(0.05)
        messages = [_parsed(data) for data in port.read()]
    assert [message.get_seq() for message in messages] == [0, 1, 2]
    known = TelemetryAdapter()
    for k, message in enumerate(messages):
        assert (message.get_srcSystem(), message.get_srcComponent()) == (1, 197)
        fields = MappingProxyType(message.to_dict())
        said = MavlinkMessage(name=message.get_type(), system=1, component=197, fields=fields)
        known, (taken,) = to_measurements(known, said, 100.0 + k, 1)
        assert taken.time_s == pytest.approx(100.0 + k)
        np.testing.assert_allclose(taken.X_WB.p_m, P + k, rtol=1e-6)
        assert abs(float(taken.X_WB.q @ Q)) == pytest.approx(1.0, abs=1e-6)
        upper = np.zeros((6, 6))
        upper[np.triu_indices(6)] = fields["covariance"]
        np.testing.assert_allclose(upper, np.triu(covariance), rtol=1e-6)


def test_what_is_not_known_is_said_so() -> None:
    """No covariance is NaN first, as MAVLink has it; a position alone is no pose; time is never negative."""
    told = vision_position_estimate(PoseSample(measurement=Measurement(time_s=-1.0, X_WB=Pose(P, Q))))
    assert told is not None
    assert math.isnan(told["covariance"][0])
    assert told["usec"] == 0
    assert vision_position_estimate(PoseSample(measurement=Measurement(time_s=0.0, p_WB_m=P))) is None


def test_the_command_hands_poses_on(capsys: pytest.CaptureFixture[str]) -> None:
    """Lines of text in, MAVLink out, counted."""
    with UdpSocket("0") as free:
        port = free.port

    def send() -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            for _ in range(50):
                sender.sendto(b'{"p": [1, 2, 3], "q": [1, 0, 0, 0]}', ("127.0.0.1", port))
                time.sleep(0.01)

    with UdpSocket("0") as autopilot:
        sender = threading.Thread(target=send)
        sender.start()
        words = ["link", "sensors", "--poses", str(port), "--forward", f"127.0.0.1:{autopilot.port}"]
        assert run([*words, "--seconds", "0.4", "--json"]) == 0
        sender.join()
        told = json.loads(capsys.readouterr().out)
        received = autopilot.read()
    assert told["forwarded"]["sent"] == told["sensors"][0]["samples"] == len(received) > 3
    assert _parsed(received[0]).get_type() == "VISION_POSITION_ESTIMATE"
