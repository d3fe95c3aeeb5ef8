"""A neural radiance field on a hash grid, learnt from posed photos; PyTorch (extra `nerf`) is imported when it runs."""

from typing import TYPE_CHECKING

from wakewise.core.lazy_imports import lazy_attributes

if TYPE_CHECKING:
    from wakewise_nerf.field.pipeline import build_field
    from wakewise_nerf.field.settings import DEVICES, PROFILES, FieldSettings, pick_device, profile, require_torch

__all__ = [
    "DEVICES",
    "PROFILES",
    "FieldSettings",
    "build_field",
    "pick_device",
    "profile",
    "require_torch",
]

lazy_attributes(__name__, "nerf", "photos")
