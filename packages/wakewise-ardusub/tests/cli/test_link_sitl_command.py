"""`wakewise link sitl` and `wakewise link sitl-autopilot`."""

from __future__ import annotations

import json
import socket
import threading
from contextlib import ExitStack
from pathlib import Path

import pytest

pytest.importorskip("pymavlink", reason="the extra `links` is not installed")
pytest.importorskip("lupa", reason="the extra `links` is not installed")

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from wakewise.ui.cli.main import run

Capture = pytest.CaptureFixture[str]


def test_the_stand_in_speaks_mavlink_and_says_how_it_went(capsys: Capture) -> None:
    """Heartbeats and the script's own state reach the port that is named; figures as JSON."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as station:
        station.bind(("127.0.0.1", 0))
        port = station.getsockname()[1]
        arguments = ["link", "sitl-autopilot", "--out", f"127.0.0.1:{port}", "--seconds", "0.6", "--json"]
        assert run(arguments) == 0
        station.settimeout(1.0)
        ears, names = mavlink.MAVLink(None), set()
        try:
            while True:
                names |= {message.get_type() for message in ears.parse_buffer(station.recv(1000)) or []}
                station.settimeout(0.01)
        except TimeoutError:
            pass
    assert {"HEARTBEAT", "ATTITUDE", "NAMED_VALUE_FLOAT", "STATUSTEXT"} <= names
    said = json.loads(capsys.readouterr().out)
    assert (said["armed"], said["mode"], said["script_faults"]) == (False, 19, [])
    assert said["time_s"] == pytest.approx(0.6, abs=0.25)


@pytest.mark.slow
def test_a_tank_behind_the_stand_in(capsys: Capture, tmp_path: Path) -> None:
    """Both commands as a user starts them: frames are answered, none lost, the vehicle where its mission begins.

    It begins under water here, so the autopilot calls that a depth of 0, and the difference is told and counted.
    """
    with ExitStack() as stack:
        free = [stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) for _ in range(2)]
        for each in free:
            each.bind(("127.0.0.1", 0))
        port, watch = (each.getsockname()[1] for each in free)
    beside = [
        "link",
        "sitl-autopilot",
        "--physics",
        f"127.0.0.1:{port}",
        "--out",
        f"127.0.0.1:{watch}",
        "--seconds",
        "12",
    ]
    other = threading.Thread(target=run, args=(beside,))
    other.start()
    asked = ["link", "sitl", "--port", str(port), "--world", "still-tank", "--seconds", "5", "--held", "0"]
    assert run([*asked, "--watch", f"127.0.0.1:{watch}", "--json"]) == 0
    said = json.loads(capsys.readouterr().out.partition("\nt ")[0])
    other.join()
    assert (said["vehicle"], said["world"], said["lost"], said["refused"]) == ("bluerov2-heavy", "still-tank", 0, 0)
    assert said["frames"] > 100
    assert 0.1 < said["depth_m"] < 3.0
    assert said["depth_apart"] == said["depth_looks"] > 0
    assert said["depth_apart_most_m"] == pytest.approx(said["depth_m"], abs=0.3)
    assert said["stage"] == ""


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["sitl", "--vehicle", "no-such"], "no-such"),
        (["sitl", "--world", "no-such"], "no-such"),
        (["sitl", "--rate", "5"], "--rate 5"),
        (["sitl", "--port", "70000"], "--port 70000"),
        (["sitl", "--watch", "nowhere"], "must be HOST:PORT"),
        (["sitl", "--host", "300.1.1.1"], "300.1.1.1"),
        (["sitl", "--params", "text.params"], "line 1"),
        (["sitl", "--params", "six.params"], "drives motors 1, 2"),
        (["sitl-autopilot", "--out", "nowhere"], "must be HOST:PORT"),
        (["sitl-autopilot", "--out", "127.0.0.1:0"], "must be HOST:PORT"),
        (["sitl-autopilot", "--physics", "9002"], "must be HOST:PORT"),
        (["sitl-autopilot", "--loop", "10"], "10 loops a second"),
        (["sitl-autopilot", "--params", "missing.params"], "missing.params"),
        (["sitl-autopilot", "--script", "missing.lua"], "missing.lua"),
        (["sitl-autopilot", "--script", "a.lua", "--no-script"], "one or the other"),
    ],
)
def test_bad_input_is_one_line(
    arguments: list[str], words: str, capsys: Capture, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And exit code 2, before anything is compiled or sent."""
    monkeypatch.chdir(tmp_path)
    Path("text.params").write_text("this is no parameter file\n")
    Path("six.params").write_text("SERVO1_FUNCTION,33\nSERVO2_FUNCTION,34\n")
    assert run(["link", *arguments]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert words in err
    assert err.count("\n") == 1


def test_a_pilot_of_its_own_arms_it_and_switches_the_script_on(capsys: Capture) -> None:
    """So that a companion can be tried with no ground station at all."""
    assert run(["link", "sitl-autopilot", "--out", "127.0.0.1:9", "--pilot", "--seconds", "1.5", "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["armed"]
    assert said["texts"][-1] == "Wakewise: no thrusts arrive"
