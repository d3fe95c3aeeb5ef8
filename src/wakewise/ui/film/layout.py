"""A frame of the film: pictures, current figures, and a time line of the flight, in the report's dark colours."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Literal

import cv2
import matplotlib
import numpy as np
from numpy.typing import NDArray
from PIL import Image as Pictures
from PIL import ImageDraw, ImageFont

from wakewise.core.arrays import Array
from wakewise.ui.film.external_view import FASTEST_M_S, speed_colours
from wakewise.ui.reports.text import number

PAPER, CARD, LINE = (11, 19, 23), (19, 31, 37), (42, 59, 67)
INK, MUTED, TEAL, CORAL, SAND, GOOD = (
    (230, 238, 240),
    (150, 171, 179),
    (94, 195, 212),
    (240, 133, 92),
    (220, 178, 87),
    (92, 199, 154),
)

Rgb = tuple[int, int, int]
Box = tuple[int, int, int, int]


@cache
def font(size: int, bold: bool = False) -> ImageFont.FreeTypeFont:
    """DejaVu Sans, which matplotlib contains, so that pictures are the same on every computer."""
    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    return ImageFont.truetype(str(Path(matplotlib.get_data_path()) / "fonts" / "ttf" / name), size)


def write(
    draw: ImageDraw.ImageDraw,
    place: tuple[float, float],
    text: str,
    size: int = 14,
    colour: Rgb = INK,
    *,
    bold: bool = False,
    anchor: str = "ls",
) -> float:
    """Write a line of text and give its width in pixels; `anchor` as Pillow has it, "ls" being left on the baseline."""
    face = font(size, bold)
    draw.text(place, text, font=face, fill=colour, anchor=anchor)
    return float(draw.textlength(text, font=face))


def ellipsized(text: str, width: float, size: int, bold: bool = False) -> str:
    """The text, its end replaced by an ellipsis if it is wider than `width` pixels."""
    face = font(size, bold)
    if face.getlength(text) <= width:
        return text
    while text and face.getlength(text + "…") > width:
        text = text[:-1]
    return text.rstrip() + "…"


def paste(page: Pictures.Image, picture: NDArray[np.uint8], box: Box, radius: int = 8) -> None:
    """Put an RGB picture into a box (left, top, right, bottom) with round corners; it must have the box's size."""
    size = (box[2] - box[0], box[3] - box[1])
    page.paste(Pictures.fromarray(np.ascontiguousarray(picture)), box[:2], _corners(size, radius))


@cache
def _corners(size: tuple[int, int], radius: int) -> Pictures.Image:
    # Drawn four times as large, since Pillow's shapes have hard edges.
    large = Pictures.new("L", (4 * size[0], 4 * size[1]), 0)
    ImageDraw.Draw(large).rounded_rectangle((0, 0, 4 * size[0] - 1, 4 * size[1] - 1), 4 * radius, fill=255)
    return large.resize(size, Pictures.Resampling.LANCZOS)


def curve(page: Pictures.Image, box: Box, x: NDArray[np.float64], y: NDArray[np.float64], colour: Rgb) -> None:
    """Draw a smooth line over a faint area in a box; x and y run from 0 to 1, y upward."""
    width, height = box[2] - box[0], box[3] - box[1]
    layer = Pictures.new("RGBA", (3 * width, 3 * height), (*colour, 0))
    draw = ImageDraw.Draw(layer)
    points = [(3 * width * float(a), 3 * (height - 2) * (1.0 - float(b)) + 3) for a, b in zip(x, y, strict=True)]
    if len(points) > 1:
        draw.polygon([(points[0][0], 3 * height), *points, (points[-1][0], 3 * height)], fill=(*colour, 46))
        draw.line(points, fill=(*colour, 255), width=5, joint="curve")
    small = layer.resize((width, height), Pictures.Resampling.LANCZOS)
    page.paste(small, box[:2], small)


View = Literal["both", "outside", "camera"]
VIEWS: tuple[View, ...] = ("both", "outside", "camera")
WIDTH, HEIGHT = 1280, 720
_MAIN: dict[View, Box] = {"both": (20, 58, 872, 584), "outside": (20, 58, 1260, 584), "camera": (95, 58, 797, 584)}
_PHOTO: Box = (890, 58, 1260, 336)
_TIME: Box = (64, 626, 1260, 684)


@dataclass(frozen=True, kw_only=True, eq=False)
class FilmOverview:
    """What stays on every frame: names, and the whole flight's legs, speeds and photographs.

    `legs` are (name, start_s, end_s); `speed_m_s` (k,) at `time_s` (k,) is the mean excess speed at the target, NaN or
    empty where unknown; `shots` are (time_s, sharpness or None).
    """

    title: str
    subtitle: str
    duration_s: float
    pace: float
    legs: tuple[tuple[str, float, float], ...]
    time_s: Array
    speed_m_s: Array
    shots: tuple[tuple[float, float | None], ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class FilmFrame:
    """What one frame shows. Pictures are RGB; `shot` counts from 0 and is None before the first photograph."""

    time_s: float
    leg: str
    speed_m_s: float | None
    turbidity_per_m: float | None
    thrusts_N: Array
    outside: NDArray[np.uint8] | None
    photo: NDArray[np.uint8] | None
    shot: int | None
    since_shot_s: float


class FrameComposer:
    """Draws frames; what no frame changes is drawn once."""

    def __init__(self, story: FilmOverview, view: View) -> None:
        self.story, self.view = story, view
        self._top_mm_s = _nice(1e3 * float(np.nanmax(story.speed_m_s))) if np.isfinite(story.speed_m_s).any() else 0.0
        self._thrust_top_N = 1.0
        self._base = self._still()

    @property
    def main_size(self) -> tuple[int, int]:
        """Width and height of the large picture."""
        left, top, right, bottom = _MAIN[self.view]
        return right - left, bottom - top

    def scaled_to(self, largest_thrust_N: float) -> FrameComposer:
        """Set the thrust bars' full height."""
        self._thrust_top_N = max(1.0, float(np.ceil(largest_thrust_N)))
        return self

    def frame(self, moment: FilmFrame) -> NDArray[np.uint8]:
        """One frame, shape (720, 1280, 3), RGB."""
        page = self._base.copy()
        draw = ImageDraw.Draw(page)
        main = _MAIN[self.view]
        if self.view == "camera":
            self._show_photo(page, draw, moment, main)
        else:
            if moment.outside is not None:
                paste(page, moment.outside, main)
            self._speed_key(page, draw, main)
            if self.view == "both":
                self._show_photo(page, draw, moment, _PHOTO)
        if self.view == "outside":
            self._figures_over(page, moment, main)
        else:
            self._figures(draw, moment, 366 if self.view == "both" else 84)
        self._clock(draw, moment)
        self._playhead(draw, moment)
        return np.asarray(page)

    def _still(self) -> Pictures.Image:
        page = Pictures.new("RGB", (WIDTH, HEIGHT), PAPER)
        draw = ImageDraw.Draw(page)
        story = self.story
        used = write(draw, (20, 37), ellipsized(story.title, 640, 21, True), 21, bold=True)
        write(draw, (20 + used + 16, 37), ellipsized(story.subtitle, 950 - used - 60, 14), 14, MUTED)
        left, top, right, bottom = _TIME
        draw.rectangle((left, top, right, bottom), fill=CARD)
        for k, (name, start_s, end_s) in enumerate(story.legs):
            a, b = self._x(start_s), self._x(end_s)
            if k % 2:
                draw.rectangle((a, top, b, bottom), fill=(24, 39, 46))
            if ellipsized(name, b - a - 8, 12) == name:
                write(draw, (a + 5, top - 8), name, 12, MUTED)
            draw.line((a, top - 20, a, top), fill=LINE)
        if self._top_mm_s > 0.0:
            known = np.isfinite(story.speed_m_s)
            x, y = story.time_s[known] / story.duration_s, 1e3 * story.speed_m_s[known] / self._top_mm_s
            curve(page, _TIME, *_peaks(x, np.clip(y, 0.0, 1.0), 500), TEAL)
            write(draw, (left - 8, top + 11), number(self._top_mm_s), 11, MUTED, anchor="rs")
            write(draw, (left - 8, bottom), "0", 11, MUTED, anchor="rs")
            write(draw, (left - 8, top + 35), "mm/s", 11, MUTED, anchor="rs")
        for time_s, _ in story.shots:
            x0 = self._x(time_s)
            draw.line((x0, bottom - 5, x0, bottom), fill=CORAL)
        write(
            draw,
            (left, HEIGHT - 15),
            "Speed of the water at the target, over the same water without thrusters.",
            12,
            MUTED,
        )
        words = "photograph"
        write(draw, (right, HEIGHT - 15), words, 12, MUTED, anchor="rs")
        draw.line((right - 82, HEIGHT - 24, right - 82, HEIGHT - 14), fill=CORAL, width=2)
        return page

    def _x(self, time_s: float) -> float:
        left, _, right, _ = _TIME
        return left + (right - left) * min(max(time_s / self.story.duration_s, 0.0), 1.0)

    def _show_photo(self, page: Pictures.Image, draw: ImageDraw.ImageDraw, moment: FilmFrame, box: Box) -> None:
        width, height = box[2] - box[0], box[3] - box[1]
        if moment.photo is None:
            draw.rounded_rectangle(box, 8, fill=CARD)
            write(draw, (box[0] + width / 2, box[1] + height / 2), "no photograph yet", 14, MUTED, anchor="mm")
            return
        paste(page, fill_frame(moment.photo, width, height), box)
        fresh = max(0.0, 1.0 - moment.since_shot_s / (0.25 * self.story.pace))
        if fresh > 0.0:
            colour = tuple(round(p + fresh * (c - p)) for p, c in zip(PAPER, CORAL, strict=True))
            draw.rounded_rectangle((box[0] - 4, box[1] - 4, box[2] + 3, box[3] + 3), 11, outline=colour, width=4)

    def _figures(self, draw: ImageDraw.ImageDraw, moment: FilmFrame, y: int) -> None:
        left, right = _PHOTO[0], _PHOTO[2]
        shots = self.story.shots
        if moment.shot is not None:
            sharpness = shots[moment.shot][1]
            write(draw, (left, y), f"photograph {moment.shot + 1} of {len(shots)}", 14)
            if sharpness is not None:
                write(draw, (right, y), f"sharpness {number(sharpness)}", 14, MUTED, anchor="rs")
        else:
            write(draw, (left, y), f"{len(shots)} photographs to come", 14, MUTED)
        self._sharpness_strip(draw, moment, (left, y + 14, right, y + 50))
        y += 92
        write(draw, (left, y - 10), "water at the target", 13, MUTED)
        value = "–" if moment.speed_m_s is None else f"{1e3 * moment.speed_m_s:.1f}"
        used = write(draw, (left, y + 28), value, 34, bold=True)
        write(draw, (left + used + 8, y + 28), "mm/s", 15, MUTED)
        write(draw, (left + 196, y - 10), "silt in the view", 13, MUTED)
        value = "–" if moment.turbidity_per_m is None else f"{moment.turbidity_per_m:.3f}"
        used = write(draw, (left + 196, y + 28), value, 34, bold=True)
        write(draw, (left + 204 + used, y + 28), "/m", 15, MUTED)
        self._thrusts(draw, moment, (left, y + 56, right, 584))

    def _sharpness_strip(self, draw: ImageDraw.ImageDraw, moment: FilmFrame, box: Box) -> None:
        """One bar per photograph, as high as it is sharp; those to come are hollow."""
        shots = self.story.shots
        known = [sharp for _, sharp in shots if sharp is not None]
        if not known:
            return
        top = max(known)
        step = (box[2] - box[0]) / len(shots)
        for k, (_, sharp) in enumerate(shots):
            done = moment.shot is not None and k <= moment.shot
            colour = CORAL if k == moment.shot else SAND if done else LINE
            height = 0.0 if sharp is None else (box[3] - box[1]) * sharp / top
            x = box[0] + k * step
            draw.rectangle((x, box[3] - max(height, 1.0), x + max(step - 2.0, 1.0), box[3]), fill=colour)

    def _thrusts(self, draw: ImageDraw.ImageDraw, moment: FilmFrame, box: Box) -> None:
        n = len(moment.thrusts_N)
        if not n:
            return
        write(draw, (box[0], box[1] + 4), "thrust", 13, MUTED)
        write(draw, (box[2], box[1] + 4), f"± {self._thrust_top_N:g} N", 12, MUTED, anchor="rs")
        top, bottom = box[1] + 14, box[3]
        middle, half = 0.5 * (top + bottom), 0.5 * (bottom - top)
        step = (box[2] - box[0]) / n
        for k, thrust in enumerate(moment.thrusts_N):
            x = box[0] + k * step
            draw.rectangle((x, top, x + step - 6, bottom), fill=CARD)
            length = half * float(np.clip(thrust / self._thrust_top_N, -1.0, 1.0))
            low, high = sorted((middle, middle - length))
            draw.rectangle((x, low, x + step - 6, max(high, low + 1)), fill=CORAL if thrust > 0 else TEAL)
        draw.line((box[0], middle, box[2] - 6, middle), fill=MUTED)

    def _figures_over(self, page: Pictures.Image, moment: FilmFrame, main: Box) -> None:
        """The figures of the moment on a dark corner of the large picture."""
        box = (main[2] - 226, main[1] + 14, main[2] - 14, main[1] + 92)
        _shade(page, box)
        draw = ImageDraw.Draw(page)
        write(draw, (box[0] + 14, box[1] + 24), "water at the target", 13, MUTED)
        value = "–" if moment.speed_m_s is None else f"{1e3 * moment.speed_m_s:.1f}"
        used = write(draw, (box[0] + 14, box[1] + 62), value, 32, bold=True)
        write(draw, (box[0] + 22 + used, box[1] + 62), "mm/s", 15, MUTED)

    def _speed_key(self, page: Pictures.Image, draw: ImageDraw.ImageDraw, main: Box) -> None:
        left, bottom = main[0] + 14, main[3] - 14
        box = (left, bottom - 46, left + 226, bottom)
        _shade(page, box)
        bar = speed_colours(np.linspace(0.0, FASTEST_M_S, 198))
        strip = np.repeat(np.round(255 * bar).astype(np.uint8)[None], 8, axis=0)
        page.paste(Pictures.fromarray(strip), (left + 14, bottom - 22))
        write(draw, (left + 14, bottom - 28), "wash", 12, INK)
        write(draw, (left + 212, bottom - 28), f"0 to {100 * FASTEST_M_S:.0f} cm/s", 12, MUTED, anchor="rs")

    def _clock(self, draw: ImageDraw.ImageDraw, moment: FilmFrame) -> None:
        write(draw, (1260, 37), f"× {self.story.pace:.1f}", 14, MUTED, anchor="rs")
        write(draw, (1200, 37), f"{moment.time_s:.1f} s", 21, bold=True, anchor="rs")
        write(draw, (1090, 37), moment.leg, 14, MUTED, anchor="rs")

    def _playhead(self, draw: ImageDraw.ImageDraw, moment: FilmFrame) -> None:
        x = self._x(moment.time_s)
        _, top, _, bottom = _TIME
        draw.line((x, top, x, bottom + 4), fill=INK, width=2)
        if moment.speed_m_s is not None and self._top_mm_s > 0.0:
            y = bottom - (bottom - top - 2) * min(1e3 * moment.speed_m_s / self._top_mm_s, 1.0)
            draw.ellipse((x - 5, y - 5, x + 5, y + 5), fill=PAPER, outline=INK, width=2)


def fill_frame(picture: NDArray[np.uint8], width: int, height: int) -> NDArray[np.uint8]:
    """The picture scaled and cut so that it fills a frame."""
    h, w = picture.shape[:2]
    scale = max(width / w, height / h)
    size = (max(width, round(w * scale)), max(height, round(h * scale)))
    way = cv2.INTER_AREA if scale < 1.0 else cv2.INTER_CUBIC
    large = cv2.resize(picture, size, interpolation=way)
    x, y = (size[0] - width) // 2, (size[1] - height) // 2
    return np.ascontiguousarray(large[y : y + height, x : x + width])


def _shade(page: Pictures.Image, box: Box) -> None:
    part = page.crop(box)
    page.paste(Pictures.blend(part, Pictures.new("RGB", part.size, PAPER), 0.62), box[:2])


def _nice(value: float) -> float:
    """The next of 1, 2, 5 times a power of ten."""
    if not value > 0.0:
        return 0.0
    power = 10.0 ** np.floor(np.log10(value))
    return float(
        next(step * power for step in (1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0) if step * power >= value * 0.999)
    )


def _peaks(x: Array, y: Array, buckets: int) -> tuple[Array, Array]:
    """A line of at most `buckets` points that keeps the highest of each."""
    if len(x) <= buckets:
        return x, y
    parts = np.array_split(np.arange(len(x)), buckets)
    return np.array([x[p].mean() for p in parts]), np.array([y[p].max() for p in parts])
