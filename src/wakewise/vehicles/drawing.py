"""A drawing of a vehicle from above and from the side: thrusters, the jets of positive thrust, the camera's view."""

from __future__ import annotations

import math
from dataclasses import dataclass
from html import escape

import numpy as np

from wakewise.arrays import Array
from wakewise.vehicles.vehicle import Vehicle

INK, MUTED, FRAME, HULL, JET, LENS = "#1d2b36", "#64748b", "#cbd5e1", "#eef3f7", "#0f7bbd", "#e8a317"
WIDTH, HEIGHT, TOP, BOTTOM = 980.0, 500.0, 86.0, 56.0
JET_LENGTH_DISKS = 2.2
FACE_ON = 0.35
"""A thruster whose axis shows less of its length than this on paper is drawn as a ring."""


@dataclass(frozen=True, kw_only=True)
class View:
    """One panel: which body axes point right and down on paper, and which points at the reader."""

    title: str
    right: int
    down: int
    toward_reader: Array
    centre_px: tuple[float, float]
    px_per_m: float
    origin_m: float

    def place(self, point_B_m: Array) -> tuple[float, float]:
        """Page coordinates of a point of the body."""
        cx, cy = self.centre_px
        return (
            cx + (float(point_B_m[self.right]) - self.origin_m) * self.px_per_m,
            cy + float(point_B_m[self.down]) * self.px_per_m,
        )

    def direction(self, vector_B: Array) -> tuple[float, float]:
        """Page components of a direction of the body, shortened by perspective."""
        return float(vector_B[self.right]), float(vector_B[self.down])


def drawing_svg(vehicle: Vehicle) -> str:
    """Draw a vehicle as one self-contained SVG, from above and from starboard, to one scale.

    Arrows are the jets of positive thrust, opposite to the force on the vehicle; a dot in a ring is a jet toward the
    reader and a cross one away from the reader.
    """
    views = _views(vehicle)
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH:.0f} {HEIGHT:.0f}" role="img" '
        f'font-family="system-ui, -apple-system, Segoe UI, Roboto, sans-serif" font-size="12" fill="{INK}">',
        f"<title>{escape(vehicle.title)}, seen from above and from starboard</title>",
        f'<rect width="{WIDTH:.0f}" height="{HEIGHT:.0f}" fill="#ffffff"/>',
        _text(24, 32, vehicle.title, size=18, weight=600),
        _text(24, 52, _summary(vehicle), colour=MUTED),
    ]
    for view in views:
        parts += _panel(vehicle, view)
    parts += [_scale_bar(views[0]), _legend(), "</svg>"]
    return "\n".join(parts) + "\n"


def _views(vehicle: Vehicle) -> tuple[View, View]:
    jet_m = JET_LENGTH_DISKS * _disk_m(vehicle)
    reach = np.abs(vehicle.thruster_positions_B_m).max(axis=0) + 0.75 * jet_m
    half = np.maximum(0.5 * vehicle.size_m, reach)
    cone_m = _cone_length(vehicle)
    front = max(float(half[0]), float(vehicle.X_BC.p_m[0]) + cone_m)
    origin_m = 0.5 * (front - float(half[0]))
    room_px = (0.5 * WIDTH - 48.0, HEIGHT - TOP - BOTTOM - 40.0)
    scale = min(room_px[0] / (front + float(half[0])), room_px[1] / (2.0 * max(float(half[1]), float(half[2]))))
    middle = TOP + 20.0 + 0.5 * (HEIGHT - TOP - BOTTOM - 20.0)
    return (
        View(
            title="From above",
            right=0,
            down=1,
            toward_reader=np.array([0.0, 0.0, -1.0]),
            centre_px=(0.25 * WIDTH, middle),
            px_per_m=scale,
            origin_m=origin_m,
        ),
        View(
            title="From starboard",
            right=0,
            down=2,
            toward_reader=np.array([0.0, 1.0, 0.0]),
            centre_px=(0.75 * WIDTH, middle),
            px_per_m=scale,
            origin_m=origin_m,
        ),
    )


def _panel(vehicle: Vehicle, view: View) -> list[str]:
    left = view.centre_px[0] - 0.25 * WIDTH
    parts = [
        f'<rect x="{left + 16:.1f}" y="{TOP - 16:.1f}" width="{0.5 * WIDTH - 32:.1f}" '
        f'height="{HEIGHT - TOP - BOTTOM + 16:.1f}" rx="8" fill="none" stroke="{FRAME}"/>',
        _text(left + 30, TOP + 6, view.title, weight=600),
    ]
    length, breadth = float(vehicle.size_m[view.right]), float(vehicle.size_m[view.down])
    corner = np.zeros(3)
    corner[view.right], corner[view.down] = -0.5 * length, -0.5 * breadth
    x, y = view.place(corner)
    parts.append(
        f'<rect x="{x:.1f}" y="{y:.1f}" width="{length * view.px_per_m:.1f}" height="{breadth * view.px_per_m:.1f}" '
        f'rx="10" fill="{HULL}" stroke="{MUTED}" stroke-width="1.2"/>'
    )
    parts += _camera(vehicle, view)
    # Furthest from the reader first, so that near thrusters lie on top.
    order = np.argsort(vehicle.thruster_positions_B_m @ view.toward_reader, kind="stable")
    labels: dict[tuple[int, int], list[int]] = {}
    for index in order:
        parts += _thruster(vehicle, view, int(index))
        labels.setdefault(_label_place(vehicle, view, int(index)), []).append(int(index) + 1)
    for (px, py), numbers in labels.items():
        parts += _label(px, py, "·".join(str(n) for n in sorted(numbers)))
    parts += _centres(vehicle, view) if view.down == 2 else []
    parts += _axes(view, left + 40, HEIGHT - BOTTOM - 46)
    return parts


def _thruster(vehicle: Vehicle, view: View, index: int) -> list[str]:
    thruster = vehicle.thrusters[index]
    x, y = view.place(thruster.p_BT_m)
    radius_px = math.sqrt(thruster.disk_area_m2 / math.pi) * view.px_per_m
    jet_B = -thruster.axis_B
    dx, dy = view.direction(jet_B)
    seen = math.hypot(dx, dy)
    if seen < FACE_ON:
        toward = float(jet_B @ view.toward_reader) > 0.0
        ring = f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius_px:.1f}" fill="#ffffff" stroke="{INK}" stroke-width="2"/>'
        r = 0.25 * radius_px
        dot = f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{r:.1f}" fill="{JET}"/>'
        strokes = f"M{x - r:.1f} {y - r:.1f}l{2 * r:.1f} {2 * r:.1f}m0 {-2 * r:.1f}l{-2 * r:.1f} {2 * r:.1f}"
        cross = f'<path d="{strokes}" stroke="{JET}" stroke-width="2"/>'
        return [ring, dot if toward else cross]
    ux, uy = dx / seen, dy / seen
    length = JET_LENGTH_DISKS * 2.0 * radius_px * seen
    # A round jet widens by about 11 degrees to each side of its axis.
    spread = 0.6 * radius_px + 0.2 * length
    tip_x, tip_y = x + length * ux, y + length * uy
    head = 7.0
    half_disk = max(radius_px, 6.0)
    # A disk whose axis leans out of the page shows as an ellipse.
    flat = max(half_disk * math.sqrt(max(0.0, 1.0 - seen * seen)), 3.0)
    angle = math.degrees(math.atan2(uy, ux))
    return [
        f'<path d="M{x - 0.6 * radius_px * uy:.1f} {y + 0.6 * radius_px * ux:.1f}'
        f"L{tip_x - spread * uy:.1f} {tip_y + spread * ux:.1f}"
        f"L{tip_x + spread * uy:.1f} {tip_y - spread * ux:.1f}"
        f'L{x + 0.6 * radius_px * uy:.1f} {y - 0.6 * radius_px * ux:.1f}Z" fill="{JET}" fill-opacity="0.13"/>',
        f'<path d="M{x:.1f} {y:.1f}L{tip_x - head * ux:.1f} {tip_y - head * uy:.1f}" stroke="{JET}" stroke-width="2"/>',
        f'<path d="M{tip_x:.1f} {tip_y:.1f}L{tip_x - head * ux - 0.55 * head * uy:.1f} '
        f"{tip_y - head * uy + 0.55 * head * ux:.1f}L{tip_x - head * ux + 0.55 * head * uy:.1f} "
        f'{tip_y - head * uy - 0.55 * head * ux:.1f}Z" fill="{JET}"/>',
        f'<ellipse cx="{x:.1f}" cy="{y:.1f}" rx="{flat:.1f}" ry="{half_disk:.1f}" fill="#ffffff" stroke="{INK}" '
        f'stroke-width="2" transform="rotate({angle:.1f} {x:.1f} {y:.1f})"/>',
    ]


def _label_place(vehicle: Vehicle, view: View, index: int) -> tuple[int, int]:
    """Where the number goes: behind the disk as its jet sees it, or beside a ring, toward the middle."""
    thruster = vehicle.thrusters[index]
    x, y = view.place(thruster.p_BT_m)
    dx, dy = view.direction(thruster.axis_B)
    seen = math.hypot(dx, dy)
    if seen >= FACE_ON:
        return round(x + 15.0 * dx / seen), round(y + 15.0 * dy / seen)
    radius_px = math.sqrt(thruster.disk_area_m2 / math.pi) * view.px_per_m
    return round(x + math.copysign(radius_px + 12.0, view.centre_px[0] - x)), round(y)


def _label(x: float, y: float, text: str) -> list[str]:
    width = 9.0 + 6.5 * len(text)
    return [
        f'<rect x="{x - 0.5 * width:.1f}" y="{y - 8:.1f}" width="{width:.1f}" height="16" rx="8" fill="{INK}"/>',
        _text(x, y + 4, text, colour="#ffffff", size=11, weight=600, anchor="middle"),
    ]


def _camera(vehicle: Vehicle, view: View) -> list[str]:
    eye = vehicle.X_BC.p_m
    R_BC = vehicle.X_BC.R
    x, y = view.place(eye)
    reach = _cone_length(vehicle)
    parts = []
    if view.down == 1:
        half = math.tan(0.5 * vehicle.camera_fov_rad)
        corners = [view.place(eye + reach * (R_BC[:, 2] + side * half * R_BC[:, 0])) for side in (-1.0, 1.0)]
        parts.append(
            f'<path d="M{x:.1f} {y:.1f}L{corners[0][0]:.1f} {corners[0][1]:.1f}L{corners[1][0]:.1f} '
            f'{corners[1][1]:.1f}Z" fill="{LENS}" fill-opacity="0.18" stroke="{LENS}" stroke-opacity="0.6"/>'
        )
    end_x, end_y = view.place(eye + reach * R_BC[:, 2])
    parts += [
        f'<path d="M{x:.1f} {y:.1f}L{end_x:.1f} {end_y:.1f}" stroke="{LENS}" stroke-width="1.5" '
        'stroke-dasharray="6 4"/>',
        f'<circle cx="{x:.1f}" cy="{y:.1f}" r="6" fill="{LENS}" stroke="{INK}" stroke-width="1.5"/>',
    ]
    return parts


def _centres(vehicle: Vehicle, view: View) -> list[str]:
    gx, gy = view.place(vehicle.p_BG_m)
    bx, by = view.place(vehicle.p_BB_m)
    return [
        f'<circle cx="{gx:.1f}" cy="{gy:.1f}" r="4" fill="{INK}"/>',
        f'<circle cx="{bx:.1f}" cy="{by:.1f}" r="4" fill="#ffffff" stroke="{INK}" stroke-width="1.5"/>',
    ]


def _axes(view: View, x: float, y: float) -> list[str]:
    names = "xyz"
    return [
        f'<path d="M{x:.1f} {y:.1f}h26m-5 -3l5 3l-5 3M{x:.1f} {y:.1f}v26m-3 -5l3 5l3 -5" fill="none" '
        f'stroke="{MUTED}" stroke-width="1.3"/>',
        _text(x + 31, y + 4, f"{names[view.right]} (fore)", colour=MUTED, size=11),
        _text(
            x + 5, y + 32, f"{names[view.down]} ({'starboard' if view.down == 1 else 'down'})", colour=MUTED, size=11
        ),
    ]


def _scale_bar(view: View) -> str:
    length = 0.1 * view.px_per_m
    x, y = WIDTH - 40.0 - length, HEIGHT - 24.0
    return (
        f'<path d="M{x:.1f} {y - 4:.1f}v8m0 -4h{length:.1f}m0 -4v8" fill="none" stroke="{INK}" stroke-width="1.5"/>'
        + _text(x - 10, y + 4, "100 mm", colour=MUTED, size=11, anchor="end")
    )


def _legend() -> str:
    y = HEIGHT - 24.0
    return (
        f'<path d="M24 {y:.1f}h22" stroke="{JET}" stroke-width="2"/><path d="M52 {y:.1f}l-7 -4v8z" fill="{JET}"/>'
        + _text(60, y + 4, "jet of positive thrust (dot: toward you, cross: away)", colour=MUTED, size=11)
        + f'<circle cx="368" cy="{y:.1f}" r="5" fill="{LENS}" stroke="{INK}" stroke-width="1.2"/>'
        + _text(379, y + 4, "camera, horizontal view", colour=MUTED, size=11)
        + f'<circle cx="536" cy="{y:.1f}" r="4" fill="{INK}"/>'
        + _text(546, y + 4, "centre of gravity", colour=MUTED, size=11)
        + f'<circle cx="662" cy="{y:.1f}" r="4" fill="#ffffff" stroke="{INK}" stroke-width="1.5"/>'
        + _text(672, y + 4, "of buoyancy", colour=MUTED, size=11)
    )


def _summary(vehicle: Vehicle) -> str:
    size = " x ".join(f"{1000.0 * s:.0f}" for s in vehicle.size_m)
    forward, reverse = float(vehicle.thrust_upper_N.max()), float(-vehicle.thrust_lower_N.min())
    return (
        f"{size} mm, {vehicle.mass_kg:g} kg, {len(vehicle.thrusters)} thrusters, "
        f"up to {forward:g} N forward and {reverse:g} N reverse each"
    )


def _cone_length(vehicle: Vehicle) -> float:
    return 0.3 * float(vehicle.size_m[0])


def _disk_m(vehicle: Vehicle) -> float:
    return 2.0 * math.sqrt(float(vehicle.disk_areas_m2.max()) / math.pi)


def _text(
    x: float, y: float, text: str, *, colour: str = INK, size: int = 12, weight: int = 400, anchor: str = "start"
) -> str:
    return (
        f'<text x="{x:.1f}" y="{y:.1f}" fill="{colour}" font-size="{size}" font-weight="{weight}" '
        f'text-anchor="{anchor}">{escape(text)}</text>'
    )
