"""Photographs beside the flight: the same bytes as after it, never in its way, and no harm where it fails."""

import os
import sys
import time
import warnings
from dataclasses import replace

import numpy as np
import pytest

from wakewise.core.geometry import Pose, quat_from_rotvec
from wakewise.core.interfaces import ScalarGrid
from wakewise.operation import BackgroundRenderer, load_scenario, photograph_flight
from wakewise.operation.background_renderer import MOST_WAITING, packed, unpacked
from wakewise.operation.flight_log import ExposureRecord, read_exposures, write_exposures
from wakewise.operation.photography import fingerprint, take_photograph
from wakewise.simulation.tank.flakes import Flakes
from wakewise.simulation.water import SteadyCurrent

SMALL = {
    "mission.elevations_deg": [40],
    "mission.views": [4],
    "imaging.width": 160,
    "imaging.height": 120,
}


@pytest.fixture(scope="module")
def parts():
    return load_scenario("quick", None, SMALL).parts()


@pytest.fixture(scope="module")
def exposures(parts):
    """Four exposures on the planned way, moving, in patchy silt."""
    rng = np.random.default_rng(0)
    current = SteadyCurrent(velocity_W_m_s=np.array([0.03, 0.02, 0.0]))
    drift = Flakes(parts.target.centre_W_m, parts.target.bed_z_m, current, rng)
    out = []
    for time_s, X in zip(parts.route.exposures_s, parts.route.X_WC_planned, strict=True):
        poses = tuple(X @ Pose(np.array([k * 2e-4, 0, 0]), quat_from_rotvec(np.zeros(3))) for k in range(5))
        silt = ScalarGrid(
            origin_W_m=np.array([-1.0, -1, 0.5]), spacing_m=0.1, values=rng.uniform(0, 0.004, (20, 20, 10))
        )
        outer = ScalarGrid(
            origin_W_m=np.array([-3.0, -2.5, -0.1]), spacing_m=0.2, values=rng.uniform(0, 0.002, (31, 26, 9))
        )
        flakes = drift.before(X, float(time_s), Still())
        silt = replace(silt, outer=outer)
        out.append(ExposureRecord(time_s=float(time_s), X_WC_true=poses, X_WC_est=X, silt=silt, flakes=flakes))
    return out


class Still:
    """Water to which no thruster adds."""

    def excess_velocity(self, points_W_m):
        return np.zeros((len(points_W_m), 3))


def photographed(parts, exposures, folder, beside):
    """Photographs of a trial's folder, of which those of `beside` are made by the other process."""
    folder.mkdir()
    with BackgroundRenderer(parts, folder) as darkroom:
        for k in beside:
            darkroom.take(k, exposures[k])
        write_exposures(folder / "exposures.npz", exposures, parts.scenario.imaging.exposure_s)
        darkroom.finish()
        made = sorted(path.name for path in folder.glob("images/[0-9]*"))
        photograph_flight(parts, folder)
    return made, {path.name: path.read_bytes() for path in sorted(folder.glob("images/*"))}, folder / "images.csv"


@pytest.mark.slow
def test_a_photograph_has_the_same_bytes_beside_the_flight_and_after_it(parts, exposures, tmp_path):
    """Some made by the other process, all by this one: photographs and images.csv are equal to the byte."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        none, after, listed = photographed(parts, exposures, tmp_path / "after", ())
        some, beside, listed_too = photographed(parts, exposures, tmp_path / "beside", (0, 1, 3))
    assert none == [] and len(some) == 3
    assert beside == after and len(after) == 4
    assert listed.read_bytes() == listed_too.read_bytes()


def test_a_worker_that_fails_is_told_and_costs_no_photograph(parts, exposures, tmp_path, monkeypatch):
    """Where the other process cannot begin, a warning gives its last word and all photographs come after the flight."""
    failing = tmp_path / "python"
    failing.write_text("#!/bin/sh\necho no such thing >&2\nexit 1\n")
    failing.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(failing))
    with pytest.warns(RuntimeWarning, match="beside the flight.*no such thing"):
        made, photos, _ = photographed(parts, exposures, tmp_path / "trial", range(4))
    assert made == [] and len(photos) == 4


def test_a_worker_that_cannot_be_started_is_told_and_the_flight_goes_on(parts, exposures, tmp_path, monkeypatch):
    """Without an interpreter to start, a warning says so once and exposures are left to the stage after the flight."""
    monkeypatch.setattr(sys, "executable", str(tmp_path / "no-python"))
    with BackgroundRenderer(parts, tmp_path) as darkroom:
        with pytest.warns(RuntimeWarning, match="no-python"):
            darkroom.take(0, exposures[0])
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            darkroom.take(1, exposures[1])
            darkroom.finish()


@pytest.mark.slow
def test_made_ready_for_nothing_it_ends_by_itself(parts, tmp_path):
    """Begun before the flight, once however often it is asked; without an exposure it ends well and makes nothing."""
    with warnings.catch_warnings(), BackgroundRenderer(parts, tmp_path) as darkroom:
        warnings.simplefilter("error")
        darkroom.ready()
        process = darkroom._process
        darkroom.ready()
        assert darkroom._process is process
        darkroom.finish()
        assert process.returncode == 0
    assert not (tmp_path / "images").exists()


def test_leaving_early_ends_the_other_process(parts, exposures, tmp_path):
    """An error in the flight leaves no process behind and no half of a photograph."""
    with pytest.raises(KeyboardInterrupt), BackgroundRenderer(parts, tmp_path) as darkroom:
        darkroom.take(0, exposures[0])
        number = darkroom._process.pid
        raise KeyboardInterrupt
    with pytest.raises(ProcessLookupError):
        os.kill(number, 0)
    assert not [path for path in tmp_path.glob("images/.*") if path.suffix != ".json"]


def test_the_flight_does_not_wait(parts, exposures, tmp_path):
    """Ten times as many exposures as there is room for are taken at once in less time than one photograph takes."""
    with BackgroundRenderer(parts, tmp_path) as darkroom:
        darkroom.take(0, exposures[0])
        began = time.thread_time()
        for _ in range(10 * MOST_WAITING):
            darkroom.take(0, exposures[0])
        assert time.thread_time() - began < 1.0


def test_an_exposure_arrives_as_the_record_keeps_it(exposures, tmp_path):
    """What the other process reads is what is read from exposures.npz, to the bit; any change has another mark."""
    write_exposures(tmp_path / "exposures.npz", exposures, 0.008)
    kept = read_exposures(tmp_path / "exposures.npz")
    marks = set()
    for k, (exposure, written) in enumerate(zip(exposures, kept, strict=True)):
        number, sent = unpacked(packed(k, exposure))
        assert number == k and fingerprint(sent) == fingerprint(written)
        assert np.array_equal(sent.silt.values, written.silt.values)
        marks.add(fingerprint(sent))
    assert len(marks) == len(exposures)


def test_a_photograph_of_another_flight_is_made_anew(parts, exposures, tmp_path):
    """A photograph left by a flight that was cut off stays only if it shows the same exposure."""
    write_exposures(tmp_path / "exposures.npz", exposures, 0.008)
    kept = read_exposures(tmp_path / "exposures.npz")
    first = take_photograph(parts, tmp_path, 0, kept[0])
    path = next(tmp_path.glob("images/*.png"))
    before = path.read_bytes()
    assert take_photograph(parts, tmp_path, 0, kept[0]) == first
    again = take_photograph(parts, tmp_path, 0, kept[1])
    assert again["exposure"] != first["exposure"] and path.read_bytes() != before


def test_flakes_and_outer_silt_are_kept_and_old_files_are_read_without(exposures, tmp_path):
    """What was written is read again; a file of before they were kept has neither; both are in the fingerprint."""
    path = tmp_path / "exposures.npz"
    write_exposures(path, exposures, 0.01)
    read = read_exposures(path)
    for before, after in zip(exposures, read, strict=True):
        assert after.silt.outer.values == pytest.approx(before.silt.outer.values, abs=1e-9)
        assert after.flakes.p_W_m == pytest.approx(before.flakes.p_W_m, abs=1e-6)
        assert after.flakes.v_W_m_s == pytest.approx(before.flakes.v_W_m_s, abs=1e-4)
        assert after.flakes.slopes == before.flakes.slopes
    with np.load(path) as data:
        kept = {name: data[name] for name in data if not name.startswith(("flake", "silt_outer"))}
    np.savez(path, **kept)
    old = read_exposures(path)
    assert all(exposure.flakes is None and exposure.silt.outer is None for exposure in old)
    marks = {fingerprint(e) for e in (read[0], replace(read[0], flakes=None), replace(read[0], silt=old[0].silt))}
    assert len(marks) == 3
