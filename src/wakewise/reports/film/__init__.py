"""A film of a trial: what the camera saw, and from outside the vehicle, its wash, the silt and the target."""

from typing import TYPE_CHECKING

from wakewise.doors import lazy_door

if TYPE_CHECKING:
    from wakewise.reports.film.encode import SUFFIXES
    from wakewise.reports.film.layout import VIEWS, View
    from wakewise.reports.film.make import write_film
    from wakewise.reports.film.rows import compared_trials, write_rows

__all__ = ["SUFFIXES", "VIEWS", "View", "compared_trials", "write_film", "write_rows"]

lazy_door(__name__, "reports", "photos")
