"""The meter as a small computer runs it, beside a vehicle on loopback: heard right, and never a command."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("pymavlink", reason="the extra `links` is not installed")

import made_logs
from bare import command, environment
from loopback_vehicle import Vehicle, free_ends
from wakewise.robot.vehicles import load_vehicle
from wakewise.wake import wake_model
from wakewise_ardusub.vehicle_summary import VehicleSummary, vehicle_summary_json
from wakewise_ardusub.wash_meter.embedded import main
from wakewise_ardusub.wash_savings import WashSavingsCalculator

PULSES = made_logs.pulses(made_logs.ASTERN_S * made_logs.RATE_HZ)[:8]
RUN = "from wakewise_ardusub.wash_meter.embedded import main; sys.exit(main(sys.argv[1:]))"
ASK = urllib.request.build_opener(urllib.request.ProxyHandler({})).open


@pytest.fixture(scope="module")
def craft_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("craft") / "heavy.json"
    craft = VehicleSummary.of(load_vehicle("bluerov2-heavy"), wake_model("jet"))
    path.write_text(vehicle_summary_json(craft), encoding="utf-8")
    return path


class Small:
    """A meter in a process with NumPy and pymavlink only."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self.process = process
        self.told = [self._line()]
        self.address = self.told[0].split()[2]
        self.told.append(self._line())
        ends = re.search(r"listens at 127\.0\.0\.1:(\d+)", self.told[1])
        self.port = 0 if ends is None else int(ends[1])

    def _line(self) -> str:
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        if not line:
            assert self.process.stderr is not None
            raise AssertionError(self.process.stderr.read())
        return line

    def state(self) -> dict[str, Any]:
        with ASK(self.address + "state.json", timeout=10) as answer:
            told: dict[str, Any] = json.loads(answer.read())
        return told

    def command(self, what: str) -> tuple[int, dict[str, Any]]:
        try:
            with ASK(urllib.request.Request(self.address + what, method="POST"), timeout=10) as answer:
                return answer.status, json.loads(answer.read())
        except urllib.error.HTTPError as refusal:
            with refusal:
                return refusal.code, json.loads(refusal.read())

    def until(self, vehicle: Vehicle, true: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
        """Let the vehicle speak until the meter's state is so."""
        end_s = time.monotonic() + 20.0
        while time.monotonic() < end_s:
            vehicle.say(*PULSES)
            vehicle.listen()
            state = self.state()
            if true(state):
                return state
            time.sleep(0.05)
        raise AssertionError(state)


@contextmanager
def small(*arguments: str) -> Iterator[Small]:
    process = subprocess.Popen(
        command(RUN, *arguments, "--port", "0"),
        env=environment(), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    try:
        yield Small(process)
        process.send_signal(signal.SIGTERM)
        _, said = process.communicate(timeout=10)
        assert (process.returncode, said) == (0, "")
    finally:
        if process.poll() is None:
            process.kill()
            process.communicate()


def test_a_silent_meter_hears_and_says_nothing(craft_file: Path, tmp_path: Path) -> None:
    """Thrusts by direction, curve and voltage; rubbish and another vehicle do no harm; not one byte is sent."""
    params = tmp_path / "heavy.params"
    lines = [f"1\t1\tMOT_{i}_DIRECTION\t{d}\t9" for i, d in enumerate(made_logs.DIRECTIONS, 1)]
    params.write_text("# Onboard parameters\n" + "\n".join(lines) + "\n", encoding="utf-8")
    out = tmp_path / "out"
    with (
        small(
            "--connection", free_ends(), "--craft", str(craft_file), "--params", str(params), "--out", str(out)
        ) as meter,
        Vehicle(meter.port) as vehicle,
        Vehicle(meter.port, system=7) as other,
    ):
        assert "sends nothing; never a command" in meter.told[1]
        assert meter.state()["why_not"] is not None
        meter.until(vehicle, lambda state: state["running"])
        rng = np.random.default_rng(0)
        for _ in range(50):
            vehicle.send_bytes(rng.bytes(200))
            other.send_bytes(rng.bytes(200))
        other.say(*[1500] * 8)
        state = meter.until(vehicle, lambda state: state["others"] == [7] and state["running_instants"] > 5)
        assert (state["system"], state["armed"], state["mode"]) == (1, True, "MANUAL")
        assert state["voltage_V"] == pytest.approx(made_logs.VOLTAGE_V)
        assert state["directions_known"]
        assert state["bad_messages"] > 0
        craft = VehicleSummary.of(load_vehicle("bluerov2-heavy"), wake_model("jet"))
        calculator = WashSavingsCalculator(craft, np.array(made_logs.DIRECTIONS, dtype=float))
        flown = calculator.flown_N(np.array(PULSES, dtype=float), calculator.supply_V(made_logs.VOLTAGE_V))
        assert state["thrusts_N"]["flown"] == pytest.approx(flown)
        assert state["saved_pct"] > 50.0
        assert (vehicle.heard, other.heard) == ({}, {})
    rows = (out / "meter.csv").read_text().splitlines()
    assert rows[0].startswith("time_s,disturbance_flown,")
    assert all(len(row.split(",")) == len(rows[0].split(",")) for row in rows)
    assert len(rows) > 3
    assert json.loads((out / "meter.json").read_text())["running_instants"] >= len(rows) - 1


def test_a_meter_that_asks_and_publishes_says_no_more_than_that(craft_file: Path) -> None:
    """From component 192 of the vehicle: questions until all is known, heartbeats, two named values."""
    with (
        small("--connection", free_ends(), "--craft", str(craft_file), "--ask", "--publish") as meter,
        Vehicle(meter.port) as vehicle,
    ):
        state = meter.until(
            vehicle, lambda state: state["directions_known"] and {"WW_D", "WW_SAVED"} <= set(vehicle.values)
        )
        assert set(vehicle.heard) == {"PARAM_REQUEST_READ", "HEARTBEAT", "NAMED_VALUE_FLOAT"}
        assert vehicle.senders == {(1, 192)}
        assert vehicle.values["WW_D"] == pytest.approx(state["disturbance"]["flown"], rel=1e-6)


def test_a_meter_speaks_first_to_a_server_only(craft_file: Path) -> None:
    """udpout: a heartbeat says that somebody is there, and nothing else is sent."""
    with Vehicle(9) as vehicle:
        with small("--connection", f"udpout:127.0.0.1:{vehicle.port}", "--craft", str(craft_file)) as meter:
            end_s = time.monotonic() + 10.0
            while not vehicle.heard and time.monotonic() < end_s:
                time.sleep(0.02)
                vehicle.listen()
            state = meter.until(vehicle, lambda state: state["running"])
            assert not state["directions_known"]
        assert set(vehicle.heard) == {"HEARTBEAT"}


def test_a_page_may_mark_a_target_and_begin_anew(craft_file: Path) -> None:
    """A mark needs the vehicle's place; a command that nobody knows is none."""
    with (
        small("--connection", free_ends(), "--craft", str(craft_file)) as meter,
        Vehicle(meter.port) as vehicle,
    ):
        assert meter.command("mark")[0] == 409
        meter.until(vehicle, lambda state: state["can_mark"] and state["running_instants"] > 2)
        assert meter.command("mark") == (200, {"done": True})
        assert meter.until(vehicle, lambda state: state["marked"])["points"] == "of a mark in the world"
        assert meter.command("unmark")[0] == 200
        assert meter.command("begin")[0] == 200
        assert not meter.until(vehicle, lambda state: not state["marked"])["marked"]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--connection", "udp:127.0.0.1:1"], "--connection 'udp:127.0.0.1:1': 'udp' is not one of"),
        (["--connection", "tcp:127.0.0.1:5777"], "a meter listens by UDP"),
        (["--connection", "udpin:127.0.0.1:14660", "--ahead", "nan"], "--ahead nan"),
        (
            ["--connection", "udpin:127.0.0.1:14660", "--params", "nowhere.params"],
            "nowhere.params: No such file",
        ),
        (["--connection", free_ends(), "--craft", "nowhere.json"], "nowhere.json: cannot be read"),
        (["--connection", "udpin:127.0.0.1:14660", "--system", "300"], "--system 300"),
        (["--connection", "udpin:192.0.2.1:14660"], "--connection udpin:192.0.2.1:14660"),
    ],
)
def test_what_cannot_be_used_is_said_in_one_line(
    arguments: list[str], said: str, craft_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Status 2, before a port is opened."""
    assert main(["--craft", str(craft_file), *arguments, "--port", "0"]) == 2
    told = capsys.readouterr().err
    assert said in told
    assert told.count("\n") == 1
