"""Mesh and colours by a process of their own: what is made, skipped, made in its place, and what is left of it."""

import os
import subprocess
import sys
import time
import warnings
from contextlib import nullcontext

import numpy as np
import pytest

from wakewise.core.errors import EnvironmentFailure
from wakewise.core.files import write_json
from wakewise.experiments.trials import surface
from wakewise.experiments.trials.surface import SurfaceMaker
from wakewise.vision.reconstruction import ReconstructionSettings
from wakewise.vision.reconstruction.outputs.clouds import OrientedPointCloud, write_cloud
from wakewise.vision.reconstruction.sfm.colmap import pycolmap

COARSE = ReconstructionSettings(mesh_depth=6)


class Stages:
    """A watch that remembers what ran and what was skipped."""

    def __init__(self):
        self.ran, self.skips = [], []

    def stage(self, name):
        self.ran.append(name)
        return nullcontext(lambda *_: None)

    def skipped(self, name):
        self.skips.append(name)


@pytest.fixture
def folder(tmp_path):
    """Dense points of a ball, as a reconstruction leaves them; no photograph sees it, so that there are no colours."""
    rng = np.random.default_rng(0)
    normals = rng.normal(size=(6000, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    colours = np.full((6000, 3), 0.5)
    write_cloud(tmp_path / "dense.ply", OrientedPointCloud(points_m=0.05 * normals, normals=normals, colours=colours))
    stamp = {"key": "k", "wall_s": 0.0, "figures": {"point_spacing_mm": 2.0}}
    write_json(tmp_path / "stages" / "dense.json", stamp)
    (tmp_path / "sparse").mkdir()
    pycolmap.Reconstruction().write(tmp_path / "sparse")
    return tmp_path


def instead(begin):
    """`subprocess.Popen` with `begin` in place of what starts the maker; COLMAP's own processes are begun as ever."""
    popen = subprocess.Popen
    return lambda words, **options: (begin if "wakewise.experiments.trials.surface" in words else popen)(
        words, **options
    )


def made(folder, meanwhile=lambda _: None):
    watch = Stages()
    with SurfaceMaker(folder, COARSE, 1.0) as maker:
        maker.ready()
        maker.make(watch, meanwhile)
    return watch


def test_the_other_process_makes_the_mesh_that_this_one_would(folder, monkeypatch, tmp_path_factory):
    """The same bytes; what can be done meanwhile is done before the mesh is there, and with it once it is."""
    calls = []
    with monkeypatch.context() as patch:
        for name in ("_mesh", "_colours"):
            patch.setattr(surface, name, lambda *_: pytest.fail("was made in this process"))
        watch = made(folder, lambda missing: calls.append((missing, (folder / "mesh.ply").exists())))
    beside = (folder / "mesh.ply").read_bytes()
    assert watch.ran == ["mesh", "colours"] and [name for name, _ in calls] == ["mesh", "colours"]
    assert dict(calls)["colours"] is True
    assert not list(folder.rglob(".*"))
    (folder / "mesh.ply").unlink()
    refused = instead(lambda *_, **__: pytest.fail("a process was begun"))
    monkeypatch.setattr(surface.subprocess, "Popen", refused)
    with SurfaceMaker(folder, COARSE, 1.0) as maker:
        maker.make(Stages())
    assert (folder / "mesh.ply").read_bytes() == beside


@pytest.mark.slow
def test_what_was_begun_is_waited_for_and_not_made_twice(folder, monkeypatch):
    """Also where the mesh is there before anybody asks for it: its stages ran, and none of them in this process."""
    for name in ("_mesh", "_colours"):
        monkeypatch.setattr(surface, name, lambda *_: pytest.fail("was made in this process"))
    calls, watch = [], Stages()
    with SurfaceMaker(folder, COARSE, 1.0) as maker:
        maker.begin()
        until = time.monotonic() + 120
        while not (folder / "mesh.ply").exists() and time.monotonic() < until:
            time.sleep(0.05)
        maker.make(watch, calls.append)
    assert (watch.ran, watch.skips, calls) == (["mesh", "colours"], [], ["mesh", "colours"])


def test_what_is_there_is_skipped_and_no_process_is_begun(folder, monkeypatch):
    """Mesh and colours that are newer than what they are made of stay; unless a mesh is asked for, nothing is said."""
    monkeypatch.setattr(surface.subprocess, "Popen", lambda *_, **__: pytest.fail("a process was begun"))
    for name in ("mesh.ply", "mesh.glb"):
        (folder / name).touch()
    watch = made(folder)
    assert (watch.ran, watch.skips) == ([], ["mesh", "colours"])
    with SurfaceMaker(folder, COARSE.model_copy(update={"mesh": False}), 1.0) as maker:
        maker.ready()
        maker.make(silent := Stages())
    assert (silent.ran, silent.skips) == ([], [])


@pytest.mark.slow
@pytest.mark.parametrize("program", ["#!/bin/sh\nexit 3\n", None])
def test_a_process_that_fails_is_told_and_costs_no_mesh(folder, program, monkeypatch):
    """Whether it ends without an answer or cannot be started, a warning says so and the mesh is made here."""
    python = folder / "python"
    if program is not None:
        python.write_text(program)
        python.chmod(0o755)
    popen = subprocess.Popen
    begun = instead(lambda words, **options: popen([str(python), *words[1:]], **options))
    monkeypatch.setattr(surface.subprocess, "Popen", begun)
    with pytest.warns(RuntimeWarning, match="status 3" if program else "python"):
        made(folder)
    assert (folder / "mesh.ply").stat().st_size > 0


@pytest.mark.slow
def test_a_fault_of_the_computer_in_the_other_process_is_this_ones(folder, monkeypatch):
    """A full disk is no missing mesh: it is raised with its words."""
    program = folder / "python"
    program.write_text(
        f"#!{sys.executable}\nimport sys\nfrom wakewise.core.errors import EnvironmentFailure\n"
        "from wakewise.experiments.trials.surface import _send\n"
        "_send(sys.stdout.buffer, ('fault', EnvironmentFailure('mesh: the disk is full')))\n"
    )
    program.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(program))
    with pytest.raises(EnvironmentFailure, match="the disk is full"):
        made(folder)


def test_leaving_early_ends_the_other_process_and_sweeps(folder):
    """Ctrl-C while the mesh is made leaves no process and no half of a file behind."""
    with warnings.catch_warnings(), pytest.raises(KeyboardInterrupt), SurfaceMaker(folder, COARSE, 1.0) as maker:
        warnings.simplefilter("error")

        def interrupt(_):
            raise KeyboardInterrupt

        maker.ready()
        pid = maker._process.pid
        maker.make(Stages(), interrupt)
    with pytest.raises(ProcessLookupError):
        os.kill(pid, 0)
    assert not list(folder.rglob(".*"))


ENDS = """
import sys, time
from wakewise.experiments.trials import surface
surface._mesh = lambda *_: (print("at work", file=sys.stderr, flush=True), time.sleep(60))
surface.serve(sys.stdin.buffer, sys.stdout.buffer)
"""


@pytest.mark.slow
def test_the_other_process_ends_with_the_one_that_began_it(folder):
    """Also where that was killed and could tell nobody: its pipe is closed, and no mesh comes after it."""
    other = subprocess.Popen([sys.executable, "-c", ENDS], stdin=subprocess.PIPE, stderr=subprocess.PIPE)
    surface._send(other.stdin, (folder, COARSE, 1.0))
    assert other.stderr.readline() == b"at work\n"
    began = time.monotonic()
    other.stdin.close()
    assert other.wait(30) == 1 and time.monotonic() - began < 30
    other.stderr.close()
