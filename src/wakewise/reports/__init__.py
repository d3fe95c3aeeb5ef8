"""Reports: one HTML page per trial or comparison, with plots, photographs and a 3D scene; it opens with no network."""

from typing import TYPE_CHECKING

from wakewise.doors import lazy_door

if TYPE_CHECKING:
    from wakewise.reports.compare import write_comparison
    from wakewise.reports.report import write_report

__all__ = ["write_comparison", "write_report"]

lazy_door(__name__, "reports", "photos")
