"""A drawing of a vehicle from above, from starboard and from ahead: thrusters, jets of positive thrust, camera view."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.robot.vehicles.check import AnyVehicle, actuation
from wakewise.robot.vehicles.describe import as_draft
from wakewise.robot.vehicles.draft import ThrusterDraft, VehicleDraft
from wakewise.ui.reports.vehicle.svg import INK, MUTED, svg_page, tag, text

FRAME, HULL, JET, LENS, BUOY = "#d4dde5", "#f3f6f9", "#0b76b8", "#d98e04", "#0f9d8a"
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
    outline = {"stroke": INK, "stroke_width": "1.8", "stroke_dasharray": None if sizes.disk_stated else "3 2"}
    if seen < FACE_ON:
        toward = float(-thruster.axis_B @ view.toward_B) > 0.0
        r = 0.30 * radius
        cross = f"M{x - r:.1f} {y - r:.1f}l{2 * r:.1f} {2 * r:.1f}m0 {-2 * r:.1f}l{-2 * r:.1f} {2 * r:.1f}"
        return [
            circle(x, y, radius, fill="#ffffff", **outline),
            circle(x, y, radius, fill=JET, fill_opacity="0.13"),
            circle(x, y, r, fill=JET) if toward else tag("path", d=cross, stroke=JET, stroke_width="2.2"),
        ]
    ux, uy = dx / seen, dy / seen
    length = sizes.jet_m * view.px_per_m * seen
    wide = radius + SPREAD * sizes.jet_m * view.px_per_m
    tip_x, tip_y = x + length * ux, y + length * uy
    # A disk whose axis leans out of the page shows as an ellipse.
    flat = max(radius * math.sqrt(max(0.0, 1.0 - seen * seen)), 0.16 * radius, 2.2)
    turn = f"rotate({math.degrees(math.atan2(uy, ux)):.1f} {x:.1f} {y:.1f})"
    end_x, end_y = x + 0.62 * length * ux, y + 0.62 * length * uy
    return [
        f'<linearGradient id="{key}" gradientUnits="userSpaceOnUse" x1="{x:.1f}" y1="{y:.1f}" x2="{tip_x:.1f}" '
        f'y2="{tip_y:.1f}"><stop offset="0" stop-color="{JET}" stop-opacity="0.42"/>'
        f'<stop offset="1" stop-color="{JET}" stop-opacity="0"/></linearGradient>',
        polygon(
            (x - radius * uy, y + radius * ux),
            (tip_x - wide * uy, tip_y + wide * ux),
            (tip_x + wide * uy, tip_y - wide * ux),
            (x + radius * uy, y - radius * ux),
            fill=f"url(#{key})",
        ),
        arrow(x, y, end_x, end_y, JET),
        tag("ellipse", cx=x, cy=y, rx=flat, ry=radius, fill="#ffffff", **outline, transform=turn),
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
        tag("rect", x=x - 0.5 * width, y=y - 8.0, width=width, height=16, rx=8, fill=INK),
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
        parts.append(polygon((x, y), *sides, fill=LENS, fill_opacity="0.16", stroke=LENS, stroke_opacity="0.55"))
    if along > FACE_ON:
        end_x, end_y = view.place(eye + sizes.cone_m * R_BC[:, 2])
        axis = f"M{x:.1f} {y:.1f}L{end_x:.1f} {end_y:.1f}"
        parts.append(tag("path", d=axis, stroke=LENS, stroke_width="1.5", stroke_dasharray="6 4"))
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
    return circle(x, y, 6.0, fill=LENS, stroke=INK, stroke_width="1.5")


def gravity_mark(x: float, y: float, r: float = 5.5) -> str:
    """The quartered circle of technical drawings."""
    quarters = (
        f"M{x:.1f} {y:.1f}v{-r:.1f}a{r:.1f} {r:.1f} 0 0 1 {r:.1f} {r:.1f}Z"
        f"M{x:.1f} {y:.1f}v{r:.1f}a{r:.1f} {r:.1f} 0 0 1 {-r:.1f} {-r:.1f}Z"
    )
    return circle(x, y, r, fill="#ffffff", stroke=INK, stroke_width="1.2") + tag("path", d=quarters, fill=INK)


def buoyancy_mark(x: float, y: float, r: float = 5.5) -> str:
    """A ring."""
    return circle(x, y, r, fill="#ffffff", stroke=BUOY, stroke_width="2.4")


def arrow(x: float, y: float, end_x: float, end_y: float, colour: str, head: float = 7.0) -> str:
    """A straight arrow."""
    length = math.hypot(end_x - x, end_y - y)
    if length < head:
        return ""
    ux, uy = (end_x - x) / length, (end_y - y) / length
    back_x, back_y = end_x - head * ux, end_y - head * uy
    side = 0.5 * head
    tip = ((end_x, end_y), (back_x - side * uy, back_y + side * ux), (back_x + side * uy, back_y - side * ux))
    shaft = f"M{x:.1f} {y:.1f}L{back_x:.1f} {back_y:.1f}"
    return tag("path", d=shaft, stroke=colour, stroke_width="1.8") + polygon(*tip, fill=colour)


def round_step(least: float) -> float:
    """The least of 1, 2 and 5 times the powers of ten that is not below a number."""
    power = 10.0 ** math.floor(math.log10(least))
    return next(factor * power for factor in (1.0, 2.0, 5.0, 10.0) if factor * power >= least)


def hull_half_m(draft: VehicleDraft) -> Array:
    """Half the box of the vehicle, shape (3,): as stated, else what holds its thrusters."""
    if draft.size_m is not None:
        return 0.5 * draft.size_m
    return np.asarray(np.maximum(1.1 * np.abs(np.stack([t.p_BT_m for t in draft.thrusters])).max(axis=0), 0.05))


def circle(x: float, y: float, r: float, **look: str | None) -> str:
    """A circle about a point."""
    return tag("circle", cx=x, cy=y, r=r, **look)


def polygon(*corners: tuple[float, float], **look: str) -> str:
    """A closed area."""
    return tag("path", d="M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in corners) + "Z", **look)


WIDTH, MARGIN, GAP, PAD, HEAD = 1080.0, 24.0, 16.0, 18.0, 40.0
TALLEST = 700.0
"""Height that the two rows of panels may take together."""

NARROWEST_CELL = 300.0
"""Room that the legend needs beside the view from above."""


def drawing_svg(vehicle: AnyVehicle, *, titled: bool = True) -> str:
    """Draw a vehicle as one self-contained SVG in three views to one scale.

    Arrows and the streams around them are the jets of positive thrust, opposite to the force on the vehicle; a dot in
    a ring is a jet toward the reader and a cross one away from the reader. What a draft does not state is left out or
    dashed. `titled` puts the name and a line of figures on top.

    Raises InputError if the vehicle has no thruster places, that is, only a matrix.
    """
    draft = as_draft(vehicle)
    if not draft.thrusters:
        raise InputError(f"drawing of {draft.name}: its file holds a matrix but no places of thrusters")
    sizes = _sizes(draft)
    heading = _heading(draft) if titled else []
    top = MARGIN + 18.0 * len(heading) + (14.0 if heading else 0.0)
    views, height, cell = _views(draft, sizes, top)
    parts: list[str] = []
    for line, (words, size, weight, colour) in enumerate(heading):
        parts.append(text(MARGIN, MARGIN + 14.0 + 18.0 * line, words, size=size, weight=weight, colour=colour))
    for number, view in enumerate(views):
        parts += _panel(draft, view, sizes, number)
    parts += _legend(draft, sizes, cell, views[0].px_per_m)
    return svg_page(WIDTH, height, f"{draft.title}, seen from above, from starboard and from ahead", parts)


def _heading(draft: VehicleDraft) -> list[tuple[str, int, int, str]]:
    lines = [(draft.title, 19, 650, INK), (_summary(draft), 12, 400, MUTED), (actuation(draft), 12, 400, MUTED)]
    if draft.missing:
        stated = textwrap.wrap(f"Not stated by its file: {', '.join(draft.missing)}.", 150)
        lines += [(line, 12, 400, "#b4232c") for line in stated]
    return lines


def _summary(draft: VehicleDraft) -> str:
    said = []
    if draft.size_m is not None:
        said.append(" x ".join(f"{1000.0 * s:.0f}" for s in draft.size_m) + " mm")
    if draft.mass_kg is not None:
        said.append(f"{draft.mass_kg:g} kg")
    said.append(f"{len(draft.thrusters)} thrusters")
    limits = draft.thrust_limits_N
    if limits is not None:
        said.append(f"up to {limits[1].max():g} N forward and {-limits[0].min():g} N reverse each")
    return ", ".join(said)


def _sizes(draft: VehicleDraft) -> Sizes:
    half = hull_half_m(draft)
    areas = [t.disk_area_m2 for t in draft.thrusters if t.disk_area_m2 is not None]
    disk = 2.0 * math.sqrt(max(areas) / math.pi) if areas else 0.16 * float(half[:2].min())
    return Sizes(
        disk_m=disk,
        disk_stated=len(areas) == len(draft.thrusters),
        jet_m=max(1.6 * disk, 0.42 * float(half[0])),
        cone_m=0.5 * float(half[0]),
    )


def _views(
    draft: VehicleDraft, sizes: Sizes, top: float
) -> tuple[list[ProjectionPanel], float, tuple[float, float, float, float]]:
    """Three panels to one scale, the page's height, and the box that is left for the legend."""
    low, high = _extent(draft, sizes)
    span = high - low
    scale = (WIDTH - 2.0 * MARGIN - GAP - 4.0 * PAD) / float(span[0] + span[1])
    scale = min(scale, (TALLEST - GAP - 2.0 * (HEAD + PAD)) / float(span[1] + span[2]))
    scale = min(scale, (WIDTH - 2.0 * MARGIN - GAP - 2.0 * PAD - NARROWEST_CELL) / float(span[0]))
    right_width = max(NARROWEST_CELL, span[1] * scale + 2.0 * PAD)
    left_width = WIDTH - 2.0 * MARGIN - GAP - right_width
    upper, lower = span[1] * scale + HEAD + PAD, span[2] * scale + HEAD + PAD
    right, down = MARGIN + left_width + GAP, top + upper + GAP
    x, y, z = np.eye(3)

    def panel(
        title: str, right_B: Array, down_B: Array, toward_B: Array, box: tuple[float, float, float, float]
    ) -> ProjectionPanel:
        middle = 0.5 * (low + high)
        return ProjectionPanel(
            title=title,
            right_B=right_B,
            down_B=down_B,
            toward_B=toward_B,
            origin_px=(
                box[0] + 0.5 * box[2] - float(right_B @ middle) * scale,
                box[1] + HEAD + 0.5 * (box[3] - HEAD - PAD) - float(down_B @ middle) * scale,
            ),
            box_px=box,
            px_per_m=scale,
        )

    views = [
        panel("From above", x, y, -z, (MARGIN, top, left_width, upper)),
        panel("From starboard", x, z, y, (MARGIN, down, left_width, lower)),
        panel("From ahead", -y, z, x, (right, down, right_width, lower)),
    ]
    return views, down + lower + MARGIN, (right, top, right_width, upper)


def _extent(draft: VehicleDraft, sizes: Sizes) -> tuple[Array, Array]:
    """Lowest and highest body coordinates that the drawing must show, with room for labels."""
    half = hull_half_m(draft)
    points = [half, -half]
    for thruster in draft.thrusters:
        wide = 0.5 * sizes.disk_m * 1.6
        points += [thruster.p_BT_m + wide, thruster.p_BT_m - wide, thruster.p_BT_m - sizes.jet_m * thruster.axis_B]
    if draft.X_BC is not None:
        points.append(draft.X_BC.p_m + sizes.cone_m * draft.X_BC.R[:, 2])
    low, high = np.min(points, axis=0), np.max(points, axis=0)
    # Symmetric sideways, so that the middle of the vehicle is the middle of the panel.
    reach = max(float(high[1]), float(-low[1]))
    low[1], high[1] = -reach, reach
    edge = 0.04 * float((high - low).max())
    return low - edge, high + edge


def _panel(draft: VehicleDraft, view: ProjectionPanel, sizes: Sizes, number: int) -> list[str]:
    left, top, width, height = view.box_px
    parts = [
        tag("rect", x=left, y=top, width=width, height=height, rx=10, fill="#ffffff", stroke=FRAME),
        text(left + 14, top + 21, view.title, weight=600, size=13),
        *_axes(view, left + width - 62, top + 16),
    ]
    half = hull_half_m(draft)
    x, y = view.origin_px
    across = float(np.abs(view.right_B) @ half) * view.px_per_m
    along = float(np.abs(view.down_B) @ half) * view.px_per_m
    look = {"stroke": "#9fb0bf", "stroke_width": "1.2", "stroke_dasharray": None if draft.size_m is not None else "5 4"}
    parts.append(
        tag("rect", x=x - across, y=y - along, width=2.0 * across, height=2.0 * along, rx=12, fill=HULL, **look)
    )
    parts += camera_marks(draft, view, sizes)
    # Furthest from the reader first, so that near thrusters lie on top.
    order = np.argsort([float(t.p_BT_m @ view.toward_B) for t in draft.thrusters], kind="stable")
    labels: dict[tuple[int, int], list[int]] = {}
    for index in map(int, order):
        parts += thruster_marks(draft, view, index, sizes, f"jet-{number}-{index}")
        labels.setdefault(label_place(draft, view, index, sizes), []).append(index + 1)
    parts += centre_marks(draft, view)
    for (px, py), numbers in labels.items():
        parts += badge(px, py, "·".join(str(n) for n in sorted(numbers)))
    return parts


def _axes(view: ProjectionPanel, x: float, y: float) -> list[str]:
    """Which body axes the panel shows, as a small corner; a negative axis points the other way."""
    across, down = int(np.argmax(np.abs(view.right_B))), int(np.argmax(np.abs(view.down_B)))
    sign = float(np.sign(view.right_B[across]))
    corner = x if sign > 0.0 else x + 24.0
    return [
        arrow(corner, y, corner + 24.0 * sign, y, MUTED, head=5.0),
        arrow(corner, y, corner, y + 24.0, MUTED, head=5.0),
        text(corner + 32.0 * sign, y + 4, "xyz"[across], colour=MUTED, size=11, anchor="middle"),
        text(corner - 10.0 * sign, y + 24, "xyz"[down], colour=MUTED, size=11, anchor="middle"),
    ]


def _legend(draft: VehicleDraft, sizes: Sizes, box: tuple[float, float, float, float], px_per_m: float) -> list[str]:
    left, top, _, height = box
    x = left + 20.0

    def ring(y: float) -> str:
        return circle(x, y, 7.0, fill="#ffffff", stroke=INK, stroke_width="1.5")

    def away(y: float) -> str:
        return tag("path", d=f"M{x - 3:.1f} {y - 3:.1f}l6 6m0 -6l-6 6", stroke=JET, stroke_width="2")

    rows: list[tuple[Callable[[float], str], str]] = [
        (lambda y: arrow(x - 12, y, x + 14, y, JET), "jet of positive thrust (the water's way)"),
        (lambda y: ring(y) + circle(x, y, 2.4, fill=JET), "jet toward you"),
        (lambda y: ring(y) + away(y), "jet away from you"),
    ]
    if draft.X_BC is not None:
        fov = "" if draft.camera_fov_rad is None else f", {math.degrees(draft.camera_fov_rad):.0f} degrees across"
        rows.append((lambda y: camera_mark(x, y), f"camera{fov}"))
    if draft.p_BG_m is not None:
        rows.append((lambda y: gravity_mark(x, y), "centre of gravity"))
    if draft.p_BB_m is not None:
        rows.append((lambda y: buoyancy_mark(x, y), "centre of buoyancy"))
    stated = {"size": draft.size_m is not None, "propellers": sizes.disk_stated}
    dashed = [word for word, known in stated.items() if not known]
    if dashed:
        line = {"stroke": INK, "stroke_width": "1.5", "stroke_dasharray": "4 3"}
        words = f"{' and '.join(dashed)} not stated, drawn to show"
        rows.append((lambda y: tag("path", d=f"M{x - 12:.1f} {y:.1f}h26", **line), words))
    step = min(25.0, (height - 80.0) / len(rows))
    parts = []
    for row, (mark, words) in enumerate(rows):
        y = top + 30.0 + row * step
        parts += [mark(y), text(x + 28, y + 4, words, colour=MUTED)]
    return [*parts, *_scale_bar(x - 12, top + height - 16.0, px_per_m)]


def _scale_bar(x: float, y: float, px_per_m: float) -> list[str]:
    """A bar of 1, 2 or 5 times a power of ten, 60 to 150 pixels long."""
    length_m = round_step(60.0 / px_per_m)
    length = length_m * px_per_m
    said = f"{1000.0 * length_m:.0f} mm" if length_m < 1.0 else f"{length_m:g} m"
    bar = f"M{x:.1f} {y - 4:.1f}v8m0 -4h{length:.1f}m0 -4v8"
    return [
        tag("path", d=bar, fill="none", stroke=INK, stroke_width="1.5"),
        text(x + length + 10, y + 4, said, colour=MUTED),
    ]
