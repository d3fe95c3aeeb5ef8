"""Which process of `make test` runs which file, and memory that is not looked through again and again."""

from __future__ import annotations

import gc
import os
import sys
from pathlib import Path
from typing import Any

import pytest

sys.path.insert(0, str(Path(__file__).parent / "tests"))

from sharing import folder_of, next_file

os.environ.setdefault("WAKEWISE_STRICT", "1")  # a mistake of the program fails a test; it is not flown around


@pytest.fixture
def fallbacks_fly(monkeypatch: pytest.MonkeyPatch) -> None:
    """Guards fly a fallback whatever is raised, as they do where no test is watching."""
    monkeypatch.setenv("WAKEWISE_STRICT", "0")


def pytest_collection_finish() -> None:
    """Leave what was imported out of the search for garbage, which would look through all of it each time."""
    gc.collect()
    gc.freeze()


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """`--dist loadfile`, a folder at a time; of three processes and more the last runs what mostly waits, then ends.

    It is there so that no core is idle while a test waits for a clock or for another process.
    """
    if config.getoption("dist") != "loadfile":
        return None
    from xdist.scheduler import LoadFileScheduling

    class FolderByFolder(LoadFileScheduling):
        def __init__(self) -> None:
            super().__init__(config, log)
            self._folders: dict[Any, str] = {}
            self._waiter: Any = None

        def schedule(self) -> None:
            if self.collection is None and len(self.nodes) > 2:
                self._waiter = self.nodes[-1]
            super().schedule()

        def _assign_work_unit(self, node: Any) -> None:
            waiter = None if self._waiter is None else node is self._waiter
            file = next_file(list(self.workqueue), set(self._folders.values()), self._folders.get(node), waiter)
            if file is None:
                node.shutdown()
                return
            self._folders[node] = folder_of(file)
            self.workqueue.move_to_end(file, last=False)
            super()._assign_work_unit(node)

    return FolderByFolder()
