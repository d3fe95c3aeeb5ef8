"""A film of a trial: what the camera saw, and from outside the vehicle, its wash, the silt and the target.

Start reading in `make.py` (a film from a trial's folder) and `rows.py` (trials side by side at a few instants).
`external_view.py` draws from a place of its own (`external_view.py`), `wash.py` drives the tank's own water again with
the recorded motion and follows tracers in it, `layout.py` and `layout.py` put a frame together, `encode.py` writes it
without a system codec.
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
