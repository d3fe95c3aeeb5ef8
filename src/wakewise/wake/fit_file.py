"""Calibrated wake models as files: settings that a scenario takes, with their uncertainty as comments."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from wakewise.core.errors import InputError
from wakewise.core.files import write_text
from wakewise.core.safe_yaml import YamlError, read_yaml
from wakewise.core.settings import describe_faults
from wakewise.wake.calibration import MomentumLaw, WakeCalibration
from wakewise.wake.models import WakeSettings


def fit_yaml(fit: WakeCalibration, source: str, disk_diameter_m: float, law: MomentumLaw | None = None) -> str:
    """YAML text with the fields of `WakeSettings` where a scenario has them, and the quality of the fit as comments."""
    scores = ((f"R2 in region {name}, test", value) for name, value in _tested(fit))
    lines = [
        f"# Wake model calibrated on {source}, disk diameter {disk_diameter_m:g} m.",
        f"# Split: {fit.split}.",
        *(f"# {name}: {'not known' if value is None else f'{value:.3f}'}" for name, value in scores),
        *([] if law is None else [f"# Momentum flux over thrust: {law.words}."]),
        *(f"# Note: {warning}." for warning in fit.warnings),
        "# A scenario as it stands: wakewise scan THIS_FILE; or put these lines into one of your own.",
        "control:",
        "  wake:",
        f"    model: {fit.family.name}",
    ]
    for k, (name, value) in enumerate(fit.parameters.items()):
        error, low, high = fit.standard_errors[k], fit.lows[k], fit.highs[k]
        words = "held" if name in fit.held else "" if not np.isfinite(error) else f"+- {error:.2g}"
        words += f", 95 % of resamples {low:.4g} to {high:.4g}" if np.isfinite(low) else ""
        lines.append(f"    {name}: {value:.6g}" + (f"  # {words}" if words else ""))
    return "\n".join(lines) + "\n"


def write_fit(
    path: Path, fit: WakeCalibration, source: str, disk_diameter_m: float, law: MomentumLaw | None = None
) -> None:
    """Write a calibrated model whole or not at all."""
    write_text(path, fit_yaml(fit, source, disk_diameter_m, law))


def read_wake_settings(path: Path) -> WakeSettings:
    """Settings of a wake model from a file of `wakewise wake fit`, with or without the heads `control:` and `wake:`.

    Raises InputError if the file cannot be read or a field is wrong.
    """
    try:
        tree: Any = read_yaml(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError):
        raise InputError(f"{path}: cannot be read as text, a file of `wakewise wake fit` is needed") from None
    except YamlError as fault:
        raise InputError(f"{path}: not YAML ({fault})") from None
    for head in ("control", "wake"):
        if isinstance(tree, dict) and set(tree) == {head}:
            tree = tree[head]
    try:
        return WakeSettings.model_validate(tree)
    except ValidationError as fault:
        raise InputError(f"{path}: {describe_faults(fault, WakeSettings, 'wake')}") from None


def fit_figures(fit: WakeCalibration) -> dict[str, Any]:
    """A calibration as plain values, ready for JSON; what is not known is None."""

    def known(value: float) -> float | None:
        return float(value) if np.isfinite(value) else None

    return {
        "model": fit.family.name,
        "parameters": {
            name: {
                "value": value,
                "standard_error": known(fit.standard_errors[k]),
                "low": known(fit.lows[k]),
                "high": known(fit.highs[k]),
                "held": name in fit.held,
            }
            for k, (name, value) in enumerate(fit.parameters.items())
        },
        "train": fit.train.plain(),
        "test": fit.test.plain(),
        "train_thrusts_N": list(fit.train_thrusts_N),
        "test_thrusts_N": list(fit.test_thrusts_N),
        "split": fit.split,
        "residual_rms_m_s": fit.residual_rms_m_s,
        "warnings": list(fit.warnings),
    }


def _tested(fit: WakeCalibration) -> tuple[tuple[str, float | None], ...]:
    return ("A (|theta| < 15 deg, 0.1-0.3 m)", fit.test.r2_core), ("B (|theta| < 30 deg, 0.1-0.5 m)", fit.test.r2_wake)
