"""What links say by where they are: the vehicle's size by collision shapes, its camera by a link of that name."""

from __future__ import annotations

import re

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.geometry import Pose
from wakewise.robot.importers.parsed_vehicle import R_LINK_CAMERA, ParsedVehicle
from wakewise.robot.importers.robot_description import Link, RobotDescription

_CAMERA = re.compile(r"(^|[_/:-])cam(era)?(_?\d+|_[a-z]+)?(_link|_frame)?$", re.IGNORECASE)
_AHEAD = re.compile(
    r"(^|[/:])((base|front|forward|main|fwd)_?)*cam(era)?(_(front|forward|main))?(_link|_frame)?$", re.IGNORECASE
)
_OPTICAL = re.compile(r"cam(?:era)?\w*_optical(?:_link|_frame)?$", re.I)
_R_FRD_CAMERA = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
_OUTSIDE_M = 1e-3
"""So far a thruster's place may lie outside the outline, by rounding."""


def read_outline(bodies: RobotDescription, found: ParsedVehicle) -> None:
    """Size and camera mount, where nothing else in the file states them."""
    if found.size_m is None:
        _read_size(bodies, found)
    if found.X_BC is None:
        _read_camera_link(bodies, found)


def _read_size(bodies: RobotDescription, found: ParsedVehicle) -> None:
    """The box round the collision shapes of the base link, which is centred on its origin, as `Vehicle.size_m` is.

    Taken only where it holds every thruster, since collision shapes may be drawn for buoyancy or for contact alone.
    """
    base = bodies.links[bodies.base]
    if not base.shapes:
        return
    if any(shape.half_m is None for shape in base.shapes):
        found.notes.append(f"size: collision meshes of link {base.name} are not measured, so it is not known")
        return
    reach = np.max([_reach(base.X_BL @ shape.X_LS, shape.half_m) for shape in base.shapes], axis=0)
    if np.any(reach <= 0.0):
        found.notes.append(f"size: a collision shape of link {base.name} has no extent, so it is not known")
        return
    kind = f"the box round {len(base.shapes)} collision shapes" if len(base.shapes) > 1 else "the collision shape"
    box = " x ".join(f"{2.0 * side:.4g}" for side in reach)
    outside = [t.name for t in found.thrusters if np.any(np.abs(t.p_m) > reach + _OUTSIDE_M)]
    if outside:
        found.notes.append(
            f"size: {kind} of link {base.name}, {box} m, leaves {', '.join(outside[:4])} outside, so it is not taken"
        )
        return
    found.size_m = 2.0 * reach
    found.notes.append(f"size: {kind} of link {base.name}, {box} m; an estimate, such shapes are drawn for collisions")
    where = f"size_m: an estimate by {kind} of link {base.name}"
    known = found.derived.get("body", f"{found.kind} {found.file.name}")
    found.derived["body"] = f"{known}; {where}"
    found.estimates.add("body")


def _reach(X_BS: Pose, half_m: Array | None) -> Array:
    """How far a shape goes from the body origin along each body axis, shape (3,)."""
    half = np.zeros(3) if half_m is None else half_m
    return np.asarray(np.abs(X_BS.p_m) + np.abs(X_BS.R) @ half)


def _read_camera_link(bodies: RobotDescription, found: ParsedVehicle) -> None:
    """Camera mount by a link that is called one: its x axis looks ahead (ROS REP 103), or z of an optical frame."""
    optical = [link for name, link in bodies.links.items() if _OPTICAL.search(name)]
    plain = [link for name, link in bodies.links.items() if _CAMERA.search(name) and link not in optical]
    if not optical and not plain:
        return
    link: Link = min(optical or plain, key=lambda link: _AHEAD.search(link.name) is None)
    # Of a body with z down its frames are taken to have z down too, so that the image is upright.
    axes = np.eye(3) if optical else R_LINK_CAMERA if found.frame == "FLU" else _R_FRD_CAMERA
    found.X_BC = Pose.from_matrix(link.X_BL.R @ axes, link.X_BL.p_m)
    looks = "the z axis of the optical frame" if optical else "its x axis"
    others = len(optical or plain) - 1
    more = f" of {others + 1} so called" if others else ""
    found.notes.append(
        f"camera: by the name of link {link.name}{more}, taken to look along {looks}; no sensor states it"
    )
    found.derived["camera_mount"] = f"{found.kind} {found.file.name}: link {link.name}, by its name"
