"""Mesh and colours of a trial's model, for people: made by a process of their own beside evaluation and report.

COLMAP's mesher holds Python's lock for as long as it works, ten seconds and more: a thread would hold up all others,
and Ctrl-C with them. The other process begins as soon as there is a model, and ends when whoever started it ends,
however that ends.
"""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
import threading
import warnings
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import IO, Any

from wakewise.core.errors import StageError, WakewiseError
from wakewise.core.interfaces import Progress, no_progress
from wakewise.core.run_lock import remove_stale
from wakewise.core.subprocesses import (
    end_process,
    ignore_interrupt,
    private_stdout,
    read_message,
    start_python,
    wait_for,
    write_message,
)
from wakewise.experiments.trials.stages import ProgressListener
from wakewise.vision.reconstruction import ReconstructionSettings, mesh_model
from wakewise.vision.texturing.textured import write_textured


class SurfaceMaker:
    """Makes mesh.ply and mesh.glb of a trial's folder whose lock the caller has; use it in a `with` statement."""

    def __init__(self, folder: Path, settings: ReconstructionSettings, bed_z_m: float) -> None:
        self._folder, self._settings, self._bed_z_m = folder, settings, bed_z_m
        self._process: subprocess.Popen[bytes] | None = None
        self._asked = False

    def __enter__(self) -> SurfaceMaker:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        process, self._process = self._process, None
        if process is None:
            return
        end_process(process)
        remove_stale(self._folder)

    @property
    def _wanted(self) -> bool:
        return self._settings.mesh and (self._folder / "dense.ply").exists()

    @property
    def _meshed(self) -> bool:
        return _newer(self._folder / "mesh.ply", self._folder / "dense.ply")

    def ready(self) -> None:
        """Have the other process load its libraries, if a mesh is wanted and not there."""
        if self._process is not None or not self._wanted or self._meshed:
            return
        try:
            # BLAS gains nothing on arrays three wide, and its threads would spin beside those of the report.
            one_thread = {"OPENBLAS_NUM_THREADS": "1"}
            self._process = start_python("-m", "wakewise.experiments.trials.surface", variables=one_thread)
        except OSError as fault:
            _warn(str(fault))

    def begin(self) -> None:
        """Have the other process make mesh and colours from now on, if a mesh is wanted and not there."""
        if not self._asked and self._wanted and not self._meshed:
            self._asked = self._begin()

    def make(self, watch: ProgressListener, meanwhile: Callable[[str], None] | None = None) -> None:
        """Make what is missing, or wait for what is begun.

        `meanwhile("mesh")` is called beside the mesh and `meanwhile("colours")` beside these.

        Without anything to do meanwhile it is made in this process, which costs no second loading of libraries.

        Raises EnvironmentFailure if the disk is full, or a file cannot be read or written.
        """
        if not self._wanted:
            return
        beside = False
        if self._meshed and not self._asked:
            watch.skipped("mesh")
        else:
            beside = self._asked or (meanwhile is not None and self._begin())
            with watch.stage("mesh") as progress:
                if beside and meanwhile is not None:
                    meanwhile("mesh")
                beside = beside and self._await(progress)
                if not beside:
                    _mesh(self._folder, self._settings, progress)
        there = (self._folder / "mesh.ply").exists()
        if not (beside and there) and not uncoloured(self._folder):  # what is made beside may be done by now
            if there:
                watch.skipped("colours")
            return
        with watch.stage("colours") as progress:
            if beside and meanwhile is not None:
                meanwhile("colours")
            if not (beside and self._await(progress)):
                _colours(self._folder, self._bed_z_m, progress)

    def _begin(self) -> bool:
        """Tell the other process to begin; False if there is none."""
        self.ready()
        if self._process is None or self._process.stdin is None:
            return False
        with suppress(OSError):  # if it has ended meanwhile, the wait for its answer says so
            _send(self._process.stdin, (self._folder.resolve(), self._settings, self._bed_z_m))
        return True

    def _await(self, progress: Progress) -> bool:
        """Wait for the other process to finish a part; False if it ended without a word and the part is still to do."""
        process = self._process
        if process is None or process.stdout is None:
            return False
        while (answer := _receive(process.stdout)) is not None:
            kind, content = answer
            if kind == "progress":
                progress(*content)
            elif kind == "done":
                return True
            else:
                raise content
        self._process = None
        _warn(f"its process ended with status {wait_for(process)}")
        remove_stale(self._folder)
        return False


def uncoloured(folder: Path) -> bool:
    """Whether there is a mesh whose colours are not there or are those of an older one."""
    return (folder / "mesh.ply").exists() and not _newer(folder / "mesh.glb", folder / "mesh.ply")


def _newer(product: Path, source: Path) -> bool:
    return product.exists() and product.stat().st_mtime >= source.stat().st_mtime


def _warn(reason: str) -> None:
    words = f"mesh: could not be made beside the report ({reason}), so it is made before it"
    warnings.warn(words, RuntimeWarning, stacklevel=4)


def _mesh(folder: Path, settings: ReconstructionSettings, progress: Progress) -> None:
    """A model without a surface is one all the same."""
    with suppress(StageError):
        mesh_model(folder, settings, progress, held=True)


def _colours(folder: Path, bed_z_m: float, progress: Progress) -> None:
    """A mesh that no photograph sees gets no colours."""
    with suppress(StageError):
        write_textured(folder, folder / "images", folder / "mesh.glb", bed_z_m=bed_z_m, progress=progress)


def _send(pipe: IO[bytes], value: Any) -> None:
    write_message(pipe, pickle.dumps(value))


def _receive(pipe: IO[bytes]) -> Any:
    """The next value; None at the end."""
    message = read_message(pipe)
    return None if message is None else pickle.loads(message)


def serve(asked: IO[bytes], answers: IO[bytes]) -> None:
    """Make what is asked for, once: the other process."""
    request = _receive(asked)
    if request is None:
        return
    threading.Thread(target=_end_with, args=(asked,), daemon=True).start()
    folder, settings, bed_z_m = request

    def tell(done: float, total: float, note: str = "") -> None:
        _send(answers, ("progress", (done, total, note)))

    try:
        _mesh(folder, settings, no_progress)
        _send(answers, ("done", "mesh"))
        if (folder / "mesh.ply").exists():
            _colours(folder, bed_z_m, tell)
            _send(answers, ("done", "colours"))
    except (WakewiseError, OSError) as fault:
        _send(answers, ("fault", fault))


def _end_with(pipe: IO[bytes]) -> None:
    """End this process when whoever started it has ended: then its pipe has."""
    pipe.read()
    os._exit(1)


if __name__ == "__main__":
    ignore_interrupt()
    serve(sys.stdin.buffer, private_stdout())
