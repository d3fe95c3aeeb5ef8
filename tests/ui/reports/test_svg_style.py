"""Colours of reports are told apart without colour: in greyscale print, and by people who see no red and green."""

from itertools import combinations

import numpy as np

from wakewise.ui.reports.model import IN_PART, WELL_SEEN
from wakewise.ui.reports.svg_style import ERROR_STOPS, NOT_COUNTED, NOT_COVERED, OVER_LIMIT, rgb


def lightness(colour: str) -> float:
    """CIE 1976 L* of "#rrggbb" in sRGB, 0 to 100."""
    value = rgb(colour)
    linear = np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)
    luminance = float(linear @ (0.2126, 0.7152, 0.0722))
    return 116.0 * np.cbrt(luminance) - 16.0 if luminance > 0.008856 else 903.3 * luminance


def test_the_legend_of_coverage_is_legible_in_greyscale() -> None:
    """Seen well, by too few, not, and not counted differ by 10 of lightness at least; 2.3 are just noticeable."""
    shades = [lightness(colour) for colour in (WELL_SEEN, IN_PART, NOT_COVERED, NOT_COUNTED)]
    assert min(abs(a - b) for a, b in combinations(shades, 2)) > 10.0


def test_the_scale_of_errors_darkens_from_none_to_beyond_the_limit() -> None:
    """Lightness falls by 5 at least from stop to stop, so its order is seen in greyscale."""
    shades = [lightness(colour) for colour in (*ERROR_STOPS, OVER_LIMIT)]
    assert max(np.diff(shades)) < -5.0
