"""Each motor's push by ArduSub's mixer and by the vehicle file: told apart motor by motor, in words."""

from __future__ import annotations

import csv
import dataclasses
import os
from pathlib import Path

import numpy as np
import pytest

from wakewise.robot.vehicles import load_vehicle
from wakewise_ardusub.link.checks import FRAMES, force_words, match_motors, pushes

HEAVY = load_vehicle("bluerov2-heavy")
SIX = load_vehicle("bluerov2")
DATA = Path(os.environ.get("WAKEWISE_DATA", "")) / "ardusub" / "ardusub_vectored_6dof_mixing.csv"


@pytest.mark.skipif(not DATA.is_file(), reason="WAKEWISE_DATA does not lead to ardusub/")
def test_the_factors_of_vectored_6dof_are_those_of_the_firmware() -> None:
    """Number for number, motor for motor, as they were taken from AP_Motors6DOF."""
    rows = list(csv.reader(line for line in DATA.read_text().splitlines() if not line.startswith("#")))
    stated = np.array([[float(value) for value in row[1:]] for row in rows[1:]])
    assert rows[0][1:] == ["roll", "pitch", "yaw", "throttle", "forward", "lateral"]
    assert np.array_equal(stated, FRAMES[2][1])


def test_every_frame_has_a_row_per_motor_and_no_idle_motor() -> None:
    """Six columns; no motor without any effect."""
    assert {frame: len(factors) for frame, (_, factors) in FRAMES.items()} == {0: 6, 1: 6, 2: 8, 3: 8, 4: 3, 5: 4, 6: 5}
    for _, factors in FRAMES.values():
        assert factors.shape[1] == 6
        assert (np.abs(factors).sum(axis=1) > 0.0).all()


@pytest.mark.parametrize(("vehicle", "frame"), [(HEAVY, 2), (SIX, 1)])
def test_library_vehicles_are_what_their_frames_say(vehicle, frame) -> None:
    """The BlueROV2's motors push as the mixer takes them to."""
    matches = match_motors(vehicle, frame)
    assert [match.motor for match in matches] == list(range(1, len(vehicle.thrusters) + 1))
    assert all(match.agree and not match.advice and match.by_mixer == match.by_vehicle for match in matches)


def test_words_say_which_way() -> None:
    """Forward, right and down are positive, and so are turns about them by the right hand."""
    assert pushes(np.array([1.0, -1.0, 0.0, 0.0, 0.0, 1.0])) == "ahead and left; yaws right"
    assert pushes(np.array([0.0, 0.0, 1.0, 1.0, -1.0, 0.0])) == "down; rolls right, pitches down"
    assert pushes(np.zeros(6)) == "nowhere"
    assert force_words(np.array([0.7, 0.7, 0.05])) == "ahead and right"


def _changed(index: int, **fields: object):
    thrusters = list(HEAVY.thrusters)
    thrusters[index] = dataclasses.replace(thrusters[index], **fields)
    return dataclasses.replace(HEAVY, thrusters=tuple(thrusters))


def test_a_motor_the_other_way_is_found_alone() -> None:
    """One axis turned about: that motor disagrees, the others do not, and it says what to turn."""
    matches = match_motors(_changed(2, axis_B=-HEAVY.thrusters[2].axis_B), 2)
    assert [match.motor for match in matches if not match.agree] == [3]
    assert "turn the axis of thruster 3" in matches[2].advice
    assert matches[2].by_mixer == "ahead and right; yaws left"
    assert matches[2].by_vehicle == "astern and left; yaws right"


def test_two_motors_in_each_others_place_are_found() -> None:
    """Thrusters in another order than the frame's motors: each says whose place it has."""
    thrusters = list(HEAVY.thrusters)
    thrusters[0], thrusters[5] = thrusters[5], thrusters[0]
    matches = match_motors(dataclasses.replace(HEAVY, thrusters=tuple(thrusters)), 2)
    assert [match.motor for match in matches if not match.agree] == [1, 6]
    assert "has motor 6" in matches[0].advice
    assert "has motor 1" in matches[5].advice


def test_the_matrix_counts_and_not_only_the_force() -> None:
    """A vertical thruster on the wrong side pushes down as well; it rolls the other way, and is found."""
    place = HEAVY.thrusters[4].p_BT_m * np.array([1.0, -1.0, 1.0])
    wrong = [match for match in match_motors(_changed(4, p_BT_m=place), 2) if not match.agree]
    assert [match.motor for match in wrong] == [5]
    assert wrong[0].by_mixer.startswith("down; rolls right")
    assert wrong[0].by_vehicle.startswith("down; rolls left")


def test_another_frame_with_as_many_motors_is_not_believed() -> None:
    """vectored_6dof_90deg has eight motors, too; none of them is this vehicle's."""
    assert not any(match.agree for match in match_motors(HEAVY, 3))
