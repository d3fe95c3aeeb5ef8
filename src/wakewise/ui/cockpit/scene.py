"""The flight as a viser scene, to view only: target by its wash, vehicle with its thrusts, path.

viser serves it at the loopback address without access control, so it has no controls and no callbacks. Requests for a
public tunnel have no effect. The world is NED, with its z axis down on the screen.
"""

from __future__ import annotations

import contextlib
import io
from importlib.util import find_spec
from typing import Any

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.geometry import Pose
from wakewise.robot.vehicles import Vehicle

SPEED_SHARES = np.array([0.0, 0.3, 0.6, 1.0])
SPEED_RGB = np.array([[108, 146, 160], [226, 190, 104], [224, 116, 60], [178, 34, 62]], dtype=np.float64)
"""Colours of the wash along its scale, as on the page: a logarithm from 1 mm/s to `MOST_M_S`."""
MOST_M_S, _GENTLE_M_S = 0.1, 1e-3
HULL_RGB, JET_RGB, PATH_RGB = (247, 200, 89), (11, 114, 133), (120, 135, 145)
METRES_PER_NEWTON = 0.01
_PATH_STEP_M, _PATH_POINTS = 0.02, 4000
_POINT_M = 0.006


def has_viser() -> bool:
    """Whether viser is installed: the scene is an extra of the page."""
    return find_spec("viser") is not None


def speed_colours(speeds_m_s: Array) -> Array:
    """Colours 0 to 255, uint8, shape (n, 3), of speeds of the wash, shape (n,); NaN counts as zero."""
    known = np.maximum(np.nan_to_num(np.asarray(speeds_m_s, dtype=np.float64)), 0.0)
    shares = np.log1p(known / _GENTLE_M_S) / np.log1p(MOST_M_S / _GENTLE_M_S)
    channels = [np.interp(shares, SPEED_SHARES, SPEED_RGB[:, k]) for k in range(3)]
    return np.round(np.stack(channels, axis=-1)).astype(np.uint8)


def open_scene(vehicle: Vehicle, points_W_m: Array) -> ViserScene | None:
    """The scene of a flight; None where viser is not installed."""
    return ViserScene(vehicle, points_W_m) if has_viser() else None


class ViserScene:
    """A scene that is kept up to date; all of it in world NED.

    `points_W_m`, shape (n, 3): places on the target.
    """

    def __init__(self, vehicle: Vehicle, points_W_m: Array) -> None:
        self._vehicle = vehicle
        self._points_W_m = np.asarray(points_W_m, dtype=np.float32)
        self._path: list[Array] = []
        # viser greets on standard output, which belongs to the command line's own answer.
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            self._server = _closed_server()
        self._handles = self._furnish()

    @property
    def url(self) -> str:
        """Its URL, on this computer only."""
        return f"http://127.0.0.1:{self._server.get_port()}/"

    def show(self, X_WB: Pose, thrusts_N: Array | None = None, predicted_m_s: Array | None = None) -> None:
        """Move the vehicle, draw its thrusts, shape (m,), and colour the target by its wash, shape (n,)."""
        server = self._server
        with server.atomic():
            self._handles["vehicle"].position, self._handles["vehicle"].wxyz = X_WB.p_m, X_WB.q
            if thrusts_N is not None:
                self._handles["jets"].points = self._jets(np.asarray(thrusts_N))
            if predicted_m_s is not None and len(predicted_m_s) == len(self._points_W_m):
                self._handles["target"].colors = speed_colours(predicted_m_s)
            self._went(X_WB.p_m)
        server.flush()

    def close(self) -> None:
        """Stop serving."""
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            self._server.stop()

    def _furnish(self) -> dict[str, Any]:
        server, vehicle = self._server, self._vehicle
        scene = server.scene
        scene.set_up_direction("-z")
        # Environment maps would be fetched from the network.
        scene.configure_environment_map(None)
        scene.add_light_ambient("/light", intensity=1.2)
        server.gui.configure_theme(dark_mode=True, show_logo=False, show_share_button=False)
        panel = getattr(server.gui, "main_panel", None)  # not in viser 1.0
        if panel is not None:
            panel.minimize()
        centre, reach_m = self._points_W_m.mean(axis=0), float(np.ptp(self._points_W_m, axis=0).max())
        server.initial_camera.look_at = tuple(centre)
        server.initial_camera.position = tuple(centre + (2.2 * reach_m + 2.0) * np.array([-0.75, -0.45, -0.5]))
        server.initial_camera.up = (0.0, 0.0, -1.0)
        hull = scene.add_frame("/vehicle", show_axes=False)
        scene.add_box("/vehicle/hull", color=HULL_RGB, dimensions=tuple(0.8 * vehicle.size_m), opacity=0.55)
        return {
            "vehicle": hull,
            "target": scene.add_point_cloud(
                "/target",
                points=self._points_W_m,
                colors=speed_colours(np.zeros(len(self._points_W_m))),
                point_size=_POINT_M,
                point_shape="circle",
                precision="float32",
            ),
            "jets": scene.add_line_segments(
                "/vehicle/jets", points=self._jets(np.zeros(len(vehicle.thrusters))), colors=JET_RGB, thickness=0.008
            ),
        }

    def _jets(self, thrusts_N: Array) -> Array:
        """Lines from each thruster to where its jet goes, shape (m, 2, 3), in B."""
        thrusters = self._vehicle.thrusters
        starts = np.array([thruster.p_BT_m for thruster in thrusters])
        axes = np.array([thruster.axis_B for thruster in thrusters])
        ends = starts - METRES_PER_NEWTON * thrusts_N[:, None] * axes
        return np.stack([starts, ends], axis=1).astype(np.float32)

    def _went(self, p_W_m: Array) -> None:
        """Extend the drawn path by visible steps; its length is limited."""
        if self._path and np.linalg.norm(p_W_m - self._path[-1]) < _PATH_STEP_M:
            return
        self._path = [*self._path[-_PATH_POINTS:], np.asarray(p_W_m)]
        if len(self._path) > 1:
            way = np.stack([self._path[:-1], self._path[1:]], axis=1).astype(np.float32)
            if "way" in self._handles:
                self._handles["way"].points = way
            else:
                self._handles["way"] = self._server.scene.add_line_segments(
                    "/way", points=way, colors=PATH_RGB, thickness=0.003
                )


def _no_tunnel(*_: object, **__: object) -> None:
    """Do nothing, in place of the methods of Viser's server that open and close a tunnel."""


def _closed_server() -> Any:
    """Viser's server on this computer's own address, which opens no tunnel whoever asks.

    Its handlers look both methods up when a request comes, so the replacements are what is called.
    """
    import viser

    closed = {"request_share_url": _no_tunnel, "disconnect_share_url": _no_tunnel}
    return type("ClosedServer", (viser.ViserServer,), closed)(host="127.0.0.1", port=0, verbose=False)
