"""Which columns of a trial a controller could know, and what each column means.

What is known is listed; everything else is truth, so that a column that is added one day does not slip into what may be
learnt from.
"""

from __future__ import annotations

import re
from collections.abc import Iterable

_KNOWN = re.compile(
    r"time_s|exposing|fallback|leg|disturbance|name|sharpness|(est|goal|wrench|load)_\w+|command_\d+_N|ardusub_\w+"
)
_WHOSE = {"true": "true", "est": "estimated", "goal": "wished"}
_STATE = {
    "x_m": "north of the body's origin, m", "y_m": "east of the body's origin, m", "z_m": "its depth, m",
    "qw": "attitude quaternion from body to world, w", "qx": "the same, x", "qy": "the same, y", "qz": "the same, z",
    "u_m_s": "velocity forward, m/s", "v_m_s": "velocity to the right, m/s", "w_m_s": "velocity down, m/s",
    "p_rad_s": "turning about the axis forward, rad/s", "q_rad_s": "turning about the axis to the right, rad/s",
    "r_rad_s": "turning about the axis down, rad/s", "tilt_deg": "angle of the camera's joint, up, deg",
}  # fmt: skip
_CAMERA = {
    "x_m": "north of the camera's centre, m", "y_m": "east of the camera's centre, m", "z_m": "its depth, m",
    "qw": "quaternion from camera (x right, y down, z ahead) to world, w",
}  # fmt: skip
_AXES = {
    "X_N": "force forward, N", "Y_N": "force to the right, N", "Z_N": "force down, N",
    "K_Nm": "moment about the axis forward, N m", "M_Nm": "moment about the axis to the right, N m",
    "N_Nm": "moment about the axis down, N m",
}  # fmt: skip
_SINGLE = {
    "trial": "which trial the row is of",
    "time_s": "seconds since the trial's start",
    "exposing": "whether a photograph is taken in this step",
    "collision": "whether the hull touches something",
    "fallback": "why what was sent is not what the method wanted; empty if it is",
    "leg": "what stretch of the mission this is",
    "disturbance": "D by the controller's own wake model, (m/s)^2",
    "power_W": "electrical power of all thrusters, W",
    "name": "file name of the photograph",
    "sharpness": "of the photograph, without unit",
    "turbidity_per_m": "mean beam attenuation by silt near the target, 1/m",
    "target_speed_mean_m_s": "water speed on the target in excess of the same water without the vehicle, mean, m/s",
    "target_speed_p95_m_s": "the same, 95th percentile, m/s",
    "bed_speed_p95_m_s": "the same 1 to 2 cm above the bed round its foot, 95th percentile, m/s",
}


def is_known(column: str) -> bool:
    """Whether a controller or a crew could have had it."""
    return _KNOWN.fullmatch(column) is not None


def known_and_true(columns: Iterable[str], shared: tuple[str, ...]) -> tuple[list[str], list[str]]:
    """Columns of both sides, in their order; the `shared` ones, which join the two, stand on both."""
    names = list(columns)
    known = [name for name in names if is_known(name)]
    return known, [name for name in names if not is_known(name) or name in shared]


def meaning(column: str, of_camera: bool = False) -> str:
    """What a column is, with its unit; world north-east-down, body forward-right-down."""
    if column in _SINGLE:
        return _SINGLE[column]
    head, _, rest = column.partition("_")
    table = _STATE | _CAMERA if of_camera else _STATE
    if head in _WHOSE and rest in table:
        return f"{_WHOSE[head]}: {table[rest]}"
    if head in ("wrench", "load") and rest in _AXES:
        return f"{'asked of the thrusters' if head == 'wrench' else 'unexplained load, estimated'}: {_AXES[rest]}"
    match = re.fullmatch(r"(thrust|command)_(\d+)_N", column)
    if match is not None:
        return f"thruster {match[2]}: {'thrust it gave' if match[1] == 'thrust' else 'thrust it was sent'}, N"
    return f"{column.replace('_', ' ')}; see the data sheet"
