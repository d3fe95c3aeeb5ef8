"""Whether PyTorch is here, and on what it is to work."""

from __future__ import annotations

import importlib.util
from typing import Any

from wakewise.errors import InputError, how_to_install

DEVICES = ("auto", "cpu", "cuda")


def require_torch() -> None:
    """Say in one line what to install where PyTorch is missing.

    Raises
    ------
    InputError
        If there is no PyTorch.
    """
    if importlib.util.find_spec("torch") is None:
        raise InputError(f"neural field: PyTorch is not installed; {how_to_install('nerf')}")


def pick_device(name: str) -> Any:
    """The device by name, a `torch.device`; auto takes CUDA where there is one.

    Raises
    ------
    InputError
        If there is no PyTorch, no such device, or CUDA was asked for and cannot be had.
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
