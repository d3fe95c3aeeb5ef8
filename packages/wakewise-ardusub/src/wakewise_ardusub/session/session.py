"""Session of a real vehicle beside its pilot: from a connection to a flight, in threads that do not block each other.

The link's thread receives and evaluates from the start. A second thread waits for the vehicle, makes the parts of the
flight, runs them once (`run_warm_up`) and flies (`LiveFlight`). The owner passes the operator's key presses on and ends
the session.

`ProtectedRegion`: the points to protect, or a ball for a target of which only the position is known.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial import ConvexHull

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError, StageError
from wakewise.core.geometry import Pose, euler_from_quat, matrix_from_quat, quat_from_euler
from wakewise.core.interfaces import BodyState, TargetEstimate, TruthProvider
from wakewise.core.jit.precompile import compile_kernels
from wakewise.operation.flying import FLIGHT_JOBS
from wakewise.operation.loop import Step
from wakewise.operation.parts import Parts
from wakewise.operation.scenario import Scenario
from wakewise.operation.teleop.input.controls import Box
from wakewise.operation.teleop.live import LiveFlight
from wakewise.robot.importers import any_vehicle
from wakewise.scene.targets import Mesh, Region, Target
from wakewise_ardusub.link.message_state import MavlinkMessage, attitude_of
from wakewise_ardusub.link.motor_interface import VehicleMotors
from wakewise_ardusub.link.output_gate import OutputGate, Send
from wakewise_ardusub.link.session_log import JOURNAL_FILE, SessionLog
from wakewise_ardusub.session.boxed_target import MAPPED, BoxDesignation, BoxedTarget, Follow, mapped_target
from wakewise_ardusub.session.camera_mount import GIVES, WAITS_S, MountControl
from wakewise_ardusub.session.cameras import MakeCamera, note_view
from wakewise_ardusub.session.link_thread import LinkThread, MessageReceiver
from wakewise_ardusub.session.vehicle_flight import VehicleFlight, join_vehicle, surroundings_of_target
from wakewise_ardusub.session.warm_up import run_warm_up

if TYPE_CHECKING:
    from wakewise_ardusub.session.video_stream import VideoSource
    from wakewise_ardusub.session.video_tracking import VideoTracking

BALL_M = 0.25


def ball(middle_W_m: Array, radius_m: float) -> Target:
    """A ball that stands for a target of which only the place is known, on a bed that it touches."""
    golden = 0.5 * (1.0 + math.sqrt(5.0))
    corners = np.array([[s, t * golden, 0.0] for s in (-1.0, 1.0) for t in (-1.0, 1.0)])
    corners = np.vstack([np.roll(corners, k, axis=1) for k in range(3)])
    for _ in range(2):  # halve the edges of the icosahedron twice
        hull = ConvexHull(corners)
        edges = {tuple(sorted(pair)) for f in hull.simplices for pair in ((f[0], f[1]), (f[1], f[2]), (f[2], f[0]))}
        middles = np.array([corners[a] + corners[b] for a, b in sorted(edges)])
        corners = np.vstack([corners, middles]) / np.linalg.norm(np.vstack([corners, middles]), axis=1)[:, None]
    hull = ConvexHull(corners)
    faces = hull.simplices.astype(np.int64)
    p0, p1, p2 = (corners[faces[:, k]] for k in range(3))
    inward = np.einsum("ij,ij->i", np.cross(p1 - p0, p2 - p0), p0) < 0.0
    faces[inward] = faces[inward][:, ::-1]
    return Target(
        name="ball",
        mesh=Mesh(middle_W_m + radius_m * corners, faces),
        centre_W_m=middle_W_m,
        radius_m=radius_m,
        bed_z_m=float(middle_W_m[2]) + radius_m,
    )


def ball_points(middle_W_m: Array, radius_m: float) -> Region:
    """Fifteen points of a ball, of one weight each: its middle, and an octahedron and a cube on its surface."""
    cube = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)]) / math.sqrt(3.0)
    points = middle_W_m + radius_m * np.vstack([np.zeros((1, 3)), np.eye(3), -np.eye(3), cube])
    return Region(points_W_m=points, weights=np.ones(len(points)), distance_m=np.zeros(len(points)))


@dataclass(frozen=True, kw_only=True, eq=False)
class ProtectedRegion:
    """Where the target is: a place in the autopilot's frame, or so far ahead of the bow as the session begins.

    Parameters
    ----------
    place_W_m : ndarray, shape (3,), or None
        North, east, down from the autopilot's origin.
    ahead_m : float
        From the front of the vehicle's box, where no place is given.
    points : Region or None
        In the vehicle's level frame as the session begins, in place of a ball's.
    """

    place_W_m: Array | None = None
    ahead_m: float = 0.4
    points: Region | None = None

    def found(self, start: BodyState, length_m: float, camera_z_m: float) -> tuple[Array, float, Region]:
        """Middle and radius in W, and the points that stand for its water."""
        level = Pose(start.X_WB.p_m, quat_from_euler(0.0, 0.0, float(euler_from_quat(start.X_WB.q)[2])))
        if self.points is not None:
            places = level.apply(self.points.points_W_m)
            middle = 0.5 * (places.min(axis=0) + places.max(axis=0))
            radius = max(float(np.linalg.norm(places - middle, axis=1).max()), 0.01)
            spared = Region(points_W_m=places, weights=self.points.weights, distance_m=self.points.distance_m)
            return middle, radius, spared
        if self.place_W_m is not None:
            return self.place_W_m, BALL_M, ball_points(self.place_W_m, BALL_M)
        radius = min(BALL_M, 0.5 * self.ahead_m)
        middle = level.apply(np.array([0.5 * length_m + self.ahead_m, 0.0, camera_z_m]))
        return middle, radius, ball_points(middle, radius)


LOOK_S = 0.05
MOVED_M = 0.05
"""A mapped target that moved or grew by more is flown by where it is now: obstacle, look and mission."""
LEFT_S = 2.0
"""How long preparations are waited for at the end: there is nothing to keep of them."""


@dataclass(kw_only=True, eq=False)
class VehicleSession:
    """One session with one vehicle.

    Parameters
    ----------
    scenario : Scenario
    receiving : MessageReceiver
    send : callable
    folder : Path
        Becomes a trial folder with a journal.
    spare : ProtectedRegion
    session : int
        Number of this program's heartbeats.
    gate_options : mapping
        What else the output gate takes: limits, buttons, listen_only.
    camera : callable, optional
        Makes what takes the photographs; without it they are noted and not taken.
    box : tuple of float, optional
        Designates the target in the picture as the flight begins: left, top, right, bottom, see `boxed_target`.
    distance_m : float
        Of a target designated by a box where no rangefinder tells it.
    video : VideoSource, optional
        The camera's stream, in which that target is tracked.
    tilt_rad : float
        How far the camera is tilted up, where the autopilot reports no mount.
    """

    scenario: Scenario
    receiving: MessageReceiver
    send: Send
    folder: Path
    spare: ProtectedRegion
    session: int
    gate_options: dict[str, Any] = field(default_factory=dict)
    camera: MakeCamera | None = None
    box: Box | None = None
    distance_m: float = math.nan
    video: VideoSource | None = None
    tilt_rad: float = 0.0
    fault: BaseException | None = None
    preparing: str = "not begun"
    live: LiveFlight | None = None
    photographs: int = 0
    sea: VehicleFlight | None = None

    def __post_init__(self) -> None:
        if (self.folder / "steps.parquet").exists():
            raise InputError(f"--out {self.folder}: holds a flight already, give another folder")
        self.vehicle = any_vehicle(self.scenario.vehicle)
        self.drive = VehicleMotors(self.vehicle)
        self.journal = SessionLog(self.folder / JOURNAL_FILE)
        self.gate = OutputGate(
            send=self.send, drive=self.drive, journal=self.journal, session=self.session, **self.gate_options
        )
        self.mount = MountControl(gate=self.gate, vehicle=self.vehicle, stated_rad=self.tilt_rad)
        self._camera = None if self.camera is None else self.camera(self.gate, self.folder, self.journal)
        self.boxes: BoxDesignation | None = None
        self.tracking: VideoTracking | None = None
        self._link = LinkThread(self.receiving, self.gate, self._heard)
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, name="session", daemon=True)

    def start(self) -> None:
        """Listen, and fly once the vehicle is heard."""
        told = {"vehicle": self.vehicle.name, "method": self.scenario.method, "system": self.gate.known.system}
        self.journal.write("begin", **told)
        self._link.start()
        self._thread.start()

    def stop(self, why: str) -> None:
        """Let go of the vehicle at once, then end the flight, write its folder and close the journal."""
        try:
            self.gate.release(why)
            for _ in range(GIVES):
                self.mount.give_back()
        finally:
            self._link.stop(why)
        self._over.set()
        if self.live is not None:
            self.live.stop()
        if self._thread.is_alive():
            flies = self.live is not None and self.live.preparing is None
            self._thread.join(None if flies else LEFT_S)
        if self._camera is not None:
            self._camera.close()
        if self.boxes is not None:
            self.boxes.close()
        if self.tracking is not None:
            self.tracking.close()
        if self.sea is not None:
            self.sea.figures.close()  # after all that hands it work
        self.fault = self.fault or self._link.fault
        known, gate = self.gate.known, self.gate
        self.journal.write(
            "end", why=why, messages=known.messages, garbage=known.garbage, thrusts=gate.thrusts_sent,
            releases=gate.releases_sent, not_sent=gate.unsent, engagements=gate.engagement.entries,
            **self.figures(),
        )  # fmt: skip
        self.journal.close()

    @property
    def running(self) -> bool:
        """Whether flight and link are at work; `stop` a session of which one has ended, then see `fault`."""
        return self._thread.is_alive() and self._link.fault is None

    def figures(self) -> dict[str, Any]:
        """How the flight's loop kept its time, in ms; None before it began."""
        live = self.live
        flies = live is not None and live.time_s > 0.0
        pace = live.pace if live is not None and flies else None
        return {
            "flown_s": None if live is None else round(live.time_s, 3),
            "loop_jitter_ms_p99": None if pace is None else round(1e3 * pace.late_s(), 3),
            "photographs": self.photographs,
            "photographs_confirmed": self.gate.known.photographs,
            "trips": dict(self.gate.margins.trips),
            **({} if self.tracking is None else self.tracking.figures()),
        }

    def line(self) -> str:
        """How it stands, in one line for people; first what a terminal of 80 columns has to show."""
        gate, facts = self.gate, self.gate.facts()
        known, engagement = gate.known, gate.engagement
        armed = {True: "armed", False: "disarmed", None: "not heard"}[known.armed]
        live = self.live
        parts = [engagement.state + ("" if engagement.state == "engaged" else f" ({engagement.why})")]
        if live is None or live.preparing is not None:
            parts.append(self.preparing if live is None else f"begins: {live.preparing}")
        margins = gate.margins.words(gate.limits)
        if margins:
            parts.append(margins)
        parts += [f"{known.mode_name or '-'} {armed}", f"pose {_age(facts.pose_s)}"]
        if self.sea is not None and self.sea.figures.speeds_m_s is not None:
            flown, least = (1e3 * speed for speed in self.sea.figures.speeds_m_s)
            parts.append(f"water at the target {flown:.1f} mm/s rms, by least thrusts {least:.1f}")
        if self.boxes is not None and self.vehicle.tilt is not None:
            parts.append(self.mount.words)
        if self._camera is not None and known.camera:
            parts.append(known.camera)
        if self.boxes is not None and self.boxes.target is not None:
            parts.append(self.boxes.target.words)
        if self.tracking is not None:
            parts.append(self.tracking.words())
        if live is not None and live.preparing is None:
            parts.append(f"loop {1e3 * live.pace.late_s():.1f} ms")
        return "  ".join(parts)

    def _run(self) -> None:
        try:
            sea = self._prepared()
            if sea is None:
                return
            self.sea = sea
            self.live = live = LiveFlight(sea.parts, folder=self.folder, watch=self._watch, checked=False)
            if self._over.is_set():
                return
            live.run()
        except BaseException as fault:  # the owner asks for it; the vehicle is not driven without a flight
            self.fault = fault
            self.gate.release(f"the flight ended ({type(fault).__name__}: {fault})")

    def _warming(self, done: float, total: float, note: str = "") -> None:
        self.preparing = f"compiles, {done:g} of {total:g} done: {note}" if total else note

    def _prepared(self) -> VehicleFlight | None:
        """Wait for the vehicle, and join the parts to it; None where the session ended before."""
        gate = self.gate
        compile_kernels(FLIGHT_JOBS, self._warming)
        while not self._over.wait(LOOK_S):
            facts, buttons = gate.facts(), gate.button_fault
            if buttons:
                raise InputError(buttons)
            lacking = [
                what
                for what, age_s in (
                    ("heartbeat", facts.heartbeat_s), ("attitude", facts.telemetry_s), ("position", facts.pose_s),
                    ("depth", 0.0 if math.isfinite(facts.depth_m) else math.inf),
                    ("BTNn_FUNCTION", math.inf if buttons is None else 0.0),
                )
                if not age_s < gate.limits.heartbeat_s
            ]  # fmt: skip
            above_m = 0.0 if lacking else self._above_water_m()
            if not lacking and above_m <= 0.0:
                break
            self.preparing = (
                f"waits for {', '.join(lacking)} of system {gate.known.system}"
                if lacking
                else f"waits until the hull is under water, {above_m:.2f} m of it are above"
            )
        else:
            return None
        if self.vehicle.tilt is not None:
            self.preparing = "waits for the camera's mount"
            self.mount.ask_kind()
            end_s = gate.clock() + WAITS_S
            while not self.mount.reported and gate.clock() < end_s and not self._over.wait(LOOK_S):
                pass
        self.preparing = "preparing"
        start = self._here()
        middle, radius, region = self.spare.found(start, self.vehicle.size_m[0], float(self.vehicle.X_BC.p_m[2]))
        gate.target_W_m = middle
        sea = join_vehicle(
            self.scenario,
            gate,
            start=start,
            target=ball(middle, radius),
            region=region,
            clock=lambda: self._flight().pace,
            wait=lambda seconds: self._flight().wait(seconds),
            flown_N=self._flown_N,
            photographed=self._photographed,
            mount=self.mount,
        )
        if self.video is not None:
            from wakewise_ardusub.session.video_tracking import video_tracking  # OpenCV is an extra

            self.preparing = "preparing the tracker"
            self.tracking = video_tracking(self.video, sea.bare, gate.clock, self._protector(sea), self.folder)
        self.preparing = "warming up"
        took_s, period_s = run_warm_up(sea), 1.0 / sea.parts.control.rate_hz
        self.journal.write("rehearsed", step_ms=1e3 * took_s, period_ms=1e3 * period_s, target_W_m=middle)
        if took_s > period_s:
            raise StageError(
                f"method {self.scenario.method}: a step takes {1e3 * took_s:.0f} ms on this computer, the control "
                f"period is {1e3 * period_s:.0f} ms; end what else runs here, or take a lighter method, such as dp"
            )
        if self.tracking is not None:
            self.tracking.start()
        boxes = BoxDesignation(
            gate, sea.bare.camera, self._seen_from, self._follower(sea), self.distance_m, self._noted, self.tracking
        )
        if self.box is not None:
            here = self._here()
            boxes.designate(self.box, (here, here.X_WB @ self.mount.X_BC()))
            self._noted(0, boxes.target.words if boxes.target is not None else "")
        self.boxes = boxes
        # The vehicle may have moved while parts were made: an estimator that begins where it was takes the step to
        # where it is for a load, and the controller would push against that.
        return replace(sea, parts=sea.parts.replace(start=self._here()))

    def _heard(self, message: MavlinkMessage) -> None:
        """A message came: a command to track is answered once there is a flight."""
        if self.boxes is not None:
            self.boxes.take(message)

    def _watch(self, step: Step, truth_provider: TruthProvider | None) -> None:
        """What is computed and told at each step."""
        X_WC = step.estimate.X_WB @ self.mount.X_BC()
        if self.tracking is not None and not self.mount.silent:
            self.tracking.note(self._flight().pace.due_s(step.time_s), X_WC, step.estimate)
        if self.sea is not None and self.boxes is not None:
            self.sea.figures(step, truth_provider)
            self.boxes.told(X_WC)

    def _seen_from(self) -> tuple[BodyState, Pose] | None:
        """The estimate at the last step and the camera's pose there; None while nobody flies."""
        step = None if self.live is None else self.live.latest
        return None if step is None else (step.estimate, step.estimate.X_WB @ self.mount.X_BC())

    def _noted(self, result: int, words: str) -> None:
        self.journal.write("box", result=result, words=words)

    def _follower(self, sea: VehicleFlight) -> Follow:
        """Has the flight go by a target of a box, or by its first one."""

        def follow(found: BoxedTarget | None) -> None:
            if sea.operator.state.mode == "scan":
                raise InputError("box: the mission flies, hold first")
            sea.retarget(sea.bare if found is None else _parts_of(found, sea), self._estimate())

        return follow

    def _protector(self, sea: VehicleFlight) -> Callable[[TargetEstimate], None]:
        """Has the mapped target protected; one that moved or grew is flown by, too, unless a mission has begun."""
        flown_by: BoxedTarget | None = None

        def protect(mapped: TargetEstimate) -> None:
            nonlocal flown_by
            boxes, here = self.boxes, self._seen_from()
            if boxes is None or here is None:
                raise InputError("not flying yet")
            found = mapped_target(mapped, here[1].p_m)
            if boxes.target is None or boxes.target.distance_from != MAPPED:
                flown_by = None  # another box
            parts = _parts_of(found, sea)
            if (flown_by is not None and _near(found, flown_by)) or sea.on_mission:
                sea.protect(parts)
            else:
                sea.retarget(parts, here[0])
                flown_by = found
            boxes.target = found

        return protect

    def _estimate(self) -> BodyState:
        """The estimate at the last step; where the vehicle is heard to be before there is one."""
        here = self._seen_from()
        return self._here() if here is None else here[0]

    def _here(self) -> BodyState:
        """Where the vehicle is now, as heard; a position was heard."""
        known = self.gate.known
        assert known.place_W_m is not None
        return BodyState(X_WB=Pose(known.place_W_m, attitude_of(known)))

    def _above_water_m(self) -> float:
        """How far the highest corner of the hull's box is above the surface (m); negative if it is below."""
        R_WB = matrix_from_quat(attitude_of(self.gate.known))
        return float(0.5 * np.abs(R_WB[2]) @ np.array(self.vehicle.size_m)) - self.gate.known.depth_m

    def _flight(self) -> LiveFlight:
        assert self.live is not None  # nobody asks before there is one
        return self.live

    def _flown_N(self) -> Array:
        known = self.gate.known
        return self.drive.flown_N(known.parameters, known.servo_us, known.battery_V)

    def _photographed(self, time_s: float, estimate: BodyState) -> None:
        self.photographs += 1
        X_WC = estimate.X_WB @ self.mount.X_BC()
        if self.sea is not None:
            self.sea.figures.photographed(X_WC)
        self.journal.write("photograph", number=self.photographs, flight_s=time_s, p_WC_m=X_WC.p_m, q_WC=X_WC.q)
        with suppress(OSError):  # a full disk ends no flight; the journal counts what it lost
            note_view(self.folder, self.photographs, X_WC, time_s)
        if self._camera is not None:
            self._camera.take(self.photographs)


def _near(found: BoxedTarget, other: BoxedTarget) -> bool:
    """Whether two targets are one, hardly moved or grown."""
    moved_m = float(np.linalg.norm(found.centre_W_m - other.centre_W_m))
    return moved_m + abs(found.radius_m - other.radius_m) < MOVED_M


def _parts_of(found: BoxedTarget, sea: VehicleFlight) -> Parts:
    """The parts of a flight with another target."""
    target = ball(found.centre_W_m, found.radius_m)
    around = surroundings_of_target(target, sea.bare.surroundings.planes)
    return sea.bare.replace(target=target, region=found.region, surroundings=around)


def _age(seconds: float) -> str:
    return f"{1e3 * seconds:.0f} ms" if seconds < 10.0 else "none"
