"""Drawings and the one-file page of a vehicle, and of a thruster's curve."""

from wakewise.ui.reports.vehicle.drawing import drawing_svg
from wakewise.ui.reports.vehicle.page import vehicle_page

__all__ = [
    "drawing_svg",
    "vehicle_page",
]
