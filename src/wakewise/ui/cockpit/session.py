"""Teleoperated flights of one scenario, one after the other, each with its own folder.

A thread prepares the parts, starts the flight, follows its photographs and reports its end. The flight has its own
thread (`wakewise.operation.teleop.live`), pictures their own process, the server its own event loop; none waits for
another.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from wakewise.core.errors import InputError, StageError, WakewiseError
from wakewise.core.interfaces import TargetEstimate
from wakewise.operation import Parts, Scenario
from wakewise.operation.finding.camera_estimator import known_camera
from wakewise.operation.loop import Step
from wakewise.operation.teleop.assisted import AssistedPilot, assisted_pilot, switched_controller
from wakewise.operation.teleop.input.controls import CENTRED, ControlSource
from wakewise.operation.teleop.live import LiveFlight
from wakewise.operation.teleop.operator_state import (
    MODES,
    RANGES,
    WAYS,
    OperatorSettings,
    OperatorState,
    tracking_regime,
)
from wakewise.operation.teleop.region_methods import RegionMethods, region_methods
from wakewise.operation.teleop.target_tracking import PERCEPTION, SeenPicture, TargetTracking, pose_std
from wakewise.perception import TargetTracker
from wakewise.scene.targets import Region
from wakewise.ui.cockpit.control_mailbox import ControlMailbox
from wakewise.ui.cockpit.flight_snapshot import SnapshotRecorder
from wakewise.ui.cockpit.live_camera import CameraState, LiveCamera
from wakewise.ui.cockpit.live_coverage import LiveCoverage
from wakewise.ui.cockpit.scene import ViserScene, open_scene
from wakewise.ui.cockpit.state import (
    StateEncoder,
    WakeReadout,
    number,
    rounded,
    scenario_description,
    static_description,
    target_message,
)
from wakewise.ui.cockpit.view_model import CameraPicture, StatusMessage

TENDED_S, SCENE_EVERY_S = 0.05, 0.2
_MOST_NOTES = 200


class CockpitSession:
    """Flights of one scenario; the `ViewModel` of a server.

    Parameters
    ----------
    folder : Path or None
        Of the first flight; later ones get a number. None keeps nothing.
    paced : bool
        By the clock.
    device : ControlSource, optional
        Sticks at this computer.
    pictures : bool
        Whether the camera's picture is drawn.
    guided : bool
        Whether a coverage guide follows the photographs.
    scene : bool
        Whether viser's 3D scene is served beside the page, where viser is installed.
    """

    def __init__(
        self,
        scenario: Scenario | Parts,
        folder: Path | None,
        *,
        paced: bool = True,
        device: ControlSource | None = None,
        pictures: bool = True,
        guided: bool = True,
        scene: bool = False,
    ) -> None:
        self._parts = scenario if isinstance(scenario, Parts) else scenario.parts()
        self.mailbox, self.operator = ControlMailbox(device=device), OperatorState(OperatorSettings(watch_target=False))
        self._device, self._scene_wanted = device, scene
        self._scene: ViserScene | None = None
        self._fallback: str | None = None
        self.folder, self._paced, self._guided = folder, paced, guided
        self.flown: list[Path] = []
        self.flights = 0
        self.fault: BaseException | None = None
        self._camera = LiveCamera(self._parts.scenario, self._parts.given.get("target")) if pictures else None
        self.live: LiveFlight | None = None
        self._pilot: AssistedPilot | None = None
        self._readout: WakeReadout | None = None
        self.snapshots: SnapshotRecorder | None = None
        self._encoder: StateEncoder | None = None
        self._guide: LiveCoverage | None = None
        self._tracking: TargetTracking | None = None
        self._described: dict[str, Any] = {}
        self.preparing: str | None = "making the parts of the flight"
        self.edition = 0
        self._notes: deque[StatusMessage] = deque(maxlen=_MOST_NOTES)
        self._photos, self._pictures = 0, 0
        self._silt_shown: object = None
        self._shown_s = -np.inf
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._tend, name="session")
        self._began_s = time.monotonic()

    def start(self) -> None:
        """Prepare and fly, in threads of its own."""
        self._began_s = time.monotonic()
        if self._camera is not None:
            self._camera.start()
        self._thread.start()

    def stop(self) -> None:
        """End the flight, wait until its folder is written, and end all threads."""
        self._over.set()
        if self._thread.is_alive():
            self._thread.join()
        self._end_tracking()
        if self._camera is not None:
            self._camera.close()
        if self._scene is not None:
            self._scene.close()
            self._scene = None

    @property
    def running(self) -> bool:
        """Whether the session goes on, with a flight or between two."""
        return self._thread.is_alive()

    @property
    def flying(self) -> bool:
        """Whether the vehicle flies."""
        return self.preparing is None

    def welcome(self) -> dict[str, Any]:
        """Static data for a client; vehicle and target are empty while they are being made."""
        nothing = {
            "scenario": scenario_description(self._parts),
            "vehicle": {"name": self._parts.scenario.vehicle, "thrusters": []},
            "target": {"points_W_m": [], "centre_W_m": [0.0, 0.0, 0.0], "radius_m": 0.0},
        }
        ranges = {name: list(ends) for name, ends in RANGES.items()} | {"mode": list(MODES), "method": list(WAYS)}
        told = nothing | self._described
        url = None if self._scene is None else self._scene.url
        return told | {"settings": self._settings() | {"ranges": ranges}, "scene_url": url, "preparing": self.preparing}

    def state(self) -> dict[str, Any] | None:
        """State of the flight; None before the first step."""
        snapshots, encoder, live, pilot = self.snapshots, self._encoder, self.live, self._pilot
        if snapshots is None or encoder is None or live is None or pilot is None or not self.flying:
            return None
        snapshots.look()
        now = snapshots.now
        if now is None:
            return None
        controls, step = pilot.controls or CENTRED, now.step
        X_WC = step.estimate.X_WB @ live.parts.vehicle.X_BC_at(step.tilt_rad)
        return encoder.read(now) | {
            "mode": self.operator.state.mode,
            "settings": self._settings(),
            "controls": rounded(controls.axes, 3),
            "coverage": self._guide.told(X_WC) if self._guide is not None else None,
            "target": None if self._tracking is None else target_message(self._tracking, step.time_s, X_WC),
            "photos": len(live.exposures),
            "loop": {
                "behind_ms": number(1e3 * live.behind_s, 2),
                "solve_ms_p99": number(snapshots.solve_ms_p99, 2),
                "stick_to_thrust_ms_p99": number(self.mailbox.stick_to_thrust_ms_p99, 1),
            },
        }

    def notes(self) -> Sequence[StatusMessage]:
        """Notes since the last call."""
        told = []
        while self._notes:
            told.append(self._notes.popleft())
        return told

    def change_settings(self, changes: dict[str, Any]) -> None:
        """Change the operator's settings; raises InputError if a value is out of range."""
        self.operator.set(**changes)

    def designate(self, box: tuple[float, float, float, float] | None, frame: int) -> None:
        """Designate a box of a picture as the target; raises InputError where no pictures are drawn."""
        tracking = self._tracking_for("designate")
        if box is None:
            tracking.forget()
        else:
            tracking.designate(box, frame)

    def propose(self, what: str) -> None:
        """Ask for a proposed target, accept or refuse it; raises InputError if there is none, or no pictures."""
        tracking = self._tracking_for("proposal")
        if what == "ask":
            tracking.propose()
        else:
            tracking.answer(accepted=what == "accept")

    def picture(self) -> CameraPicture | None:
        """The camera picture now."""
        now = self.snapshots.now if self.snapshots is not None else None
        if now is None or self._camera is None:
            return None
        silt = now.silt if now.silt is not self._silt_shown else None
        try:
            jpeg = self._camera.draw(CameraState(X_WC=now.X_WC, silt=silt))
        except StageError as fault:
            self._say(f"{fault}; the flight goes on without it", "error")
            self._camera = None
            return None
        if jpeg is None:
            return None
        self._silt_shown = now.silt
        self._pictures += 1
        self._track(now.step, jpeg)
        return CameraPicture(number=self._pictures, time_s=now.step.time_s, jpeg=jpeg)

    def _tend(self) -> None:
        try:
            while not self._over.is_set():
                self._fly()
                self._await_next()
        except WakewiseError as fault:
            self._end(fault)
        except Exception as fault:  # a flight that cannot begin is told of like one that ended
            self._end(fault)

    def _fly(self) -> None:
        """One flight, from its preparation to its folder."""
        live = self._prepare()
        if self._over.is_set():
            return
        live.start()
        while live.running and live.latest is None:
            self._say_preparing(live.preparing or "the first step")
            self._over.wait(TENDED_S)
        if live.latest is not None:
            self._say(f"first light {time.monotonic() - self._began_s:.1f} s after the start")
            self._say_preparing(None)
            self._open_scene(live)
        while live.running and not self._over.wait(TENDED_S):
            self._follow(live)
            self._show_scene()
        live.stop()
        live.join()
        self._follow(live)
        self._close(live)

    def _prepare(self) -> LiveFlight:
        self._say_preparing("making the parts of the flight")
        parts = self._parts
        self.flights += 1
        if self._readout is None:
            self._readout = WakeReadout.of(parts)
            self._described = static_description(parts, self._readout)
        self._say_preparing("making pilot and controllers")
        pilot = assisted_pilot(parts, self.mailbox, self.operator)
        flown = parts.replace(pilot=pilot)
        methods = region_methods(flown)
        flown = flown.replace(controller=switched_controller(flown, lambda: pilot.state.method, methods))
        self._readout.disturbances(parts.start, np.full(len(parts.vehicle.thrusters), 0.1))  # kernels are read now
        self._readout.predicted_m_s(parts.start, np.full(len(parts.vehicle.thrusters), 0.1))
        snapshots = SnapshotRecorder(
            parts.vehicle,
            self._readout.true_points_W_m,
            1.0 / parts.control.rate_hz,
            self.mailbox.flown,
            lambda: pilot.velocity_W_m_s,
        )
        self._photos = 0
        if self._guided:
            self._say_preparing("looking for views of the target")
            self._guide = LiveCoverage(parts)
        live = LiveFlight(flown, folder=self._free_folder(), paced=self._paced, watch=snapshots)
        self._begin_tracking(parts, methods)
        self._pilot, self.snapshots, self.live = pilot, snapshots, live
        self._encoder = StateEncoder(self._readout, snapshots)
        return live

    def _begin_tracking(self, parts: Parts, methods: RegionMethods) -> None:
        """A tracker of this flight's pictures, which has no target yet."""
        if self._camera is None:
            return
        camera, ahead_m = known_camera(parts, PERCEPTION)
        tracker = TargetTracker(camera=camera, settings=PERCEPTION, seed=parts.scenario.seed)

        def protect(target: TargetEstimate | None) -> None:
            methods.protect(None if target is None else Region.of_estimate(target))

        self._tracking = TargetTracking(tracker, protect, ahead_m)
        self._tracking.start()

    def _tracking_for(self, kind: str) -> TargetTracking:
        tracking = self._tracking
        if tracking is None or self._camera is None:
            raise InputError(f"{kind}: no pictures are drawn, in which a target could be tracked")
        return tracking

    def _end_tracking(self) -> None:
        tracking, self._tracking = self._tracking, None
        if tracking is not None:
            tracking.close()

    def _track(self, step: Step, jpeg: bytes) -> None:
        """Hand a picture to the tracker, with the estimated pose of the camera."""
        tracking, live = self._tracking, self.live
        if tracking is None or live is None:
            return
        X_WC = step.estimate.X_WB @ live.parts.vehicle.X_BC_at(step.tilt_rad)
        std = pose_std(step.estimate)
        tracking.see(SeenPicture(frame=self._pictures, time_s=step.time_s, image=jpeg, X_WC=X_WC, std=std))

    def _follow(self, live: LiveFlight) -> None:
        """Forward the pilot's notes, and photographs to the coverage guide."""
        assert self._pilot is not None
        for note in self._pilot.notes():
            self._notes.append(StatusMessage(text=note.text, level=note.level, time_s=note.time_s))
        for level, text in getattr(self._device, "notes", tuple)():
            self._say(text, level)
        for level, text in () if self._tracking is None else self._tracking.notes(live.time_s):
            self._say(text, level)
        fallback = None if live.latest is None else live.latest.command.fallback
        if fallback != self._fallback:
            self._fallback = fallback
            self._say(f"fallback: {fallback}" if fallback else "no fallback any more", "warn" if fallback else "info")
        exposures = live.exposures
        for exposure in exposures[self._photos :]:
            self._photos += 1
            said = self._guide.saw(exposure.X_WC_est) if self._guide is not None else None
            self._say(f"photograph {self._photos}{f': {said}' if said else ''}", time_s=exposure.time_s)

    def _open_scene(self, live: LiveFlight) -> None:
        """Serve the 3D scene, after the first step, which it would delay."""
        if self._scene_wanted and self._scene is None and self._readout is not None:
            self._scene = open_scene(live.parts.vehicle, self._readout.points_W_m)
            self._scene_wanted = self._scene is not None
            self.edition += 1

    def _show_scene(self) -> None:
        """Update the scene at its interval while a page is open."""
        snapshots, encoder, now_s = self.snapshots, self._encoder, time.monotonic()
        if self._scene is None or snapshots is None or encoder is None or snapshots.now is None:
            return
        if now_s < self._shown_s + SCENE_EVERY_S or not snapshots.looked_at:
            return
        self._shown_s, step = now_s, snapshots.now.step
        self._scene.show(step.estimate.X_WB, snapshots.now.thrusts_N, encoder.predicted_m_s)

    def _close(self, live: LiveFlight) -> None:
        """Report the end of a flight."""
        self._end_tracking()
        if live.fault is not None:
            self.fault = live.fault
            self._say(f"the flight ended: {live.fault}", "error")
        if live.folder is not None and (live.folder / "steps.parquet").exists():
            self.flown.append(live.folder)
            self._say(f"the flight is over; it is kept in {live.folder}")
        self.operator.set(mode="hold")

    def _await_next(self) -> None:
        """Wait until the holder of the controls starts another flight."""
        if self._over.is_set():
            return
        self._say_preparing("the flight is over; hold, scan or operator begins another")
        while not self._over.wait(TENDED_S):
            controls = self.mailbox.read(0.0)
            asked = [what for what in (controls.pressed if controls is not None else ()) if what in MODES]
            if asked:
                self.operator.press(asked[-1])
                self._began_s = time.monotonic()
                return

    def _free_folder(self) -> Path | None:
        """The folder of the next flight: the given one, or with the first free number."""
        if self.folder is None:
            return None
        count, folder = 1, self.folder
        while (folder / "scenario.yaml").exists():
            count += 1
            folder = self.folder.with_name(f"{self.folder.name}-{count}")
        return folder

    def _end(self, fault: BaseException) -> None:
        self.fault = fault
        words = " ".join(str(fault).split()) or type(fault).__name__
        self._say(f"no flight: {words}", "error")
        self._say_preparing(f"no flight: {words}")
        self._over.set()

    def _say(self, text: str, level: str = "info", time_s: float | None = None) -> None:
        at_s = self.live.time_s if time_s is None and self.live is not None else time_s
        self._notes.append(StatusMessage(text=text, level=level, time_s=at_s or 0.0))

    def _say_preparing(self, what: str | None) -> None:
        if what != self.preparing:
            self.preparing = what
            self.edition += 1

    def _settings(self) -> dict[str, Any]:
        state = self.operator.state
        return asdict(state) | {"regime": tracking_regime(state.w_track)}
