"""What a scenario may say of the target."""

from __future__ import annotations

import dataclasses
from typing import Literal, Self

from pydantic import Field, model_validator

from wakewise.core.settings import Seed, Settings
from wakewise.scene.targets import TISSUES, TissueProperties, coral_kinds, is_mesh_file


class UnanchoredSettings(Settings):
    """Whether the target lies on the bed without being held, and how."""

    weight_N: float | None = Field(
        None, gt=0.0, le=1e4, description="its weight in water, N, if it lies loose and slides when pushed; null: held"
    )
    friction: float = Field(
        0.65,
        gt=0.0,
        le=5.0,
        description="coefficient between it and the bed; 0.65 is the tangent of gravel's 33 deg (Stark et al. 2014, "
        "doi 10.5194/esurf-2-469-2014)",
    )


class TargetSettings(Settings):
    """What is looked at: a procedural coral by name, or a mesh file."""

    kind: str = Field("branching", description=f"one of {', '.join(coral_kinds())}, or the path of a mesh file")
    size_m: float | None = Field(
        None, ge=0.02, le=2.0, description="scale the largest extent of a mesh file to this; not of a procedural one"
    )
    seed: Seed = Field(0, description="which individual of a procedural coral")
    points: int = Field(300, ge=20, le=10000, description="sample points that stand for the target's water in D")
    delicate_gain: float = Field(
        0.0, ge=0.0, le=100.0, description="points on thin or sharp places weigh 1 + this; 0 is the paper's weighting"
    )
    sway: Literal["by-kind", "none", "anemone", "gorgonian", "seagrass", "soft-coral"] = Field(
        "by-kind",
        description="the tissue it is made of, which says how it bends in flow, or none for a rigid one; by-kind: soft "
        "procedural targets bend, all others are rigid",
    )
    stiffness_Pa: float | None = Field(None, gt=0.0, le=1e13, description="Young's modulus instead of the tissue's")
    tissue_kg_m3: float | None = Field(None, ge=100.0, le=5000.0, description="density instead of the tissue's")
    drag: float | None = Field(None, gt=0.0, le=10.0, description="drag coefficient instead of the tissue's or 1.2")
    damping: float | None = Field(
        None, ge=0.0, le=2.0, description="damping by the tissue itself, relative to critical, instead of its own"
    )
    loose: UnanchoredSettings = UnanchoredSettings()

    @property
    def tissue(self) -> TissueProperties | None:
        """What the target is made of, with what is set in place of the tissue's own; None of a rigid one."""
        name = self.sway if self.sway != "by-kind" else self.kind
        if name not in TISSUES:
            return None
        own = {
            "stiffness_Pa": self.stiffness_Pa,
            "density_kg_m3": self.tissue_kg_m3,
            "drag": self.drag,
            "damping": self.damping,
        }
        return dataclasses.replace(TISSUES[name], **{key: value for key, value in own.items() if value is not None})

    @model_validator(mode="after")
    def _size_has_a_use(self) -> Self:
        if self.size_m is not None and not is_mesh_file(self.kind):
            raise ValueError(f"size_m scales a mesh file, {self.kind} has its own size: leave it out")
        return self

    @model_validator(mode="after")
    def _tissue_has_a_use(self) -> Self:
        for name in ("stiffness_Pa", "tissue_kg_m3", "damping"):
            if getattr(self, name) is not None and self.tissue is None:
                raise ValueError(f"{name} is of a target that bends: let sway be one of {', '.join(TISSUES)}")
        if self.drag is not None and self.tissue is None and self.loose.weight_N is None:
            raise ValueError("drag is of a target that bends or lies loose: set sway or loose.weight_N too")
        return self
