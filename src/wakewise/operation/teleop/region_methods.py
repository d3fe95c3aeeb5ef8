"""The methods of an assisted flight for one protected region, which may change in flight.

Making a method takes longer than a control step. So the pipelines of a new region are made in the thread that asks for
it, and the flight goes on with those of the last one until they are ready.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

from wakewise.control import make_controller, vehicle_layout
from wakewise.control.pipeline import Pipeline, pipeline_of
from wakewise.operation.parts import Parts
from wakewise.operation.teleop.operator_state import WAYS
from wakewise.scene.targets import Region


class RegionMethods(Mapping[str, Pipeline]):
    """Pipelines by the names of their methods, all for the same protected region.

    `make` gives them for a region; `own` is the region before another one is set. One thread sets regions, any may
    read.
    """

    def __init__(self, make: Callable[[Region], dict[str, Pipeline]], own: Region) -> None:
        self._make = make
        self._own = self._made = make(own)

    def protect(self, region: Region | None) -> None:
        """Make the pipelines of another region; None: those of the first one again."""
        self._made = self._own if region is None else self._make(region)

    def adopt(self, made: Mapping[str, Pipeline]) -> None:
        """Take pipelines that were made elsewhere, such as among other obstacles, of the same names."""
        self._made = dict(made)

    def __getitem__(self, name: str) -> Pipeline:
        return self._made[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._made)

    def __len__(self) -> int:
        return len(self._made)


def region_methods(parts: Parts) -> RegionMethods:
    """Both methods of an assisted flight: the scenario's, or `wake-aware` where that is no such method, and direct."""
    direct = ("dp", "manual", "manual-careful", "ardusub")
    gentle = WAYS[0] if parts.scenario.method in direct else parts.scenario.method
    layout = vehicle_layout(parts.vehicle)

    def make(region: Region) -> dict[str, Pipeline]:
        return {
            way: pipeline_of(
                make_controller(method, parts.vehicle, region, parts.wake, parts.control, parts.surroundings), layout
            )
            for way, method in ((WAYS[0], gentle), (WAYS[1], "dp"))
        }

    return RegionMethods(make, parts.region)
