"""Metric scale by bars between coded targets, or by position fixes of the cameras.

- `stage.py`: a sparse model to the same model in metres. `bars.py`: bars, their weighted mean and residuals.
- `marks.py`: coded targets in photographs, triangulated. `position_fixes.py`: GPS and depth of cameras, and their fit.
"""

from typing import TYPE_CHECKING

from wakewise.core.lazy_imports import lazy_attributes

if TYPE_CHECKING:
    from wakewise.vision.reconstruction.scale.bars import ScaleBar, ScaleBars, parse_bar, read_bars
    from wakewise.vision.reconstruction.scale.position_fixes import PositionFixes, exif_fixes, read_fixes

__all__ = ["PositionFixes", "ScaleBar", "ScaleBars", "exif_fixes", "parse_bar", "read_bars", "read_fixes"]

lazy_attributes(__name__, "photos")
