"""A drawing of a thrust curve: thrust over pulse, and power over thrust, at every voltage of the table."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from wakewise.core.arrays import Array
from wakewise.robot.thrusters.thrust_curve import ThrustCurve
from wakewise.ui.reports.vehicle.drawing import FRAME, round_step
from wakewise.ui.reports.vehicle.svg import MUTED, svg_page, tag, text

CHOSEN, BAND, OTHER = "#0f7bbd", "#eef3f7", "#a9b8c6"
WIDTH, HEIGHT = 980.0, 500.0
TOP, BOTTOM = 112.0, 416.0
SAMPLES = 161


@dataclass(frozen=True, kw_only=True)
class Panel:
    """One pair of axes and where it lies on the page."""

    left: float
    right: float
    x_range: tuple[float, float]
    y_range: tuple[float, float]

    def x(self, value: float) -> float:
        """Page coordinate of a value along the horizontal axis."""
        low, high = self.x_range
        return self.left + (value - low) / (high - low) * (self.right - self.left)

    def y(self, value: float) -> float:
        """Page coordinate of a value along the vertical axis."""
        low, high = self.y_range
        return BOTTOM - (value - low) / (high - low) * (BOTTOM - TOP)

    def line(self, xs: Array, ys: Array, colour: str, width: float) -> str:
        """A curve through points of the panel."""
        points = " ".join(f"{self.x(float(a)):.1f},{self.y(float(b)):.1f}" for a, b in zip(xs, ys, strict=True))
        ends = {"stroke_linejoin": "round", "stroke_linecap": "round"}
        return tag("polyline", points=points, fill="none", stroke=colour, stroke_width=f"{width:g}", **ends)


def curve_svg(curve: ThrustCurve, supply_V: float) -> str:
    """Draw a thrust curve as one self-contained SVG; the chosen voltage is blue, those of the table are grey.

    Raises InputError if the voltage lies outside the table.
    """
    at = curve.voltage(supply_V)
    low, high = curve.limits_N(at)
    silent = curve.deadband_us(at)
    has_power = curve.forward.power_W is not None and curve.reverse.power_W is not None
    title = f"Thrust curve {curve.name} at {at:g} V"
    parts = [
        text(24, 32, title, size=18, weight=600),
        text(
            24,
            52,
            f"{low:.1f} to {high:+.1f} N; no thrust from {silent[0]:g} to {silent[1]:g} us; "
            f"neutral pulse {curve.neutral_us:g} us",
            colour=MUTED,
        ),
        *_thrust_panel(curve, at),
        *(_power_panel(curve, at) if has_power else [text(540, TOP + 14, "The table has no power.", colour=MUTED)]),
        text(24, HEIGHT - 16, _short(curve.source, 165), colour=MUTED, size=11),
    ]
    return svg_page(WIDTH, HEIGHT, title, parts)


def _thrust_panel(curve: ThrustCurve, at: float) -> list[str]:
    pulses = curve.pulse_limits_us(at)
    top = float(curve.forward.thrust_N.max())
    bottom = -float(curve.reverse.thrust_N.max())
    panel = Panel(left=74.0, right=476.0, x_range=pulses, y_range=_widened(bottom, top))
    silent = curve.deadband_us(at)
    left = panel.x(silent[0])
    parts = [
        text(panel.left, TOP - 18, "Thrust (N) over pulse (us)", weight=600),
        tag("rect", x=left, y=TOP, width=panel.x(silent[1]) - left, height=BOTTOM - TOP, fill=BAND),
        *_axes(panel),
    ]
    labels = []
    for voltage, colour, width in _voltages(curve, at):
        low, high = curve.deadband_us(voltage)
        ends = curve.pulse_limits_us(voltage)
        # Both sides of each edge are drawn, so that the jump to the slowest running speed shows.
        grid = np.unique([*np.linspace(*ends, SAMPLES), low, low - 0.01, high, high + 0.01])
        thrust = curve.thrust_N(grid, voltage)
        parts.append(panel.line(grid, thrust, colour, width))
        labels.append((panel.right + 5, panel.y(float(thrust[-1])) + 4, f"{voltage:g} V", colour, width))
    return parts + _labels(labels)


def _power_panel(curve: ThrustCurve, at: float) -> list[str]:
    low, high = -float(curve.reverse.thrust_N.max()), float(curve.forward.thrust_N.max())
    most = max(float(np.max(side.power_W)) for side in (curve.forward, curve.reverse) if side.power_W is not None)
    panel = Panel(left=560.0, right=930.0, x_range=(low, high), y_range=_widened(0.0, most))
    parts = [text(panel.left, TOP - 18, "Electrical power (W) over thrust (N)", weight=600), *_axes(panel)]
    for voltage, colour, width in _voltages(curve, at):
        ends = curve.limits_N(voltage)
        grid = np.linspace(*ends, SAMPLES)
        power = curve.power_W(grid, voltage)
        parts.append(panel.line(grid, power, colour, width))
        if voltage == at:
            x, y = panel.x(ends[1]), panel.y(float(power[-1]))
            parts.append(tag("circle", cx=x, cy=y, r=4, fill=colour))
            parts.append(text(x - 9, y - 7, f"{power[-1]:.0f} W", colour=colour, weight=600, anchor="end"))
    return parts


def _voltages(curve: ThrustCurve, at: float) -> list[tuple[float, str, float]]:
    """Every voltage to draw with its colour and stroke, the chosen one last, on top."""
    return [(float(v), OTHER, 1.3) for v in curve.supply_V if float(v) != at] + [(at, CHOSEN, 2.4)]


def _labels(labels: list[tuple[float, float, str, str, float]]) -> list[str]:
    """Names at the ends of curves, pushed apart where they would touch."""
    parts, above = [], -math.inf
    for x, y, words, colour, width in sorted(labels, key=lambda label: label[1]):
        place = max(y, above + 13.0)
        bold = 600 if colour == CHOSEN else 400
        parts.append(text(x, place, words, colour=colour if width > 2.0 else MUTED, size=11, weight=bold))
        above = place
    return parts


def _axes(panel: Panel) -> list[str]:
    parts = []
    for value in _ticks(*panel.x_range, 7):
        x = panel.x(value)
        parts.append(tag("path", d=f"M{x:.1f} {TOP:.1f}V{BOTTOM:.1f}", stroke=FRAME, stroke_width="0.7"))
        parts.append(text(x, BOTTOM + 17, f"{value:g}", colour=MUTED, size=11, anchor="middle"))
    for value in _ticks(*panel.y_range, 7):
        y = panel.y(value)
        stroke = MUTED if value == 0.0 else FRAME
        line = f"M{panel.left:.1f} {y:.1f}H{panel.right:.1f}"
        parts.append(tag("path", d=line, stroke=stroke, stroke_width="0.7"))
        parts.append(text(panel.left - 8, y + 4, f"{value:g}", colour=MUTED, size=11, anchor="end"))
    return parts


def _widened(low: float, high: float) -> tuple[float, float]:
    """A range with a little room above, and below unless it starts at zero."""
    room = 0.05 * (high - low)
    return (low - room if low < 0.0 else low), high + room


def _ticks(low: float, high: float, desired: int) -> list[float]:
    """Round numbers, multiples of 1, 2 or 5 times a power of ten, in a range."""
    step = round_step((high - low) / desired)
    return [round(k * step, 10) for k in range(math.ceil(low / step), math.floor(high / step) + 1)]


def _short(words: str, most: int) -> str:
    return words if len(words) <= most else words[: most - 3].rsplit(" ", 1)[0] + " ..."
