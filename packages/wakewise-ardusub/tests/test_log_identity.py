"""Every log is asked what vehicle it is of: tables of ArduSub are used for an ArduSub, and for nothing else."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("pymavlink", reason="the extra `links` is not installed")
pytest.importorskip("mcap", reason="the extra `links` is not installed")

import made_logs
from wakewise.core.errors import InputError
from wakewise.ui.cli.main import run
from wakewise_ardusub.logs.channels import VehicleIdentity, firmware_of
from wakewise_ardusub.logs.read import read_log
from wakewise_ardusub.logs.table import tabulate
from wakewise_ardusub.wash_meter.vehicle_listener import VehicleListener

Capture = pytest.CaptureFixture[str]
MADE: dict[str, Callable[..., bytes]] = {"a.tlog": made_logs.tlog, "a.mcap": made_logs.mcap}


def _written(folder: Path, name: str, data: bytes) -> Path:
    path = folder / name
    path.write_bytes(data)
    return path


@pytest.mark.parametrize("name", MADE)
@pytest.mark.parametrize(
    ("vehicle", "words"),
    [
        ((14, 3), "octorotor of ArduPilot (heartbeat type 14)"),
        ((1, 3), "fixed wing of ArduPilot (heartbeat type 1)"),
        ((11, 3), "surface boat of ArduPilot (heartbeat type 11)"),
        ((12, 12), "submarine of px4 (heartbeat type 12)"),
    ],
)
def test_a_log_of_another_vehicle_is_refused_by_its_name(
    tmp_path: Path, name: str, vehicle: tuple[int, int], words: str
) -> None:
    """Whatever else it holds: even parameters that only an ArduSub has do not outweigh the heartbeats."""
    path = _written(tmp_path, name, MADE[name](vehicle=vehicle))
    with pytest.raises(InputError) as fault:
        read_log(path)
    assert words in str(fault.value)
    assert "--any-vehicle" in str(fault.value)
    assert "\n" not in str(fault.value)


@pytest.mark.parametrize(
    ("text", "firmware"),
    [
        ("ArduSub V4.1.0 (f2af3c7e)", "ArduSub"),
        ("ArduCopter V3.2.1 (36b405fb)", "ArduCopter"),
        ("APM:Copter V3.3 (acf2e10c)", "Copter"),
        ("ArduPlane V3.8.2 (0b1d1b2)", "ArduPlane"),
        ("Blimp V4.5.0-dev (1f2)", "Blimp"),
        ("ChibiOS: d4fce84e", None),
        ("Frame: VECTORED_6DOF", None),
        ("PX4v2 003D003B 34355111 36343732", None),
    ],
)
def test_firmware_is_known_by_its_first_message(tmp_path: Path, text: str, firmware: str | None) -> None:
    """A .BIN says it in MSG, in old logs without a time; what is no firmware's name tells nothing."""
    assert firmware_of(text) == firmware
    for old in (False, True):
        path = _written(tmp_path, "a.BIN", made_logs.dataflash(old=old, firmware=text, told=False))
        if firmware in ("ArduSub", None):
            assert read_log(path).identity.firmware == firmware
            continue
        with pytest.raises(InputError, match=f"another vehicle, {firmware}, not of an ArduSub"):
            read_log(path)


def test_without_a_word_of_it_the_height_tells(tmp_path: Path) -> None:
    """No heartbeat, no parameter: what rises above the water is refused, a dive is read, and nothing is named of it."""
    for name, made in {**MADE, "a.BIN": made_logs.dataflash}.items():
        how: dict[str, Any] = {"told": False} | ({} if name == "a.BIN" else {"vehicle": None})
        with pytest.raises(InputError, match=r"9\.\d m above the water \((VFR_HUD|CTUN)\)"):
            read_log(_written(tmp_path, name, made(sink_m_s=-0.5, **how)))
        log = read_log(_written(tmp_path, name, made(**how)))
        assert log.identity == VehicleIdentity()
        assert "MANUAL" not in set(tabulate(log).rows["mode"].drop_nulls())
        assert read_log(_written(tmp_path, name, made(sink_m_s=-0.5, **how)), any_vehicle=True).series


def test_parameters_of_ardusub_alone_tell_it(tmp_path: Path) -> None:
    """MOT_n_DIRECTION is ArduSub's; its modes have their names again."""
    log = read_log(_written(tmp_path, "a.BIN", made_logs.dataflash()))
    assert log.identity.is_ardusub
    assert set(tabulate(log).rows["mode"].drop_nulls()) == {"MANUAL", "ALT_HOLD"}


@pytest.mark.parametrize("name", MADE)
def test_another_vehicle_is_read_on_demand_without_what_is_ardusubs(
    tmp_path: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    """Attitude, height, outputs and voltage; no sticks, thrusts, D or names of modes, and what it is stands there."""
    monkeypatch.chdir(tmp_path)
    path = _written(tmp_path, name, MADE[name](vehicle=(2, 3), sink_m_s=-0.5))
    assert run(["link", "log", str(path), "--any-vehicle", "--out", "out"]) == 0
    said = capsys.readouterr().out
    assert "quadrotor of ArduPilot" in said
    assert "height          9.9" in said
    assert "saved" not in said
    facts = json.loads(Path("out/log.json").read_text())
    assert facts["modes"].keys() == {"mode 19", "mode 2"}
    assert facts["depth_max_m"] is None
    assert facts["height_max_m"] == pytest.approx(9.95, abs=0.06)
    rows = tabulate(read_log(path, any_vehicle=True)).rows
    assert rows["stick_forward"].null_count() == len(rows)
    assert rows["servo_1_us"].null_count() < len(rows)
    assert run(["link", "log", str(path), "--any-vehicle", "--vehicle", "bluerov2-heavy", "--out", "b"]) == 2
    assert "leave the option out" in capsys.readouterr().err
    assert not Path("b").exists()


def test_nothing_is_judged_where_nothing_says_what_it_is(tmp_path: Path, capsys: Capture) -> None:
    """Without heartbeats the thrusters are judged for a vehicle that is named, not for the default one."""
    path = _written(tmp_path, "a.tlog", made_logs.tlog(vehicle=None, told=False))
    assert run(["link", "log", str(path), "--out", str(tmp_path / "a"), "--json"]) == 0
    assert "nothing in the log says what vehicle" in json.loads(capsys.readouterr().out)["why_no_hindsight"]
    words = ["--vehicle", "bluerov2-heavy", "--out", str(tmp_path / "b"), "--json"]
    assert run(["link", "log", str(path), *words]) == 0
    assert "saved_pct" in json.loads(capsys.readouterr().out)


def test_the_ardusub_of_a_log_is_taken_before_a_busier_vehicle(tmp_path: Path) -> None:
    """Beside a boat that says more, the ArduSub's samples are read, and the boat is left aside."""
    from pymavlink.dialects.v20 import ardupilotmega

    boat = ardupilotmega.MAVLink(None, srcSystem=7, srcComponent=1)
    stamp = struct.pack(">Q", round(1e6 * (made_logs.START_S + 20.0)))
    beat = stamp + ardupilotmega.MAVLink_heartbeat_message(11, 3, 81, 0, 4, 3).pack(boat)
    more = stamp + ardupilotmega.MAVLink_attitude_message(120_000, 0.0, 0.0, 0.0, 0, 0, 0).pack(boat)
    log = read_log(_written(tmp_path, "a.tlog", made_logs.tlog() + beat + 3000 * more))
    assert (log.system, log.others) == (1, (7,))
    assert log.identity.is_ardusub


def test_the_meter_asks_it_too() -> None:
    """A mode of another vehicle has a number and no name."""
    listener = VehicleListener()
    beat = {"type": 12, "autopilot": 3, "base_mode": 81, "custom_mode": 19}
    listener.hear(0.0, 1, 1, "SERVO_OUTPUT_RAW", {"port": 0})
    listener.hear(0.0, 1, 1, "HEARTBEAT", beat)
    assert listener.mode(0.5) == "MANUAL"
    listener.hear(1.0, 1, 1, "HEARTBEAT", beat | {"type": 2})
    assert listener.mode(1.5) == "mode 19"
    assert listener.identity.is_other
