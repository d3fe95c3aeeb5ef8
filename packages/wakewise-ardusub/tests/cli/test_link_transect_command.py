"""`wakewise link transect` and `orbit`: refusals in one line, and flights over loopback beside the stand-in."""

from __future__ import annotations

import json
import math
import socket
import threading
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("pymavlink", reason="the extra `links` is not installed")
pytest.importorskip("lupa", reason="the extra `links` is not installed")

from wakewise.core.geometry import Pose, euler_from_quat
from wakewise.core.interfaces import BodyState
from wakewise.robot.vehicles import load_vehicle
from wakewise.ui.cli.main import run
from wakewise_ardusub.link.protocol import ALT_HOLD, POSHOLD
from wakewise_ardusub.physics.physics import PulseTable
from wakewise_ardusub.physics.surface import FreeWater
from wakewise_ardusub.sitl.inprocess_session import ScriptedGroundStation, route_messages, shipped_script
from wakewise_ardusub.sitl.sea_sensors import Relief, SeaSensors, SensorErrors
from wakewise_ardusub.sitl.simulated_autopilot import SimulatedAutopilot
from wakewise_ardusub.sitl.udp_endpoints import InProcessPhysics, UdpEndpoint
from wakewise_ardusub.sitl.udp_endpoints import run as run_stand_in
from wakewise_ardusub.survey.transect_session import TransectSession

Capture = pytest.CaptureFixture[str]


@pytest.fixture(params=[False], ids=["no script"])
def sea(request: pytest.FixtureRequest) -> Iterator[tuple[SimulatedAutopilot, str]]:
    """A stand-in with a pilot above a flat bed, in ALT_HOLD 0.9 m above it, and where it speaks to."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    sensors = SeaSensors(Relief(), SensorErrors(gaps_per_min=0.0), np.random.default_rng(0))
    values, scripts = ({}, shipped_script()) if request.param else ({"SCR_ENABLE": 0.0}, None)
    autopilot = SimulatedAutopilot(values, loop_hz=50.0, sensors=sensors, scripts=scripts)
    autopilot.set_mode(ALT_HOLD)
    vehicle = load_vehicle("bluerov2-heavy")
    start = BodyState(X_WB=Pose(np.array([0.0, 0.0, 4.1]), np.array([1.0, 0.0, 0.0, 0.0])))
    behind = InProcessPhysics(body=FreeWater(vehicle, start), table=PulseTable.of(vehicle))
    link, ended = UdpEndpoint("127.0.0.1", port, out=True), threading.Event()
    pilot = ScriptedGroundStation(autopilot, route_messages(autopilot, [link]))
    runner = threading.Thread(
        target=run_stand_in,
        args=(autopilot, behind, [link], lambda: not ended.is_set()),
        kwargs={"turn": pilot.turn},
    )
    runner.start()
    yield autopilot, f"udpin:127.0.0.1:{port}"
    ended.set()
    runner.join(10.0)
    link.close()


@pytest.mark.slow
def test_a_short_line_is_flown_over_loopback(
    sea: tuple[SimulatedAutopilot, str], tmp_path: Path, capsys: Capture
) -> None:
    """1 m at 30 cm/s with consent given beforehand: it ends in POSHOLD, with figures and a journal."""
    autopilot, connection = sea
    line = ["--length", "1", "--speed", "0.3", "--every", "0.5", "--gap", "3"]
    code = run(["link", "transect", "--connection", connection, *line, "--consent", "--out", str(tmp_path), "--json"])
    told = json.loads(capsys.readouterr().out)
    assert code == 0
    assert told["finished"]
    assert told["flown_m"] == pytest.approx(1.0, abs=0.02)
    assert autopilot.mode == POSHOLD
    assert autopilot.photographs == told["photographs"] == 2
    assert (tmp_path / "journal.jsonl").stat().st_size > 200
    assert json.loads((tmp_path / "figures.json").read_text(encoding="utf-8")) == told


@pytest.mark.slow
@pytest.mark.parametrize("sea", [True], indirect=True, ids=["script"])
def test_a_short_line_of_allocated_thrusts_is_flown_over_loopback(
    sea: tuple[SimulatedAutopilot, str], tmp_path: Path, capsys: Capture
) -> None:
    """1 m at 30 cm/s with `--allocate`: it ends in POSHOLD, no output is driven any more, with the weight felt."""
    autopilot, connection = sea
    line = ["--allocate", "--length", "1", "--speed", "0.3", "--every", "0.5", "--gap", "3"]
    code = run(["link", "transect", "--connection", connection, *line, "--consent", "--out", str(tmp_path), "--json"])
    out, err = capsys.readouterr()
    assert not autopilot.overridden
    if any(words in err for words in ("stood still", "no thrusts from", "no position for", "no attitude")):
        pytest.skip(f"this computer stalled, which ends the flight as it must: {err.strip().splitlines()[-1]}")
    assert code == 0, err
    told = json.loads(out)
    assert told["finished"]
    assert told["flown_m"] == pytest.approx(1.0, abs=0.02)
    assert told["weight_N"] == pytest.approx(1.0, abs=0.4)
    assert autopilot.mode == POSHOLD
    assert autopilot.photographs == told["photographs"] == 2


def test_allocated_thrusts_need_somebody_who_consents(
    tmp_path: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without a terminal and without `--consent` nobody could: exit code 2 and one line, before anything is sent."""
    monkeypatch.setattr("sys.stdin", None)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    where = ["--connection", f"udpin:127.0.0.1:{port}", "--out", str(tmp_path)]
    assert run(["link", "transect", "--allocate", *where]) == 2
    assert "--allocate: there is no terminal" in capsys.readouterr().err


@pytest.mark.slow
def test_a_part_of_an_orbit_is_flown_over_loopback(
    sea: tuple[SimulatedAutopilot, str], tmp_path: Path, capsys: Capture
) -> None:
    """A tenth of a turn of 1.2 m at 10 cm/s: it ends in POSHOLD with the bow to the centre, which it tells."""
    autopilot, connection = sea
    line = ["--ahead", "1.2", "--turns", "0.1", "--direction", "right", "--every", "0.5", "--gap", "3"]
    code = run(["link", "orbit", "--connection", connection, *line, "--consent", "--out", str(tmp_path), "--json"])
    told = json.loads(capsys.readouterr().out)
    assert code == 0
    assert told["finished"]
    assert told["flown_m"] == pytest.approx(0.2 * math.pi * 1.2, abs=0.02)
    assert told["centre_m"] == pytest.approx([1.2, 0.0], abs=0.2)
    assert autopilot.mode == POSHOLD
    assert autopilot.photographs == told["photographs"] == 2
    assert euler_from_quat(autopilot.motion.q_WB)[2] == pytest.approx(-0.2 * math.pi, abs=0.1)


@pytest.mark.parametrize("command", ["transect", "orbit"])
def test_what_is_printed_is_kept_beside_the_journal(
    command: str, tmp_path: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The folder has the figures as JSON, also of a survey that ended before its first line."""

    def heard(session: TransectSession, codec: object, **options: object) -> None:
        session.known = replace(session.known, messages=1)

    monkeypatch.setattr("wakewise_ardusub.cli.link_survey._fly", heard)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    assert run(["link", command, "--connection", f"udpin:127.0.0.1:{port}", "--out", str(tmp_path), "--json"]) == 1
    told = json.loads(capsys.readouterr().out)
    assert told["finished"] is False
    assert json.loads((tmp_path / "figures.json").read_text(encoding="utf-8")) == told


def test_a_survey_that_heard_nothing_leaves_no_folder(tmp_path: Path, capsys: Capture) -> None:
    """One line that says so, and no journal without a word from the vehicle."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        where = f"udpin:127.0.0.1:{probe.getsockname()[1]}"
    folder = tmp_path / "survey"
    assert run(["link", "transect", "--connection", where, "--consent", "--wait", "1", "--out", str(folder)]) == 2
    assert "nothing is heard from the autopilot" in capsys.readouterr().err.splitlines()[-1]
    assert not folder.exists()


def test_an_altitude_without_a_rangefinder_is_refused(
    sea: tuple[SimulatedAutopilot, str], tmp_path: Path, capsys: Capture
) -> None:
    """After the time to wait: one line, exit code 2, and the vehicle was told nothing."""
    autopilot, connection = sea
    autopilot.sensors.range_lost = True
    code = run(["link", "transect", "--connection", connection, "--consent", "--wait", "6", "--out", str(tmp_path)])
    said = capsys.readouterr().err.strip().splitlines()[-1]
    assert code == 2
    assert "survey not begun within 6 s: no rangefinder that looks down" in said
    assert autopilot.mode == ALT_HOLD


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--altitude", "nan"], "--altitude nan: must be from 0.4 to 10"),
        (["--altitude", "0.2"], "--altitude 0.2"),
        (["--speed", "0.5"], "--speed 0.5: must be from 0.05 to 0.3"),
        (["--length", "nan"], "a length of nan m"),
        (["--area", "4"], "must be WIDTHxLENGTH"),
        (["--area", "4x20", "--length", "3"], "give one of them"),
        (["--area", "4x20", "--spacing", "0"], "--spacing 0"),
        (["--length", "300"], "--fence 200: the lines reach 300 m from the start"),
        (["--length", "3", "--spacing", "1"], "--spacing: is of the lines of --area"),
        (["--out", "flown"], "--out flown: holds the journal of another survey"),
        (["--heading", "up"], "--heading 'up': must be degrees"),
        (["--current", "fast"], "--current 'fast'"),
        (["--camera", "film"], "must be mavlink or digicam"),
        (["--gap", "60"], "--gap 60: must be from 0.3 to 5"),
        (["--every", "nan"], "--every nan"),
        (["--map", "utm.geojson"], "another projection"),
        (["--map", "none.geojson"], "no such file"),
        (["--connection", "udp:1"], "--connection"),
    ],
)
def test_bad_input_is_refused_in_one_line(
    options: list[str], words: str, tmp_path: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Exit code 2 before anything is connected, and nothing is written."""
    monkeypatch.chdir(tmp_path)
    line = {"type": "LineString", "coordinates": [[500000.0, 3740000.0], [500010.0, 3740000.0]]}
    (tmp_path / "utm.geojson").write_text(json.dumps(line))
    (tmp_path / "flown").mkdir()
    (tmp_path / "flown" / "journal.jsonl").write_text("{}\n")
    assert run(["link", "transect", *options]) == 2
    said = capsys.readouterr().err.strip()
    assert words in said
    assert len(said.splitlines()) == 1
    assert not (tmp_path / "runs").exists()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--ahead", "nan"], "--ahead or --radius nan: must be from 0.5 to 20"),
        (["--ahead", "0.6"], "at 0.1 m/s it must be 1.00 m or more"),
        (["--ahead", "1.5", "--speed", "0.3"], "at 0.3 m/s it must be 4.50 m or more"),
        (["--speed", "0.5"], "--speed 0.5: must be from 0.05 to 0.3"),
        (["--turns", "0"], "--turns 0: must be from 0.1 to 20"),
        (["--turns", "nan"], "--turns nan"),
        (["--altitude", "high"], "--altitude 'high': must be metres above the bed, such as 0.8 or 0.8,1.3"),
        (["--altitude", "0.8,"], "--altitude '0.8,': must be metres"),
        (["--altitude", "0.8,0.2"], "--altitude 0.2: must be from 0.4 to 10"),
        (["--direction", "north"], "--direction 'north': must be auto, right or left"),
        (["--centre", "3"], "--centre '3': must be NORTH,EAST in m"),
        (["--centre", "3,nan"], "--centre '3,nan'"),
        (["--centre", "3,2", "--ahead", "2"], "--ahead, --centre: give one of them"),
        (["--radius", "2"], "--radius: needs --centre"),
        (["--fence", "0"], "--fence 0: must be from 1 to 5000"),
        (["--current", "fast"], "--current 'fast'"),
        (["--vehicle", "none.yaml"], "none.yaml"),
        (["--connection", "udp:1"], "--connection"),
    ],
)
def test_bad_input_of_an_orbit_is_refused_in_one_line(
    options: list[str], words: str, tmp_path: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Exit code 2 before anything is connected, and nothing is written."""
    monkeypatch.chdir(tmp_path)
    assert run(["link", "orbit", *options]) == 2
    said = capsys.readouterr().err.strip()
    assert words in said
    assert len(said.splitlines()) == 1
    assert not (tmp_path / "runs").exists()
