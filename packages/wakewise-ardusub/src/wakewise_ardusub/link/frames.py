"""ArduSub's frames: which way each motor pushes by the mixer, held against a vehicle file's own geometry.

A frame's name proves nothing: FRAME_CONFIG may be another vehicle's, and a matrix may be wrong in the firmware itself.
So motors are compared one by one, by the signs of their wrenches.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wakewise.core.arrays import Array
from wakewise.robot.vehicles import ARDUSUB_VECTORED, ARDUSUB_VECTORED_6DOF, Vehicle
from wakewise.robot.vehicles.check import WRENCH_AXES
from wakewise.robot.vehicles.mixing import compare_signs, factors_as_wrench

_BLUEROV1 = np.array(
    [
        [0.0, 0.0, -1.0, 0.0, 1.0, 0.0],
        [0.0, 0.0, 1.0, 0.0, 1.0, 0.0],
        [-0.5, 0.5, 0.0, 0.45, 0.0, 0.0],
        [0.5, 0.5, 0.0, 0.45, 0.0, 0.0],
        [0.0, -1.0, 0.0, 1.0, 0.0, 0.0],
        [-0.25, 0.0, 0.0, 0.0, 0.0, 1.0],
    ]
)
_VECTORED_6DOF_90DEG = np.array(
    [
        [1.0, 1.0, 0.0, 1.0, 0.0, 0.0],
        [0.0, 0.0, 1.0, 0.0, 1.0, 0.0],
        [1.0, -1.0, 0.0, 1.0, 0.0, 0.0],
        [0.0, 0.0, 0.0, 0.0, 0.0, 1.0],
        [0.0, 0.0, 0.0, 0.0, 0.0, 1.0],
        [-1.0, 1.0, 0.0, 1.0, 0.0, 0.0],
        [0.0, 0.0, -1.0, 0.0, 1.0, 0.0],
        [-1.0, -1.0, 0.0, 1.0, 0.0, 0.0],
    ]
)
_SIMPLE = np.array(
    [
        [0.0, 0.0, -1.0, 0.0, 1.0, 0.0],
        [0.0, 0.0, 1.0, 0.0, 1.0, 0.0],
        [1.0, 0.0, 0.0, -1.0, 0.0, 0.0],
        [-1.0, 0.0, 0.0, -1.0, 0.0, 0.0],
        [0.0, 0.0, 0.0, 0.0, 0.0, 1.0],
    ]
)
_SIMPLE_3 = np.array([*_SIMPLE[:2], [0.0, 0.0, 0.0, -1.0, 0.0, 0.0]])

FRAMES: dict[int, tuple[str, Array]] = {
    0: ("bluerov1", _BLUEROV1),
    1: ("vectored", ARDUSUB_VECTORED),
    2: ("vectored_6dof", ARDUSUB_VECTORED_6DOF),
    3: ("vectored_6dof_90deg", _VECTORED_6DOF_90DEG),
    4: ("simplerov_3", _SIMPLE_3),
    5: ("simplerov_4", _SIMPLE[:4]),
    6: ("simplerov_5", _SIMPLE),
}
"""FRAME_CONFIG: its name and motor factors, a row per motor with columns roll, pitch, yaw, throttle (up), forward,
lateral (right); from ArduPilot, AP_Motors6DOF::setup_motors. 7, custom, is what somebody built in."""

_WORDS = (("ahead", "astern"), ("right", "left"), ("down", "up"))
_TURNS = (("rolls right", "rolls left"), ("pitches up", "pitches down"), ("yaws right", "yaws left"))


@dataclass(frozen=True, kw_only=True)
class MotorMatch:
    """What mixer and vehicle file say of one motor's positive demand, from 1, in words; `advice` if they differ."""

    motor: int
    by_mixer: str
    by_vehicle: str
    agree: bool
    advice: str = ""


def pushes(wrench: Array) -> str:
    """Which way a wrench, shape (6,), FRD, pushes and turns the vehicle, by the signs of its parts."""
    strong = np.where(np.abs(wrench) > 1e-9, np.sign(wrench), 0.0)
    ways = [_WORDS[i][0 if strong[i] > 0.0 else 1] for i in range(3) if strong[i]]
    turns = [_TURNS[i][0 if strong[i + 3] > 0.0 else 1] for i in range(3) if strong[i + 3]]
    return "; ".join(part for part in (" and ".join(ways), ", ".join(turns)) if part) or "nowhere"


def force_words(axis_B: Array) -> str:
    """Which way a force, shape (3,), FRD, pushes, its lesser parts left out."""
    axis = np.where(np.abs(axis_B) > 0.2 * np.abs(axis_B).max(), axis_B, 0.0)
    return pushes(np.concatenate([axis, np.zeros(3)]))


def match_motors(vehicle: Vehicle, frame: int) -> list[MotorMatch]:
    """Hold each motor of a frame of `FRAMES` against the vehicle's thruster of its number; both have as many."""
    name, factors = FRAMES[frame]
    mixer = np.sign(factors_as_wrench(factors))
    comparison = compare_signs(vehicle, mixer, f"ArduSub, frame {name} (signs)")
    # An entry that disagrees carries the geometry's sign; all others have the mixer's.
    geometry = mixer.copy()
    for wrong in comparison.disagreements:
        geometry[WRENCH_AXES.index(wrong.row), wrong.thruster - 1] = wrong.geometry
    return [
        MotorMatch(
            motor=i + 1,
            by_mixer=pushes(mixer[:, i]),
            by_vehicle=pushes(geometry[:, i]),
            agree=bool(np.array_equal(mixer[:, i], geometry[:, i])),
            advice=_advice(vehicle, mixer, geometry, i),
        )
        for i in range(mixer.shape[1])
    ]


def _advice(vehicle: Vehicle, mixer: Array, geometry: Array, i: int) -> str:
    own = geometry[:, i]
    if np.array_equal(mixer[:, i], own):
        return ""
    who = f"thruster {i + 1} ({vehicle.thrusters[i].name})"
    if np.array_equal(mixer[:, i], -own):
        return f"turn the axis of {who} in the vehicle file about; --motor-test shows which of the two is right"
    others = [j + 1 for j in range(mixer.shape[1]) if j != i and np.array_equal(mixer[:, j], own)]
    if others:
        return (
            f"{who} sits where the frame has motor {others[0]}: put the vehicle file's thrusters in the motors' order"
        )
    return f"{who} is none of this frame's motors: another FRAME_CONFIG, or another vehicle file"
