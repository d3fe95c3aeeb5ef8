"""Metres by bars of known length between coded targets that the photographs show, or by where these were taken.

Start reading in `stage.py` (a sparse model in, the same model in metres out). `bars.py` is what a user says, `marks.py`
finds targets in photographs, `marks.py` puts them into the model, `bars.py` weighs the bars and says where they
disagree. `position_fixes.py` reads what GPS receivers and depth gauges tell of the cameras, `position_fixes.py`
asks what it is worth.
"""

from typing import TYPE_CHECKING

from wakewise.core.lazy_imports import lazy_attributes

if TYPE_CHECKING:
    from wakewise.vision.reconstruction.scale.bars import ScaleBar, ScaleBars, parse_bar, read_bars
    from wakewise.vision.reconstruction.scale.position_fixes import PositionFixes, exif_fixes, read_fixes

__all__ = ["PositionFixes", "ScaleBar", "ScaleBars", "exif_fixes", "parse_bar", "read_bars", "read_fixes"]

lazy_attributes(__name__, "photos")
