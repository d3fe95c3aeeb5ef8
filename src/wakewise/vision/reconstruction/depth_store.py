"""Depth maps of many photographs: a few in memory, the rest on disk, read when they are asked for."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from wakewise.vision.reconstruction.stereo import DepthMap

HELD_BYTES = 250_000_000
"""Of depth maps that stay in memory: about 25 photographs' at 640 px."""


class DepthStore:
    """Depth maps by number, in the order in which they were added; their arrays lie in `folder` beyond `most_bytes`."""

    def __init__(self, folder: Path, most_bytes: int = HELD_BYTES) -> None:
        self._folder = folder
        self._left = most_bytes
        self._maps: list[DepthMap] = []
        self._stored: dict[int, tuple[int, int]] = {}

    def add(self, depth_map: DepthMap) -> None:
        """Keep a map.

        Raises
        ------
        OSError
            If the disk is full.
        """
        size = depth_map.depth_m.nbytes + depth_map.wanted.nbytes + depth_map.colours.nbytes
        if size <= self._left:
            self._left -= size
        else:
            height, width = depth_map.depth_m.shape
            number = len(self._maps)
            depth_map.depth_m.tofile(self._folder / f"{number}.depth")
            with (self._folder / f"{number}.rest").open("wb") as file:
                file.write(depth_map.wanted.tobytes())
                file.write(depth_map.colours.tobytes())
            self._stored[number] = (height, width)
            depth_map = replace(
                depth_map,
                depth_m=np.zeros((0, 0), dtype=np.float32),
                wanted=np.zeros((0, 0), dtype=np.bool_),
                colours=np.zeros((0, 0, 3), dtype=np.uint8),
            )
        self._maps.append(depth_map)

    def __len__(self) -> int:
        return len(self._maps)

    def photos(self, number: int) -> tuple[int, int]:
        """The two photographs that a map is of: the one that it is seen from, and its partner."""
        one = self._maps[number]
        return one.first, one.second

    def depths(self, number: int) -> DepthMap:
        """A map with its depths; which are wanted, and colours, may be missing.

        Raises
        ------
        OSError
            If it cannot be read.
        """
        size = self._stored.get(number)
        if size is None:
            return self._maps[number]
        depth = np.fromfile(self._folder / f"{number}.depth", dtype=np.float32).reshape(size)
        return replace(self._maps[number], depth_m=depth)

    def whole(self, number: int) -> DepthMap:
        """A map with all that belongs to it.

        Raises
        ------
        OSError
            If it cannot be read.
        """
        size = self._stored.get(number)
        if size is None:
            return self._maps[number]
        data = np.fromfile(self._folder / f"{number}.rest", dtype=np.uint8)
        pixels = size[0] * size[1]
        return replace(
            self.depths(number),
            wanted=data[:pixels].view(np.bool_).reshape(size),
            colours=np.ascontiguousarray(data[pixels:]).reshape(*size, 3),
        )
