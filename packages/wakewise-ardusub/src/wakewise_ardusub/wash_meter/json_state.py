"""A reading as JSON: what the page, and anybody else on this computer, is told."""

from __future__ import annotations

from typing import Any

from wakewise_ardusub.wash_meter.history import WashHistory
from wakewise_ardusub.wash_meter.meter import MeterReading, WashMeter
from wakewise_ardusub.wash_savings import SHARES


def reading_as_json(meter: WashMeter, reading: MeterReading, history: WashHistory, points: str) -> dict[str, Any]:
    """How it stands; no number is NaN, what is not known is null."""
    craft, hearing, now_s = meter.craft, meter.hearing, reading.time_s
    armed = hearing.number("armed", now_s)
    second, flown, gentle = history.last
    state: dict[str, Any] = {
        "time_s": now_s,
        "vehicle": craft.name,
        "wake_model": craft.wake.name,
        "points": "of a mark in the world" if meter.marked else points,
        "marked": meter.marked,
        "can_mark": hearing.pose(now_s) is not None,
        "system": hearing.system,
        "armed": None if armed is None else armed > 0.5,
        "mode": hearing.mode(now_s),
        "voltage_V": hearing.number("voltage", now_s),
        "directions_known": meter.directions_known,
        "others": list(hearing.others),
        "why_not": reading.why_not,
        "running": reading.running,
        "saved_pct": meter.saved_pct(),
        "saved_dive_pct": meter.dive.saved_pct(meter.weight),
        "running_instants": meter.dive.instants,
        "second": second,
        "second_mm_s": [flown, gentle],
        "thrusters": list(craft.thrusters),
    }
    if reading.spared is not None:
        state |= {
            "disturbance": dict(reading.spared.disturbance),
            "rms_mm_s": {share: 1e3 * reading.rms_m_s[share] for share in SHARES},
            "peak_mm_s": {share: 1e3 * reading.peak_m_s[share] for share in SHARES},
            "thrusts_N": {share: reading.spared.thrusts_N[share].tolist() for share in SHARES},
            "shares_pct": reading.shares.tolist(),
        }
    return state
