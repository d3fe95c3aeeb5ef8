"""The cases of the study of failing models: parts, cases and doses of `cases.yaml` as trials."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from importlib import resources
from typing import Any

from pydantic import Field, TypeAdapter, ValidationError, model_validator

from wakewise.core.errors import InputError
from wakewise.core.safe_yaml import read_yaml
from wakewise.core.settings import Settings
from wakewise.experiments.campaigns.definition import MODEL_SOURCES, PlannedTrial
from wakewise.experiments.campaigns.flights import MODEL
from wakewise.experiments.campaigns.study import flight_trial, study_trial
from wakewise.experiments.campaigns.task import Task
from wakewise_paper.reproduction.table_trials import METHOD_PLACES

SOURCES = (*MODEL_SOURCES, "wakewise_paper:flights.py", "wakewise_paper:dp_paper.py")
USUAL = "usual"
"""Case of a part with axes in which no quantity is changed."""


class CaseFile(Settings):
    """One case: what it adds to its part, and why."""

    title: str = Field(..., min_length=3)
    source: str = Field(..., min_length=3, description="where its numbers come from")
    methods: tuple[str, ...] | None = Field(None, description="instead of the part's")
    fields: dict[str, Any] = Field({}, description="fields of a scenario by dotted name")
    setup: dict[str, dict[str, Any]] = Field({}, description="functions that change the parts of a trial")


class AxisFile(Settings):
    """One quantity and the values that it takes."""

    title: str
    field: str = Field(..., description="of a scenario, by dotted name")
    unit: str
    scale: float = Field(..., description="from the field's unit to `unit`")
    component: int | None = Field(None, description="of a field that is a vector, which one is the quantity")
    usual: Any = Field(..., description="its value where another quantity is changed")
    values: tuple[Any, ...] = Field(..., min_length=1)
    source: str

    def dose(self, value: Any) -> float:
        """The quantity in its unit."""
        number = value if self.component is None else value[self.component]
        return self.scale * float(number) + 0.0  # no -0


class PartFile(Settings):
    """Cases that share methods, seeds and fields."""

    title: str
    first_seed: int = Field(..., ge=1)
    seeds: int = Field(..., ge=1)
    models: bool = Field(True, description="whether photographs and a model are made of each flight")
    methods: tuple[str, ...] = Field(..., min_length=1)
    fields: dict[str, Any]
    cases: dict[str, CaseFile] = Field({})
    axes: dict[str, AxisFile] = Field({})

    @model_validator(mode="after")
    def _one_of_both(self) -> PartFile:
        if bool(self.cases) == bool(self.axes):
            raise ValueError("holds cases and axes or neither, must hold one of them")
        return self


@dataclass(frozen=True, kw_only=True)
class Case:
    """One case of a part, with all fields of its scenario; `doses` are its values by axis, in the axis' unit."""

    part: str
    name: str
    title: str
    methods: tuple[str, ...]
    fields: dict[str, Any]
    setup: dict[str, dict[str, Any]]
    doses: dict[str, float]

    def trial(self, method: str, seed: int) -> PlannedTrial:
        """A whole quick scan, and its model where the part has models."""
        fields = {"method": METHOD_PLACES.get(method, method), **self.fields, "seed": seed}
        if not load_parts()[self.part].models:
            return flight_trial(
                str(fields["world"]),
                method,
                seed,
                fields,
                setup=self.setup,
                sources=SOURCES,
                variation=f"{self.part}/{self.name}",
            )
        settings = {"scenario": fields, "preset": "quick", "keep": "figures", "setup": self.setup}
        name = f"{self.part}/{self.name}/{method}/{seed}"
        task = Task(name=name, work=MODEL, settings=settings, sources=SOURCES)
        return study_trial(str(fields["world"]), method, seed, task, f"{self.part}/{self.name}")


@functools.cache
def load_parts() -> dict[str, PartFile]:
    """The parts of `cases.yaml`, by name.

    Raises
    ------
    InputError
        If the file does not hold what it must.
    """
    text = (resources.files("wakewise_paper.model_failure") / "cases.yaml").read_text("utf-8")
    try:
        return TypeAdapter(dict[str, PartFile]).validate_python(read_yaml(text))
    except ValidationError as fault:
        raise InputError(f"cases.yaml: {fault.errors()[0]['loc']}: {fault.errors()[0]['msg']}") from None


def cases_of(part: str) -> tuple[Case, ...]:
    """The cases of a part; of one with axes, the usual case and each value of each axis."""
    file = load_parts()[part]
    if file.cases:
        return tuple(
            Case(
                part=part,
                name=name,
                title=case.title,
                methods=case.methods or file.methods,
                fields=file.fields | case.fields,
                setup=case.setup,
                doses={},
            )
            for name, case in file.cases.items()
        )
    usual = {name: axis.dose(axis.usual) for name, axis in file.axes.items()}
    found = [_dosed(part, file, USUAL, "as usual", {}, usual)]
    for name, axis in file.axes.items():
        for value in axis.values:
            dose = axis.dose(value)
            title = f"{axis.title}: {dose:g} {axis.unit}"
            found.append(_dosed(part, file, f"{name}={dose:g}", title, {axis.field: value}, {name: dose}))
    return tuple(found)


def _dosed(part: str, file: PartFile, name: str, title: str, fields: dict[str, Any], doses: dict[str, float]) -> Case:
    return Case(
        part=part,
        name=name,
        title=title,
        methods=file.methods,
        fields=file.fields | fields,
        setup={},
        doses=doses,
    )
