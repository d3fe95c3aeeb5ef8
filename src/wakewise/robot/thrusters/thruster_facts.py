"""What a thrust curve or a fitted lag says, as plain values for people and machines."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.robot.thrusters.lag_fit import LagFit
from wakewise.robot.thrusters.rotor_lag import SecondOrderLag
from wakewise.robot.thrusters.thrust_curve import ThrustCurve

ROWS_PER_SIDE = 6
_ROUNDING = 0.005
"""So far beyond its limits a value may be, since they are printed rounded."""
USUAL_SUPPLY_V = 16.0
"""Four lithium cells when full enough; the voltage that makers of small thrusters quote."""


def usual_voltage(curve: ThrustCurve) -> float:
    """Voltage of the table that is nearest to 16 V."""
    return float(curve.supply_V[int(np.argmin(np.abs(curve.supply_V - USUAL_SUPPLY_V)))])


def curve_facts(
    curve: ThrustCurve, supply_V: float, thrusts_N: Sequence[float] = (), pulses_us: Sequence[float] = ()
) -> dict[str, Any]:
    """Limits, deadband and a short table at a voltage, and what desired thrusts and pulses give.

    Raises InputError if the voltage lies outside the table, or a desired value is not finite or beyond what the table
    holds.
    """
    at = curve.voltage(supply_V)
    low, high = curve.limits_N(at)
    _within(curve, at, "desired thrust", thrusts_N, (low, high), "N")
    _within(curve, at, "pulse", pulses_us, curve.pulse_limits_us(at), "us")
    first_low, first_high = curve.first_step_N(at)
    steps = np.linspace(0.0, 1.0, ROWS_PER_SIDE)
    thrusts = np.concatenate([low + steps * (first_low - low), [0.0], first_high + steps * (high - first_high)])
    why = {
        key: f"the table has no column {key}"
        for key in ("rpm", "power_W")
        if getattr(curve.forward, key) is None or getattr(curve.reverse, key) is None
    }
    desired = np.asarray(thrusts_N, dtype=np.float64)
    return {
        "name": curve.name,
        "source": curve.source,
        "supply_V": at,
        "voltages_V": curve.supply_V.tolist(),
        "neutral_us": curve.neutral_us,
        "deadband_us": list(curve.deadband_us(at)),
        "pulse_limits_us": list(curve.pulse_limits_us(at)),
        "limits_N": [low, high],
        "first_step_N": [first_low, first_high],
        "table": _rows(curve, at, np.unique(thrusts), why),
        "thrusts": [
            {"desired_N": float(value), **row}
            for value, row in zip(desired, _rows(curve, at, desired, why), strict=True)
        ],
        "pulses": [
            {**row, "pwm_us": float(pulse)}
            for pulse, row in zip(
                pulses_us, _rows(curve, at, curve.thrust_N(np.asarray(pulses_us, float), at), why), strict=True
            )
        ],
        "notes": list(curve.notes),
        "why": why,
    }


def _within(
    curve: ThrustCurve, supply_V: float, what: str, values: Sequence[float], limits: tuple[float, float], unit: str
) -> None:
    """Refuse a question that the table does not answer; in a flight a thruster saturates there."""
    low, high = limits
    for value in values:
        if value < low - _ROUNDING or value > high + _ROUNDING:
            raise InputError(
                f"{what}: {value:g} {unit}, {curve.name} at {supply_V:g} V gives {low:.4g} to {high:.4g} {unit}"
            )


def lag_facts(fit: LagFit) -> dict[str, Any]:
    """What a fitted lag says, every figure with its unit in its name."""
    estimates = {
        estimate.name: {"value": estimate.value, "standard_error": estimate.standard_error, "unit": estimate.unit}
        for estimate in fit.estimates
    }
    why = {
        f"{name}.standard_error": "the value lies on its bound or is below the sampling, so the data do not bound it"
        for name, estimate in estimates.items()
        if estimate["standard_error"] is None
    }
    if isinstance(fit.model, SecondOrderLag):
        why["time_constant_s"] = (
            "a second-order lag has none; mean_delay_s is the first-order lag of the same mean delay"
        )
    if fit.measured_delay_s is None:
        why["measured_delay_s"] = "the command does not rest at the start and for the last fifth of the record"
        why["measured_delay_error_s"] = why["measured_delay_s"]
    return {
        "model": fit.model.name,
        "time_constant_s": estimates.get("time_constant_s", {}).get("value"),
        "delay_s": fit.delay_s,
        "mean_delay_s": fit.mean_delay_s,
        "measured_delay_s": fit.measured_delay_s,
        "measured_delay_error_s": fit.measured_delay_error_s,
        "gain": fit.gain,
        "offset_N": fit.offset_N,
        "estimates": estimates,
        "r2": fit.r2,
        "r2_raw": fit.r2_raw,
        "r2_ceiling": fit.r2_ceiling,
        "residual_rms_N": fit.residual_rms_N,
        "average_s": fit.average_s,
        "window_s": list(fit.window_s),
        "models": [asdict(candidate) for candidate in fit.candidates],
        "why": why,
    }


def _rows(curve: ThrustCurve, supply_V: float, desired_N: Array, why: dict[str, str]) -> list[dict[str, float | None]]:
    delivered, pulse = curve.delivered_N(desired_N, supply_V), curve.pwm_us(desired_N, supply_V)
    missing = [None] * desired_N.size
    rpm = missing if "rpm" in why else curve.rpm(desired_N, supply_V).tolist()
    power = missing if "power_W" in why else curve.power_W(desired_N, supply_V).tolist()
    return [
        {"pwm_us": p, "thrust_N": t, "rpm": n, "power_W": w}
        for p, t, n, w in zip(pulse.tolist(), delivered.tolist(), rpm, power, strict=True)
    ]
