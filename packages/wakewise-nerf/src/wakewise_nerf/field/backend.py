"""Whether PyTorch is here, and on what it is to work."""

from __future__ import annotations

from typing import Any

from wakewise.core.errors import InputError
from wakewise.core.optional_dependencies import need

DEVICES = ("auto", "cpu", "cuda")


def require_torch() -> None:
    """Say in one line what to install where PyTorch is missing.

    Raises
    ------
    MissingExtra
        If there is no PyTorch.
    """
    need("a neural field", "nerf")


def pick_device(name: str) -> Any:
    """The device by name, a `torch.device`; auto takes CUDA where there is one.

    Raises
    ------
    MissingExtra
        If there is no PyTorch.
    InputError
        If there is no such device, or CUDA was asked for and cannot be had.
    """
    require_torch()
    import torch

    if name not in DEVICES:
        raise InputError(f"--device {name}: there is no such device; allowed are {', '.join(DEVICES)}")
    there = torch.cuda.is_available()
    if name == "cuda" and not there:
        build = "this PyTorch is built without it" if torch.version.cuda is None else "no CUDA device is found"
        raise InputError(f"--device cuda: {build}; allowed here are auto and cpu")
    return torch.device("cuda" if there and name != "cpu" else "cpu")
