"""Settings of a neural field, and the two profiles: one for a GPU as in the paper, one demonstration for a CPU.

Whether PyTorch is here, and on what it is to work.
"""

from __future__ import annotations

from typing import Any

from pydantic import Field

from wakewise.core.errors import InputError
from wakewise.core.optional_dependencies import need
from wakewise.core.settings import Seed, Settings


class FieldSettings(Settings):
    """How a hash-grid radiance field is built and trained.

    The defaults are those of T. Mueller, A. Evans, C. Schied and A. Keller, Instant neural graphics primitives with a
    multiresolution hash encoding, ACM TOG 41(4), 2022, doi 10.1145/3528223.3530127: table 1 and section 5.4.
    """

    levels: int = Field(default=16, ge=1, le=32, description="resolutions of the hash grid, L")
    table_log2: int = Field(default=19, ge=8, le=24, description="log2 of the most entries per level, T")
    features: int = Field(default=2, ge=1, le=8, description="features per entry, F")
    coarsest: int = Field(default=16, ge=2, le=512, description="cells along the contracted cube at the coarsest level")
    finest: int = Field(
        default=2048, ge=16, le=65536, description="cells along the contracted cube at the finest level"
    )
    steps: int = Field(default=10_000, ge=1, le=1_000_000, description="optimisation steps")
    rays: int = Field(default=4096, ge=16, le=65536, description="most rays per step")
    samples_per_step: int = Field(
        default=2**18,
        ge=256,
        le=2**22,
        description="points per step that rays are chosen to make up, where space fills",
    )
    samples: int = Field(
        default=512, ge=16, le=4096, description="intervals per ray across the region; before and behind: 3/8 as many"
    )
    occupancy: int = Field(default=128, ge=16, le=256, description="cells along the occupancy grid")
    occupancy_every: int = Field(default=16, ge=1, le=1000, description="steps between updates of the occupancy grid")
    warmup_steps: int = Field(default=256, ge=0, description="first steps, in which all space counts as occupied")
    grid_rate: float = Field(default=1e-2, gt=0.0, le=1.0, description="Adam's first rate for the hash grid")
    network_rate: float = Field(default=1e-2, gt=0.0, le=1.0, description="Adam's first rate for the networks")
    last_rate: float = Field(
        default=0.03, gt=0.0, le=1.0, description="the last step's rate as a share of the first; it falls in between"
    )
    photo_px: int = Field(
        default=1920, ge=64, le=8192, description="longer photos are averaged down to this many pixels"
    )
    held_out_every: int = Field(default=8, ge=2, le=1000, description="every so many photos one is kept for judging")
    depth_px: float = Field(
        default=1.0, ge=0.25, le=8.0, description="pixel size of the depth maps that become points, in photo pixels"
    )
    agreeing_views: int = Field(default=2, ge=1, le=10, description="other depth maps that must agree with a point")
    checkpoint_every: int = Field(default=500, ge=1, description="steps between checkpoints")
    threads: int = Field(default=2, ge=1, le=64, description="threads on a CPU; their number changes the last digits")
    random_seed: Seed = Field(default=0, description="seed of every random choice")


PROFILES = {
    "gpu": FieldSettings(),
    # A demonstration: a fortieth of the memory and hundredths of the work. It shows the way, not what the field can.
    "cpu": FieldSettings(
        levels=8,
        table_log2=16,
        finest=512,
        steps=1000,
        rays=1024,
        samples_per_step=2**14,
        samples=192,
        occupancy=64,
        warmup_steps=96,
        photo_px=960,
        depth_px=2.0,
        checkpoint_every=100,
    ),
}


def profile(name: str) -> FieldSettings:
    """Settings of a profile by name.

    Raises InputError if there is no such profile.
    """
    if name not in PROFILES:
        raise InputError(f"--profile {name}: there is no such profile; allowed are {', '.join(sorted(PROFILES))}")
    return PROFILES[name]


DEVICES = ("auto", "cpu", "cuda")


def require_torch() -> None:
    """Say in one line what to install where PyTorch is missing.

    Raises MissingExtra if there is no PyTorch.
    """
    need("a neural field", "nerf")


def pick_device(name: str) -> Any:
    """The device by name, a `torch.device`; auto takes CUDA where there is one.

    Raises MissingExtra if there is no PyTorch; InputError if there is no such device, or CUDA was asked for and cannot
    be had.
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
