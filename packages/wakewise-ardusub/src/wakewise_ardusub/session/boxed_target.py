"""Target that the operator designates by a box in the vehicle's picture: a frustum about the box's rays.

The box is a bundle of rays from the camera's estimated pose at the time of the command; the distance along its middle
is measured or stated, and as unsure as `DISTANCE_STD` says. The frustum over that interval is protected and stays fixed
in the world, until the target is mapped in the camera's stream (`video_tracking`), if there is one. What is refused
changes nothing: the last target stays protected.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import BodyState, TargetEstimate
from wakewise.operation.teleop.input.controls import Box
from wakewise.perception.settings import DISTANCE_STD
from wakewise.scene.targets import Region
from wakewise_ardusub.link.message_state import MavlinkMessage
from wakewise_ardusub.link.output_gate import OutputGate
from wakewise_ardusub.link.tracking_commands import (
    ACCEPTED,
    DENIED,
    FAILED,
    TEMPORARILY_REJECTED,
    TrackingCommand,
    command_ack,
    status_text,
    tracking_command,
    tracking_status,
)

if TYPE_CHECKING:
    from wakewise.vision.imaging.camera import Camera
    from wakewise_ardusub.session.video_tracking import VideoTracking

RANGE_S = 2.0
"""A rangefinder's word is as fresh as this."""
FORWARD, DOWN = 0, 25
"""MAV_SENSOR_ORIENTATION of rangefinders that look ahead and down."""
BEAM_RAD = math.radians(15.0)
"""Half the beam of a rangefinder that looks ahead: a box whose middle lies outside is of something else."""
NEAREST_M, FARTHEST_M = 0.1, 20.0
LEVELS = (0.1, 0.5, 0.9)
"""Rays of a box and depths of its frustum, in shares of their intervals."""
WEIGHT = 15.0
"""Of all points together, as of a ball's (`session.ball_points`)."""
STATUS_S = 0.5
MAPPED = "mapped"
"""Who says how far a target is that is mapped in the camera's stream."""


@dataclass(frozen=True, kw_only=True, eq=False)
class BoxedTarget:
    """Middle, shape (3,), and radius of the ball round the target, its points, and the distance of its middle.

    The points are those of the box's frustum, or of the mapped target's region.
    """

    centre_W_m: Array
    radius_m: float
    region: Region
    distance_m: float
    std_m: float
    distance_from: str

    @property
    def words(self) -> str:
        """For people."""
        return f"target by a box, {self.distance_m:.2f} m off (+-{self.std_m:.2f}, {self.distance_from})"


def target_distance(
    way_W: Array, X_WB: Pose, p_WC_m: Array, ranges: Mapping[int, tuple[float, float]], now_s: float, stated_m: float
) -> tuple[float, str]:
    """Distance of what lies along a ray, and who says so.

    The rangefinder that looks ahead, where the ray lies in its beam; else where the ray meets the bed, level at the
    altitude that the one looking down measures; else `stated_m`, NaN where nothing was stated.

    Parameters
    ----------
    way_W, p_WC_m : ndarray, shape (3,)
        Unit direction of the ray, and where it begins.
    X_WB : Pose
    ranges : mapping
        Distance in m and time of arrival by orientation.

    Raises
    ------
    InputError
        If there is none.
    """
    fresh = {turn: metres for turn, (metres, came_s) in ranges.items() if now_s - came_s <= RANGE_S}
    if FORWARD in fresh and float(way_W @ X_WB.R[:, 0]) >= math.cos(BEAM_RAD):
        found, said = fresh[FORWARD], "rangefinder"
    elif DOWN in fresh and way_W[2] > 0.0 and X_WB.R[2, 2] > 0.0:
        bed_z = float(X_WB.p_m[2] + fresh[DOWN] * X_WB.R[2, 2])
        found, said = (bed_z - float(p_WC_m[2])) / float(way_W[2]), "altitude"
        if found > FARTHEST_M and math.isfinite(stated_m):
            found, said = stated_m, "stated"
    else:
        found, said = stated_m, "stated"
    if not math.isfinite(found):
        raise InputError("no distance: no rangefinder, no --distance")
    if not NEAREST_M <= found <= FARTHEST_M:
        raise InputError(f"distance {found:.2f} m: must be {NEAREST_M:g} to {FARTHEST_M:g} m")
    return found, said


def boxed_target(
    box: Box,
    camera: Camera,
    X_WC: Pose,
    distance_of: Callable[[Array], tuple[float, str]],
) -> BoxedTarget:
    """The target of a box drawn in the picture of a camera at a pose.

    `distance_of` gives the distance along a unit direction, shape (3,), in W; raises InputError where there is none.
    """
    left, top, right, bottom = box
    grid = [(u, v) for v in LEVELS for u in LEVELS]
    pixels = np.array([[left + u * (right - left), top + v * (bottom - top)] for u, v in grid])
    pixels *= (camera.width, camera.height)
    middle_C = camera.unproject(pixels, np.ones(len(pixels)))[len(pixels) // 2]
    length = float(np.linalg.norm(middle_C))
    distance_m, said = distance_of(X_WC.R @ (middle_C / length))
    depths = distance_m / length * (1.0 + DISTANCE_STD * np.linspace(-1.0, 1.0, len(LEVELS)))
    points = X_WC.apply(np.vstack([camera.unproject(pixels, np.full(len(pixels), depth)) for depth in depths]))
    centre = 0.5 * (points.min(axis=0) + points.max(axis=0))
    return BoxedTarget(
        centre_W_m=centre,
        radius_m=max(float(np.linalg.norm(points - centre, axis=1).max()), 0.01),
        region=Region(
            points_W_m=points, weights=np.full(len(points), WEIGHT / len(points)), distance_m=np.zeros(len(points))
        ),
        distance_m=distance_m,
        std_m=DISTANCE_STD * distance_m,
        distance_from=said,
    )


def mapped_target(found: TargetEstimate, p_WC_m: Array) -> BoxedTarget:
    """The target as mapped in the camera's stream, from where the camera is, shape (3,)."""
    return BoxedTarget(
        centre_W_m=found.centre_W_m,
        radius_m=found.radius_m,
        region=Region.of_estimate(found),
        distance_m=float(np.linalg.norm(found.centre_W_m - p_WC_m)),
        std_m=found.centre_std_m,
        distance_from=MAPPED,
    )


def box_of(target: BoxedTarget, camera: Camera, X_WC: Pose) -> Box:
    """Where a target lies in the picture of a camera at a pose: edges NaN where it is not in it."""
    p_C = X_WC.inverse().apply(target.region.points_W_m[target.region.distance_m <= 0.0])
    nowhere = (math.nan,) * 4
    if not (p_C[:, 2] > 0.0).all():
        return nowhere
    shares = camera.project(p_C) / (camera.width, camera.height)
    (left, top), (right, bottom) = shares.min(axis=0), shares.max(axis=0)
    inside = right > 0.0 and bottom > 0.0 and left < 1.0 and top < 1.0
    return (float(left), float(top), float(right), float(bottom)) if inside else nowhere


Follow = Callable[[BoxedTarget | None], None]
"""Has what flies go by a target; None: by the session's first one again. Raises InputError where it cannot."""


class BoxDesignation:
    """Answers tracking commands, in a thread of its own: making the methods of a region takes longer than a step.

    Parameters
    ----------
    gate : OutputGate
        Knows the rangefinders, and sends the answers.
    camera : Camera
    here : callable
        The estimate now and the camera's pose X_WC; None while nobody flies.
    follow : Follow
    stated_m : float
        Distance where no rangefinder tells it; NaN for none.
    note : callable
        Told of every answer: result and words.
    video : VideoTracking, optional
        Tracks the target in the camera's stream.
    """

    def __init__(
        self,
        gate: OutputGate,
        camera: Camera,
        here: Callable[[], tuple[BodyState, Pose] | None],
        follow: Follow,
        stated_m: float,
        note: Callable[[int, str], object],
        video: VideoTracking | None = None,
    ) -> None:
        self._gate, self._camera, self._here, self._follow = gate, camera, here, follow
        self._stated_m, self._note, self._video = stated_m, note, video
        self._beside, self._busy = ThreadPoolExecutor(1, thread_name_prefix="box"), threading.Lock()
        self._last: TrackingCommand | None = None
        self._due_s = -math.inf
        self.target: BoxedTarget | None = None

    def take(self, said: MavlinkMessage) -> None:
        """A message came; only commands to track, or to stop that, change anything."""
        command = tracking_command(said, self._gate.known.system)
        if command is None:
            return
        last = self._last
        if last is not None and command.confirmation and replace(command, confirmation=last.confirmation) == last:
            self._gate.send("command_ack", command_ack(command, ACCEPTED))  # its answer was lost
            return
        here = self._here()
        if here is None or not self._busy.acquire(blocking=False):
            self._answer(command, TEMPORARILY_REJECTED, "box: not yet, send it again")
            return
        self._beside.submit(self._obey, command, here)

    def designate(self, box: Box, here: tuple[BodyState, Pose]) -> None:
        """Protect what lies in a box; raises InputError where that cannot be."""
        estimate, X_WC = here
        known, now_s = self._gate.known, self._gate.clock()
        found = boxed_target(
            box,
            self._camera,
            X_WC,
            lambda way: target_distance(way, estimate.X_WB, X_WC.p_m, known.ranges, now_s, self._stated_m),
        )
        if self._video is None:
            self._go_by(found)
        else:
            self._video.designate(box, found.distance_m, lambda: self._go_by(found))

    def forget(self) -> None:
        """Protect the first target again."""
        if self._video is None:
            self._go_by(None)
        else:
            self._video.forget(lambda: self._go_by(None))

    def _go_by(self, found: BoxedTarget | None) -> None:
        self._follow(found)
        self.target = found

    def told(self, X_WC: Pose) -> None:
        """Tell ground stations twice a second where the target is in the picture of the camera at this pose."""
        target, now_s = self.target, self._gate.clock()
        if target is not None and now_s >= self._due_s:
            self._due_s = now_s + STATUS_S
            self._gate.send("camera_tracking_image_status", tracking_status(box_of(target, self._camera, X_WC)))

    def close(self) -> None:
        """Finish what is under way."""
        self._beside.shutdown(wait=True)

    def _obey(self, command: TrackingCommand, here: tuple[BodyState, Pose]) -> None:
        try:
            box = command.box(self._camera.width / self._camera.height)
            if box is None:
                self.forget()
            else:
                self.designate(box, here)
            self._last = command
            self._answer(command, ACCEPTED, "target as at first" if self.target is None else self.target.words)
        except InputError as fault:
            self._answer(command, DENIED, str(fault))
        except Exception as fault:  # the flight goes on with the last target
            self._answer(command, FAILED, f"box: {type(fault).__name__}: {fault}")
        finally:
            self._busy.release()

    def _answer(self, command: TrackingCommand, result: int, words: str) -> None:
        self._note(result, words)
        self._gate.send("command_ack", command_ack(command, result))
        if result != ACCEPTED:
            self._gate.send("statustext", status_text(words))
