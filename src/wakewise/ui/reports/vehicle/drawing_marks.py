"""Marks of the vehicle drawing: projections, thrusters with the jets of positive thrust, camera, centres, text."""

from __future__ import annotations

import math
from dataclasses import dataclass
from html import escape

import numpy as np

from wakewise.core.arrays import Array
from wakewise.robot.vehicles.draft import ThrusterDraft, VehicleDraft

INK, MUTED, FRAME, HULL, JET, LENS, BUOY = "#16232e", "#5b6b7a", "#d4dde5", "#f3f6f9", "#0b76b8", "#d98e04", "#0f9d8a"
FACE_ON = 0.35
"""A thruster whose axis shows less of its length than this on paper is drawn as a ring."""

SPREAD = 0.2
"""Growth of a jet's radius per length, about 11 degrees to each side, as for any round turbulent jet (J. H. W. Lee and
V. H. Chu, Turbulent Jets and Plumes, Springer 2003, chapter 2)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ProjectionPanel:
    """One panel: body directions that point right, down and at the reader, and where the body origin lies on paper.

    `right_B`, `down_B` and `toward_B` are unit vectors of the body frame, shape (3,); `origin_px` is the place of the
    body origin, and `box_px` the panel's left, top, width and height.
    """

    title: str
    right_B: Array
    down_B: Array
    toward_B: Array
    origin_px: tuple[float, float]
    box_px: tuple[float, float, float, float]
    px_per_m: float

    def place(self, point_B_m: Array) -> tuple[float, float]:
        """Page coordinates of a point of the body."""
        x, y = self.direction(point_B_m)
        return self.origin_px[0] + x * self.px_per_m, self.origin_px[1] + y * self.px_per_m

    def direction(self, vector_B: Array) -> tuple[float, float]:
        """Page components of a direction of the body, shortened as it leans out of the page."""
        return float(self.right_B @ vector_B), float(self.down_B @ vector_B)


@dataclass(frozen=True, kw_only=True)
class Sizes:
    """Lengths in metres that all panels share; what the file does not state is replaced by what shows well."""

    disk_m: float
    disk_stated: bool
    jet_m: float
    cone_m: float


def disk_radius_m(thruster: ThrusterDraft, sizes: Sizes) -> float:
    """Radius at which to draw a propeller."""
    if thruster.disk_area_m2 is None:
        return 0.5 * sizes.disk_m
    return math.sqrt(thruster.disk_area_m2 / math.pi)


def thruster_marks(draft: VehicleDraft, view: ProjectionPanel, index: int, sizes: Sizes, key: str) -> list[str]:
    """A thruster with its jet: a disk and a widening stream, or a ring with a dot (toward the reader) or a cross."""
    thruster = draft.thrusters[index]
    x, y = view.place(thruster.p_BT_m)
    radius = max(disk_radius_m(thruster, sizes) * view.px_per_m, 5.0)
    dx, dy = view.direction(-thruster.axis_B)
    seen = math.hypot(dx, dy)
    dash = "" if sizes.disk_stated else ' stroke-dasharray="3 2"'
    if seen < FACE_ON:
        toward = float(-thruster.axis_B @ view.toward_B) > 0.0
        r = 0.30 * radius
        cross = f"M{x - r:.1f} {y - r:.1f}l{2 * r:.1f} {2 * r:.1f}m0 {-2 * r:.1f}l{-2 * r:.1f} {2 * r:.1f}"
        return [
            _circle(x, y, radius, fill="#ffffff", stroke=INK, width=1.8, extra=dash),
            _circle(x, y, radius, fill=JET, extra=' fill-opacity="0.13"'),
            _circle(x, y, r, fill=JET) if toward else f'<path d="{cross}" stroke="{JET}" stroke-width="2.2"/>',
        ]
    ux, uy = dx / seen, dy / seen
    length = sizes.jet_m * view.px_per_m * seen
    wide = radius + SPREAD * sizes.jet_m * view.px_per_m
    tip_x, tip_y = x + length * ux, y + length * uy
    # A disk whose axis leans out of the page shows as an ellipse.
    flat = max(radius * math.sqrt(max(0.0, 1.0 - seen * seen)), 0.16 * radius, 2.2)
    angle = math.degrees(math.atan2(uy, ux))
    end_x, end_y = x + 0.62 * length * ux, y + 0.62 * length * uy
    return [
        f'<linearGradient id="{key}" gradientUnits="userSpaceOnUse" x1="{x:.1f}" y1="{y:.1f}" x2="{tip_x:.1f}" '
        f'y2="{tip_y:.1f}"><stop offset="0" stop-color="{JET}" stop-opacity="0.42"/>'
        f'<stop offset="1" stop-color="{JET}" stop-opacity="0"/></linearGradient>',
        f'<path d="M{x - radius * uy:.1f} {y + radius * ux:.1f}L{tip_x - wide * uy:.1f} {tip_y + wide * ux:.1f}'
        f'L{tip_x + wide * uy:.1f} {tip_y - wide * ux:.1f}L{x + radius * uy:.1f} {y - radius * ux:.1f}Z" '
        f'fill="url(#{key})"/>',
        arrow(x, y, end_x, end_y, JET),
        f'<ellipse cx="{x:.1f}" cy="{y:.1f}" rx="{flat:.1f}" ry="{radius:.1f}" fill="#ffffff" stroke="{INK}" '
        f'stroke-width="1.8"{dash} transform="rotate({angle:.1f} {x:.1f} {y:.1f})"/>',
    ]


def label_place(draft: VehicleDraft, view: ProjectionPanel, index: int, sizes: Sizes) -> tuple[int, int]:
    """Where the number goes: behind the disk as its jet sees it, or beside a ring, toward the middle."""
    thruster = draft.thrusters[index]
    x, y = view.place(thruster.p_BT_m)
    dx, dy = view.direction(thruster.axis_B)
    seen = math.hypot(dx, dy)
    if seen >= FACE_ON:
        return round(x + 15.0 * dx / seen), round(y + 15.0 * dy / seen)
    radius = max(disk_radius_m(thruster, sizes) * view.px_per_m, 5.0)
    side = math.copysign(1.0, view.origin_px[0] - x + 1e-6)
    return round(x + side * (radius + 12.0)), round(y)


def badge(x: float, y: float, words: str) -> list[str]:
    """Thruster numbers, white on dark."""
    width = 10.0 + 6.5 * len(words)
    return [
        f'<rect x="{x - 0.5 * width:.1f}" y="{y - 8:.1f}" width="{width:.1f}" height="16" rx="8" fill="{INK}"/>',
        text(x, y + 4, words, colour="#ffffff", size=11, weight=600, anchor="middle"),
    ]


def camera_marks(draft: VehicleDraft, view: ProjectionPanel, sizes: Sizes) -> list[str]:
    """The camera, its axis, and its horizontal field of view where the view shows it."""
    if draft.X_BC is None:
        return []
    eye, R_BC = draft.X_BC.p_m, draft.X_BC.R
    x, y = view.place(eye)
    parts = []
    across = math.hypot(*view.direction(R_BC[:, 0]))
    along = math.hypot(*view.direction(R_BC[:, 2]))
    if draft.camera_fov_rad is not None and across > 0.7 and along > 0.7:
        half = math.tan(0.5 * draft.camera_fov_rad)
        reach = sizes.cone_m
        sides = [view.place(eye + reach * (R_BC[:, 2] + side * half * R_BC[:, 0])) for side in (-1.0, 1.0)]
        parts.append(
            f'<path d="M{x:.1f} {y:.1f}L{sides[0][0]:.1f} {sides[0][1]:.1f}L{sides[1][0]:.1f} {sides[1][1]:.1f}Z" '
            f'fill="{LENS}" fill-opacity="0.16" stroke="{LENS}" stroke-opacity="0.55"/>'
        )
    if along > FACE_ON:
        end_x, end_y = view.place(eye + sizes.cone_m * R_BC[:, 2])
        parts.append(
            f'<path d="M{x:.1f} {y:.1f}L{end_x:.1f} {end_y:.1f}" stroke="{LENS}" stroke-width="1.5" '
            'stroke-dasharray="6 4"/>'
        )
    return [*parts, camera_mark(x, y)]


def centre_marks(draft: VehicleDraft, view: ProjectionPanel) -> list[str]:
    """Centre of gravity (quartered) and of buoyancy (ring), where the file states them."""
    parts = []
    if draft.p_BB_m is not None:
        parts.append(buoyancy_mark(*view.place(draft.p_BB_m)))
    if draft.p_BG_m is not None:
        parts.append(gravity_mark(*view.place(draft.p_BG_m)))
    return parts


def camera_mark(x: float, y: float) -> str:
    """The camera's place."""
    return _circle(x, y, 6.0, fill=LENS, stroke=INK, width=1.5)


def gravity_mark(x: float, y: float, r: float = 5.5) -> str:
    """The quartered circle of technical drawings."""
    quarters = (
        f"M{x:.1f} {y:.1f}v{-r:.1f}a{r:.1f} {r:.1f} 0 0 1 {r:.1f} {r:.1f}Z"
        f"M{x:.1f} {y:.1f}v{r:.1f}a{r:.1f} {r:.1f} 0 0 1 {-r:.1f} {-r:.1f}Z"
    )
    return _circle(x, y, r, fill="#ffffff", stroke=INK, width=1.2) + f'<path d="{quarters}" fill="{INK}"/>'


def buoyancy_mark(x: float, y: float, r: float = 5.5) -> str:
    """A ring."""
    return _circle(x, y, r, fill="#ffffff", stroke=BUOY, width=2.4)


def arrow(x: float, y: float, end_x: float, end_y: float, colour: str, head: float = 7.0) -> str:
    """A straight arrow."""
    length = math.hypot(end_x - x, end_y - y)
    if length < head:
        return ""
    ux, uy = (end_x - x) / length, (end_y - y) / length
    back_x, back_y = end_x - head * ux, end_y - head * uy
    side = 0.5 * head
    return (
        f'<path d="M{x:.1f} {y:.1f}L{back_x:.1f} {back_y:.1f}" stroke="{colour}" stroke-width="1.8"/>'
        f'<path d="M{end_x:.1f} {end_y:.1f}L{back_x - side * uy:.1f} {back_y + side * ux:.1f}'
        f'L{back_x + side * uy:.1f} {back_y - side * ux:.1f}Z" fill="{colour}"/>'
    )


def text(
    x: float, y: float, words: str, *, colour: str = INK, size: int = 12, weight: int = 400, anchor: str = "start"
) -> str:
    """One line of text."""
    return (
        f'<text x="{x:.1f}" y="{y:.1f}" fill="{colour}" font-size="{size}" font-weight="{weight}" '
        f'text-anchor="{anchor}">{escape(words)}</text>'
    )


def hull_half_m(draft: VehicleDraft) -> Array:
    """Half the box of the vehicle, shape (3,): as stated, else what holds its thrusters."""
    if draft.size_m is not None:
        return 0.5 * draft.size_m
    return np.asarray(np.maximum(1.1 * np.abs(np.stack([t.p_BT_m for t in draft.thrusters])).max(axis=0), 0.05))


def _circle(x: float, y: float, r: float, *, fill: str, stroke: str = "", width: float = 0.0, extra: str = "") -> str:
    line = f' stroke="{stroke}" stroke-width="{width:g}"' if stroke else ""
    return f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{r:.1f}" fill="{fill}"{line}{extra}/>'
