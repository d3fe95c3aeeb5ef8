"""Poses of a vehicle's log: the autopilot's position, another estimator's, a DVL's steps summed, or latitudes."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from wakewise.core.arrays import Array, BoolArray
from wakewise.core.errors import InputError
from wakewise.core.geometry import matrix_from_quat, quat_from_euler
from wakewise.vision.photo_selection.dive_track import DiveTrack
from wakewise_ardusub.logs.channels import ChannelSeries, VehicleLog
from wakewise_ardusub.logs.read import read_log
from wakewise_ardusub.logs.table import depth_series
from wakewise_ardusub.optional_dependencies import need

RATE_HZ = 20.0
EARTH_M = 6_371_008.8
"""Mean radius (IUGG): north and east of nearby places differ from an ellipsoid's by 0.3 % at most."""
_SOURCES = {
    "position": "the autopilot's estimate",
    "odometry": "odometry (ODOMETRY)",
    "dvl step": "steps of a DVL, summed",
    "global": "latitude and longitude",
}
_LEAST_WAY_M, _LEAST_SAMPLES = 0.05, 5


def read_dive_log(path: Path) -> DiveTrack:
    """Read the poses of a .tlog, .BIN or .mcap file.

    Raises InputError as `wakewise_ardusub.logs.read.read_log`, or if the log holds no attitude or no positions.
    """
    need("wakewise photos pick --log", "links", only=("pymavlink", "mcap"))
    return dive_track(read_log(path, any_vehicle=True))


def dive_track(log: VehicleLog) -> DiveTrack:
    """Poses of a log at `RATE_HZ` at most, while both position and attitude are told.

    Raises InputError if one of them is missing.
    """
    attitude = _finite(log.series.get("attitude"))
    if attitude is None:
        raise InputError(f"{log.path}: holds no attitude (ATTITUDE or ATT), which photos need to get poses")
    attitude = ChannelSeries(time_s=attitude.time_s, values=np.unwrap(attitude.values, axis=0))
    for channel, words in _SOURCES.items():
        series = _finite(log.series.get(channel))
        if series is None:
            continue
        series = _in_metres(channel, series, attitude)
        if np.ptp(series.values[:, :2], axis=0).max() < _LEAST_WAY_M:
            continue
        if channel in ("dvl step", "global"):
            depth = _finite(depth_series(log)[0])
            if depth is not None:
                down = np.interp(series.time_s, depth.time_s, depth.values[:, 0])
                series = ChannelSeries(time_s=series.time_s, values=np.column_stack([series.values[:, :2], down]))
        return _joined(log, series, attitude, words)
    raise InputError(
        f"{log.path}: holds no positions (LOCAL_POSITION_NED, ODOMETRY, a DVL's VISION_POSITION_DELTA or latitudes; "
        "XKF1, VISO or GPS in a .BIN), without which metres flown are not known"
    )


def _finite(series: ChannelSeries | None) -> ChannelSeries | None:
    """Undamaged samples at rising times; None where they are too few.

    Each is later than all before it, or sooner than all behind it, whichever leaves more: one may be far too late.
    """
    if series is None:
        return None
    good: BoolArray = np.asarray(np.isfinite(series.values).all(axis=1) & np.isfinite(series.time_s))
    latest_s = np.maximum.accumulate(np.where(good, series.time_s, -np.inf))
    soonest_s = np.minimum.accumulate(np.where(good, series.time_s, np.inf)[::-1])[::-1]
    forwards, backwards = good.copy(), good.copy()
    forwards[1:] &= series.time_s[1:] > latest_s[:-1]
    backwards[:-1] &= series.time_s[:-1] < soonest_s[1:]
    good = forwards if forwards.sum() >= backwards.sum() else backwards
    if good.sum() < _LEAST_SAMPLES:
        return None
    return ChannelSeries(time_s=series.time_s[good].copy(), values=series.values[good].copy())


def _in_metres(channel: str, series: ChannelSeries, attitude: ChannelSeries) -> ChannelSeries:
    """North, east, down in m; a DVL's steps are turned by the attitude and summed."""
    values = series.values
    if channel == "dvl step":
        angles = [np.interp(series.time_s, attitude.time_s, column) for column in attitude.values.T]
        R_WB = matrix_from_quat(quat_from_euler(*angles))
        values = np.cumsum(np.einsum("nij,nj->ni", R_WB, values), axis=0)
    elif channel == "global":
        latitude, longitude = np.radians(values - values[0]).T
        east = longitude * np.cos(np.radians(values[0, 0]))
        values = EARTH_M * np.column_stack([latitude, east, np.zeros(len(values))])
    return ChannelSeries(time_s=series.time_s, values=values)


def _joined(log: VehicleLog, place: ChannelSeries, attitude: ChannelSeries, words: str) -> DiveTrack:
    """Positions and attitudes on one clock: the attitude's times within the positions', gaps of either left out."""
    first, last = max(place.time_s[0], attitude.time_s[0]), min(place.time_s[-1], attitude.time_s[-1])
    time_s = attitude.time_s[(attitude.time_s >= first) & (attitude.time_s <= last)]
    if len(time_s) > 1:
        time_s = time_s[np.unique((time_s * RATE_HZ).astype(np.int64), return_index=True)[1]]
        after = np.clip(np.searchsorted(place.time_s, time_s), 1, len(place.time_s) - 1)
        time_s = time_s[place.time_s[after] - place.time_s[after - 1] <= 2.0]
    if len(time_s) < 2:
        raise InputError(f"{log.path}: attitude and positions are told at different times, so there are no poses")
    return DiveTrack(
        name=log.path.name,
        time_s=time_s,
        position_W_m=_columns(place, time_s),
        q_WB=quat_from_euler(*_columns(attitude, time_s).T),
        altitude_m=_altitude(log, time_s),
        positions_from=words,
        started_s=_started(log),
    )


def _columns(series: ChannelSeries, time_s: Array) -> Array:
    return np.column_stack([np.interp(time_s, series.time_s, column) for column in series.values.T])


def _altitude(log: VehicleLog, time_s: Array) -> Array:
    """Altitudes within a second of a measured one, else NaN."""
    found = _finite(log.series.get("altitude"))
    if found is None:
        return np.full(len(time_s), np.nan)
    after = np.clip(np.searchsorted(found.time_s, time_s), 1, len(found.time_s) - 1)
    near = np.minimum(np.abs(found.time_s[after] - time_s), np.abs(found.time_s[after - 1] - time_s)) <= 1.0
    return np.where(near, np.interp(time_s, found.time_s, found.values[:, 0]), np.nan)


def _started(log: VehicleLog) -> float | None:
    """Time 0 of the log in s since 1970; the autopilot's own log has it from a GPS only."""
    if log.kind != "dataflash":
        # A computer's clock that was set during the dive is right afterwards.
        started_s = (log.started_s or 0.0) + sum(jump.step_s for jump in log.jumps)
        return started_s if started_s > 1e9 else None
    told = _finite(log.series.get("calendar"))
    return None if told is None else float(np.median(told.values[:, 0] - told.time_s))
