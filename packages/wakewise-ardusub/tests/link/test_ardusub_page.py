"""The page about driving each motor: its program runs, and its table is the script's."""

from __future__ import annotations

import re
import socket
import threading
from pathlib import Path

import numpy as np

from wakewise.robot.vehicles import load_vehicle
from wakewise_ardusub.link import protocol
from wakewise_ardusub.link.script import script_text
from wakewise_ardusub.physics.physics import PulseTable
from wakewise_ardusub.physics.surface import FreeWater
from wakewise_ardusub.sitl.simulated_autopilot import SimulatedAutopilot
from wakewise_ardusub.sitl.udp_endpoints import InProcessPhysics, UdpEndpoint, run

PAGE = (Path(__file__).parents[4] / "docs" / "ardusub.md").read_text(encoding="utf-8")


def test_every_reason_is_in_the_table() -> None:
    """By number, in the script's own words."""
    for why, words in protocol.REASONS.items():
        assert f"| {why} | {words} |" in PAGE
    assert str(protocol.DEFAULT_MODES) in PAGE
    assert str(protocol.PARAMETER_TABLE) in PAGE


def test_the_program_of_the_page_drives_the_motors() -> None:
    """As it stands there, at another port and for half a second, against the stand-in with the shipped script."""
    (program,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    autopilot = SimulatedAutopilot(
        {"FS_GCS_ENABLE": 0.0, "FS_PILOT_INPUT": 0.0}, loop_hz=50.0, scripts={"w.lua": script_text()}
    )
    vehicle = load_vehicle("bluerov2-heavy")
    behind = InProcessPhysics(body=FreeWater(vehicle), table=PulseTable.of(vehicle))
    # The script switches itself off as it starts, with the first loops: the pilot switches it on after that.
    for _ in range(5):
        autopilot.step(behind.exchange(autopilot.pulses_us, 50))
    autopilot.set_parameter(protocol.ENABLE_PARAMETER, 1.0)
    autopilot.armed = True
    link, ended = UdpEndpoint("127.0.0.1", port, out=True), threading.Event()
    runner = threading.Thread(target=run, args=(autopilot, behind, [link], lambda: not ended.is_set()))
    runner.start()
    try:
        exec(  # what the page shows is what is run
            compile(
                program.replace("udpin:0.0.0.0:14560", f"udpin:127.0.0.1:{port}").replace("range(60)", "range(12)"),
                "docs/ardusub.md",
                "exec",
            ),
            {"__name__": "page"},
        )
        pulses = np.array(autopilot.pulses_us[:8])
        overridden = autopilot.overridden
    finally:
        ended.set()
        runner.join(10.0)
        link.close()
    assert overridden
    # Ahead: by the mixer's signs the two in front turn below the middle, the two behind above it.
    assert (pulses[:2] < 1472).all()
    assert (pulses[2:4] > 1528).all()
    assert behind.body.step(np.zeros(8), 0.02).v_W_m_s[0] > 0.0
