"""Metres by bars of known length between coded targets that the photographs show.

Start reading in `stage.py` (a sparse model in, the same model in metres out). `bars.py` is what a user says, `marks.py`
finds targets in photographs, `places.py` puts them into the model, `fitting.py` weighs the bars and says where they
disagree.
"""

from typing import TYPE_CHECKING

from wakewise.doors import lazy_door

if TYPE_CHECKING:
    from wakewise.reconstruction.scale.bars import Bar, Bars, parse_bar, read_bars

__all__ = ["Bar", "Bars", "parse_bar", "read_bars"]

lazy_door(__name__, "photos")
