"""The links against their bounds: frames of physics, the relay, the loop, noise, and what every loss leads to.

Frames, relay and loop are by the clock on the wall over sockets of this computer, since that is what a firmware or a
pilot meets; other work on the machine lowers them. Losses and noise are in the time of the stand-in.
"""

from __future__ import annotations

import multiprocessing
import socket
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from wakewise.experiments.trials.timing import BenchOptions
from wakewise.operation import load_scenario
from wakewise_ardusub.optional_dependencies import need
from wakewise_ardusub.physics import PhysicsServer, PulseTable, ServoFrame, write_request
from wakewise_ardusub.physics.physics import LOOPBACK, open_socket, serve
from wakewise_ardusub.sitl_plant import SitlPlant

VEHICLE = "bluerov2-heavy"
FUZZ_BYTES = 1_000_000
PHYSICS_S, LOOP_S, PASSES = 20.0, 60.0, 3000
LOOP_PERIOD_S = 0.1
STARTS_S, _PATIENCE_S = 2.0, 5.0
"""How long another process may take until it runs, and how much later it may be over."""
_READY_S = 900.0
_PULSES = (1560, 1440, 1430, 1575, 1535, 1465, 1540, 1460, *(0,) * 8)


def run(options: BenchOptions) -> dict[str, Any]:
    """Every figure of the links; `why` says what is missing."""
    need("wakewise bench link", "links", only=("pymavlink", "lupa"))
    steps: tuple[tuple[str, Callable[[], dict[str, Any]]], ...] = (
        ("physics", lambda: physics_figures(options)),
        ("relay", relay_figures),
        ("loop", lambda: loop_figures(options)),
        ("losses", loss_figures),
        ("noise", noise_figures),
    )
    found: dict[str, Any] = {}
    for k, (name, measure) in enumerate(steps):
        options.progress(k, len(steps), name)
        found = _joined(found, measure())
    options.progress(len(steps), len(steps), "")
    return found


def _joined(before: dict[str, Any], more: dict[str, Any]) -> dict[str, Any]:
    """Figures of two parts; counts of the same name add up, reasons join."""
    after = before | more
    for key in ("crashes", "thrust_while_disarmed"):
        if key in before and key in more:
            after[key] = before[key] + more[key]
    if "why" in before and "why" in more:
        after["why"] = before["why"] | more["why"]
    return after


def physics_figures(options: BenchOptions, seconds: float = PHYSICS_S) -> dict[str, Any]:
    """Frames a second of the tank with its water behind a client in another process that never waits."""
    parts = load_scenario("quick", None, {"vehicle": VEHICLE}).parts()
    behind = SitlPlant(parts=parts)
    behind.ready(options.progress)
    physics = PhysicsServer(behind.begin, PulseTable.of(parts.vehicle).thrusts)
    context = multiprocessing.get_context("spawn")
    counts: list[int] = []
    with open_socket(LOOPBACK, 0) as listening:
        client = context.Process(target=_fire, args=(listening.getsockname()[1], seconds), daemon=True)
        client.start()
        began = time.thread_time()
        serve(physics, listening, client.is_alive, said=lambda: counts.append(physics.figures().frames), every_s=1.0)
        took_s = time.thread_time() - began
        client.join()
    figures = physics.figures()
    whole = np.diff([count for count in counts if count])[:-1]
    return {
        "json_hz": float(np.mean(whole)) if whole.size else None,
        "json_hz_best": float(whole.max()) if whole.size else None,
        "json_hz_worst": float(whole.min()) if whole.size else None,
        "json_frames_per_cpu_s": figures.frames / took_s,
        "json_lost": figures.lost,
        **({} if whole.size else {"why": {"json_hz": "no whole second was measured"}}),
    }


def _fire(port: int, seconds: float) -> None:
    """A client that sends a frame as soon as the last one is answered."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
        out.bind((LOOPBACK, 0))
        out.settimeout(1.0)
        frame, end_s = 0, time.monotonic() + seconds
        while time.monotonic() < end_s:
            frame += 1
            out.sendto(write_request(ServoFrame(rate_hz=400, frame=frame, pulses_us=_PULSES)), (LOOPBACK, port))
            try:
                out.recv(2000)
            except TimeoutError:
                continue


def relay_figures(passes: int = PASSES) -> dict[str, Any]:
    """Milliseconds from a ground station's socket to the vehicle's, p99, while the companion drives."""
    from wakewise_ardusub.link.mavlink_relay import MavlinkRelay
    from wakewise_ardusub.sitl.inprocess_session import sticks_packet

    ends = [open_socket(LOOPBACK, 0) for _ in range(2)]
    vehicle, station = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
    heard: list[int] = []
    relay = MavlinkRelay(*ends, driving=lambda: True, heard=lambda data: heard.append(len(data)))
    took_ms = []
    try:
        for one in (vehicle, station):
            one.bind((LOOPBACK, 0))
            one.settimeout(1.0)
        relay.start()
        vehicle.sendto(b"\0", ends[0].getsockname())
        time.sleep(0.1)
        for k in range(passes):
            packet = sticks_packet(k)
            began_s = time.perf_counter()
            station.sendto(packet, ends[1].getsockname())
            vehicle.recv(2000)
            took_ms.append(1e3 * (time.perf_counter() - began_s))
            time.sleep(0.001)
    finally:
        relay.stop()
        for one in (*ends, vehicle, station):
            one.close()
    return {
        "relay_ms_p99": float(np.percentile(took_ms, 99)),
        "relay_ms_median": float(np.median(took_ms)),
        "relay_own_ms_p99": 1e3 * relay.latency_s(),
    }


def loop_figures(options: BenchOptions, seconds: float = LOOP_S) -> dict[str, Any]:
    """How far steps of the 10 Hz loop are from their time, p99, in a session with a stand-in in another process.

    A step is when its decision begins, by the newest estimate. A process that only sleeps at the same rate says how
    much of it is the computer's.
    """
    from wakewise.core.jit.precompile import compile_kernels
    from wakewise_ardusub.link.connection import Endpoint
    from wakewise_ardusub.link.transports import MavlinkCodec, UdpTransport
    from wakewise_ardusub.session.session import ProtectedRegion, VehicleSession
    from wakewise_ardusub.session.vehicle_flight import SEA
    from wakewise_ardusub.sitl.inprocess_session import fly_piloted

    compile_kernels(("plan", "fly"), options.progress)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind((LOOPBACK, 0))
        port = free.getsockname()[1]
    udp = UdpTransport(Endpoint(way="udpin", host=LOOPBACK, port=port))
    spawn = multiprocessing.get_context("spawn")
    other = spawn.Process(target=fly_piloted, args=(VEHICLE, port), daemon=True)
    asleep, told = spawn.Pipe(duplex=False)
    sleeper = spawn.Process(target=_sleep_and_wake, args=(seconds, told), daemon=True)
    steps_s: list[float] = []
    began_cpu = time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        post = MavlinkCodec(udp, 1)
        session = VehicleSession(
            scenario=load_scenario(None, None, {**SEA, "vehicle": VEHICLE, "name": "sea"}),
            receiving=post,
            send=post.send,
            folder=Path(folder) / "sea",
            spare=ProtectedRegion(),
            session=7,
        )
        gate: Any = session.gate
        estimated = gate.estimated

        def watched(estimate: Any) -> None:
            steps_s.append(time.monotonic())
            estimated(estimate)

        gate.estimated = watched
        other.start()
        try:
            session.start()
            engaged = _engage(session)
            sleeper.start()
            time.sleep(STARTS_S)
            steps_s.clear()
            time.sleep(seconds)
            bare_s = asleep.recv() if asleep.poll(_PATIENCE_S) else []
            still = session.gate.entry is not None
            how = f"{session.gate.engagement.state}: {session.gate.engagement.why}"
        finally:
            session.stop("measured")
            for process in (other, sleeper):
                if process.pid is not None:
                    process.terminate()
                    process.join()
            udp.close()
    if len(steps_s) < 10:
        why = f"no loop ran: {session.preparing}" if session.fault is None else str(session.fault)
        return {"loop_jitter_ms_p99": None, "why": {"loop_jitter_ms_p99": why}}
    spans = np.diff(np.array(steps_s))
    return {
        "loop_jitter_ms_p99": _jitter_ms(steps_s),
        "bare_jitter_ms_p99": _jitter_ms(bare_s),
        "loop_hz": float(1.0 / spans.mean()),
        "loop_engaged": engaged and still,
        "loop_state": how,
        "loop_cpu_s": time.process_time() - began_cpu,
    }


def _jitter_ms(steps_s: list[float]) -> float | None:
    """How far spans between steps are from the period, p99."""
    spans = np.diff(np.array(steps_s))
    return float(np.percentile(np.abs(spans - LOOP_PERIOD_S), 99)) * 1e3 if spans.size else None


def _sleep_and_wake(seconds: float, told: Any) -> None:
    """When a loop that does nothing woke."""
    begun_s, woke_s = time.monotonic(), list[float]()
    for k in range(round(seconds / LOOP_PERIOD_S)):
        time.sleep(max(begun_s + k * LOOP_PERIOD_S - time.monotonic(), 0.0))
        woke_s.append(time.monotonic())
    told.send(woke_s)


def _engage(session: Any, within_s: float = _READY_S) -> bool:
    """Consent as soon as all is well; whether that was within so long."""
    end_s = time.monotonic() + within_s
    while time.monotonic() < end_s and session.running:
        if session.live is not None and session.gate.engagement.state == "ready":
            return bool(session.gate.press() == "engaged")
        time.sleep(0.1)
    return False


def loss_figures() -> dict[str, Any]:
    """How long after each loss a script still drove an output, and thrusts while disarmed."""
    from wakewise.robot.vehicles import load_vehicle
    from wakewise_ardusub.sitl.companion_harness import COMPANION_FAULTS, run_companion_fault
    from wakewise_ardusub.sitl.inprocess_session import FAULTS, FaultOutcome, run_fault

    vehicle = load_vehicle(VEHICLE)
    after: dict[str, FaultOutcome] = {
        f"script alone: {name}": run_fault(vehicle, fault) for name, fault in FAULTS.items()
    }
    after |= {name: run_companion_fault(vehicle, fault) for name, fault in COMPANION_FAULTS.items()}
    return {
        "neutral_ms_max": max(one.neutral_ms for one in after.values()),
        "neutral_ms": {name: round(one.neutral_ms, 1) for name, one in after.items()},
        "thrust_while_disarmed": sum(one.disarmed_thrusts for one in after.values()),
        "thrust_after_disarm_ms_max": max(one.after_disarm_ms for one in after.values()),
    }


def noise_figures(count: int = FUZZ_BYTES) -> dict[str, Any]:
    """Noise on all ends at once: the autopilot, the companion beside it, physics; half of it while engaged."""
    from wakewise.robot.vehicles import load_vehicle
    from wakewise_ardusub.physics import FreeWater
    from wakewise_ardusub.sitl.companion_harness import CompanionHarness
    from wakewise_ardusub.sitl.inprocess_session import InProcessSession, noise, outcome

    vehicle = load_vehicle(VEHICLE)
    physics = PhysicsServer(lambda: FreeWater(vehicle), PulseTable.of(vehicle).thrusts)
    crashes = thrusts = heard = 0
    for k, engaged in enumerate((False, True)):
        aboard = CompanionHarness(InProcessSession(vehicle))
        flight = aboard.engaged().flight if engaged else aboard.flight.run(1.0)
        for i, piece in enumerate(noise(count // 2 + 1, k)):
            heard += len(piece)
            try:
                flight.carry(piece, "noise")
                physics.answer(piece, (LOOPBACK, 1), 0.0)
                if i % 10 == 0:
                    flight.run(1.0 / flight.loop_hz)
            except Exception:  # whatever it is, it is what is counted
                crashes += 1
        flight.run(1.0)
        thrusts += outcome(flight, flight.now_s).disarmed_thrusts
        crashes += len(flight.autopilot.script_faults)
    return {"fuzz_bytes": heard, "crashes": crashes, "thrust_while_disarmed": thrusts}
