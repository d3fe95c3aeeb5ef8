"""A film of a trial: what the camera saw, and from outside the vehicle, its wash, the silt and the target.

Start reading in `make.py` (a film from a trial's folder) and `rows.py` (trials side by side at a few instants).
`external_view.py` renders the external view. `wash.py` simulates the tank's water again with the recorded motion, and
tracers in it. `layout.py` composes a frame, `encode.py` writes it without a system codec.
"""

from typing import TYPE_CHECKING

from wakewise.core.lazy_imports import lazy_attributes

if TYPE_CHECKING:
    from wakewise.ui.film.encode import SUFFIXES
    from wakewise.ui.film.layout import VIEWS, View
    from wakewise.ui.film.make import write_film
    from wakewise.ui.film.rows import compared_trials, write_rows

__all__ = ["SUFFIXES", "VIEWS", "View", "compared_trials", "write_film", "write_rows"]

lazy_attributes(__name__, "reports", "photos")
