"""Vehicles, thrusters, mixers, logs and navigation against published tables, public programs and recordings."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.core.interfaces import Progress
from wakewise.robot.importers import import_vehicle
from wakewise.robot.thrusters.lag_fit import identify_lag
from wakewise.robot.thrusters.thrust_table import KGF_N, library_curve
from wakewise.robot.vehicles import ARDUSUB_VECTORED_6DOF, allocation_rank, load_vehicle, mixing_disagreements
from wakewise.simulation.water import read_current_series
from wakewise_ardusub.logs.read import read_log
from wakewise_benchmarks.dynamics import oracle_figures
from wakewise_benchmarks.estimator import dead_reckoning_drifts
from wakewise_benchmarks.truth_records import Asked, Part

VOLTAGES = (10.0, 12.0, 14.0, 16.0, 20.0)
STEP_COMMAND_S, STEP_END_S = 3.449, 12.0
"""When the command of the measured step begins, by its authors' script, and the end of its steady part."""

LEVEL_M = 0.085
"""Height of the BlueROV2 Heavy's horizontal thrusters in its file: ArduSub's mixer takes them to be level with it."""


def maker_table(path: Path) -> Array:
    """The maker's rows, shape (n, 5): supply voltage, pulse in us, thrust in N, rpm, power in W.

    Raises InputError if a column is missing or a cell is no number.
    """
    columns = ("supply_V_sheet", "pwm_us", "force_kgf", "rpm", "power_W")
    with path.open(encoding="utf-8") as file:
        try:
            rows = [[float(row[name]) for name in columns] for row in csv.DictReader(file)]
        except (KeyError, TypeError, ValueError) as fault:
            raise InputError(f"{path}: not the maker's table, needs numbers under {', '.join(columns)}") from fault
    if not rows:
        raise InputError(f"{path}: holds no rows")
    return np.array(rows) * [1.0, 1.0, KGF_N, 1.0, 1.0]


def thrust_figures(folder: Path, progress: Progress) -> dict[str, float]:
    """The shipped T200 curve against the maker's table: worst voltage of five."""
    maker, curve = maker_table(folder / "t200_all_voltages.csv"), library_curve("t200")
    found: dict[str, list[float]] = {"thrust_N": [], "rpm_pct": [], "power_pct": [], "pulse_us": [], "deadband_us": []}
    for k, voltage in enumerate(VOLTAGES):
        progress(k, len(VOLTAGES), f"T200 at {voltage:g} V")
        _, pulse, thrust, rpm, power = maker[maker[:, 0] == voltage].T
        runs, silent = thrust != 0.0, pulse[thrust == 0.0]
        found["thrust_N"].append(_rms(curve.thrust_N(pulse, voltage) - thrust))
        found["rpm_pct"].append(100 * _rms(np.abs(curve.rpm(thrust, voltage)) - rpm) / rpm.max())
        found["power_pct"].append(100 * _rms(curve.power_W(thrust, voltage) - power) / power.max())
        found["pulse_us"].append(_rms(curve.pwm_us(thrust[runs], voltage) - pulse[runs]))
        ends = np.array(curve.deadband_us(voltage)) - (silent.min(), silent.max())
        found["deadband_us"].append(float(np.abs(ends).max()))
    return {key: max(values) for key, values in found.items()}


def lag_figures(folder: Path, _: Progress) -> dict[str, float]:
    """The fitted lag against a measured step of 2 V."""
    table = np.loadtxt(folder / "2statep2V.csv", delimiter=",", usecols=(1, 15))
    time, thrust = table[:, 0], -table[:, 1]
    kept = time <= STEP_END_S
    fit = identify_lag(time[kept], (time[kept] >= STEP_COMMAND_S).astype(float), thrust[kept])
    return {"r2": fit.r2, "blade_s": fit.average_s}


def dynamics_figures(folder: Path, _: Progress) -> dict[str, float | None]:
    """Accelerations of 200 states against three public programs."""
    found: float | None = oracle_figures(folder.parent)["oracle_rel_error_max"]
    return {"rel_error": found}


def ardusub_figures(folder: Path, _: Progress) -> dict[str, float]:
    """The motor factors of ArduSub, and a telemetry log with bad records."""
    path = folder / "ardusub_vectored_6dof_mixing.csv"
    rows = list(csv.reader(line for line in path.read_text("utf-8").splitlines() if not line.startswith("#")))
    stated = np.array([[float(value) for value in row[1:]] for row in rows[1:]])
    if stated.shape != ARDUSUB_VECTORED_6DOF.shape:
        raise InputError(f"{path}: a table of {stated.shape}, needs {ARDUSUB_VECTORED_6DOF.shape}")
    figures = {
        "factors": float(np.abs(stated - ARDUSUB_VECTORED_6DOF).max()),
        "signs": float(len(mixing_disagreements(load_vehicle("bluerov2-heavy"), stated, LEVEL_M))),
    }
    log = read_log(folder / "2023-04-18.tlog")
    return figures | {"bad_records": float(log.bad_records)}


def doppler_figures(folder: Path, _: Progress) -> dict[str, float | None]:
    """Drift of dead reckoning on real Doppler logs, of the distance run."""
    drifts = dead_reckoning_drifts(folder.parent)
    if not drifts:
        raise InputError(f"{folder}: holds no Trajectory folders")
    return {"median_pct": float(np.median(drifts)), "worst_pct": max(drifts), "legs": float(len(drifts))}


def current_figures(folder: Path, _: Progress) -> dict[str, float]:
    """The first two readings of a tidal station, as the file has them and as the water flows."""
    path = folder / "s08010.json"
    stated = json.loads(path.read_text("utf-8"))
    times = sorted(int(key) for key in stated["s"])[:2]
    series = read_current_series(path, stop_s=3000.0)
    worst = 0.0
    for k, key in enumerate(map(str, times)):
        towards = np.radians(float(stated["d"][key]))
        true = 0.01 * float(stated["s"][key]) * np.array([np.cos(towards), np.sin(towards)])
        found = series.velocity(np.zeros((1, 3)), 1e-3 * (times[k] - times[0]))[0, :2]
        worst = max(worst, float(np.linalg.norm(found - true)))
    return {"current_m_s": worst}


def model_figures(folder: Path, _: Progress) -> dict[str, float]:
    """Allocation matrices from vehicle descriptions against those that their projects ship, and their ranks."""
    matrix = folder / "rexrov" / "uuv_control" / "uuv_thruster_manager" / "config" / "rexrov" / "TAM.yaml"
    robot = folder / "rexrov" / "uuv_descriptions" / "robots" / "rexrov_default.xacro"
    rexrov = import_vehicle(robot, matrix=matrix, skip_missing=True)
    if rexrov.shipped_matrix is None:
        raise InputError(f"{matrix}: no matrix was read")
    orca = import_vehicle(folder / "vortex_orca" / "orca.yaml")
    models = folder / "bluerov2_gz" / "models"
    heavy, six = (import_vehicle(models / name / "model.sdf") for name in ("bluerov2_heavy", "bluerov2"))
    return {
        "matrix": float(np.abs(rexrov.allocation_matrix - rexrov.shipped_matrix).max()),
        "orca": float(allocation_rank(orca)),
        "heavy": float(allocation_rank(heavy)),
        "six": float(allocation_rank(six)),
    }


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


_BAR = "bound of the package's own test"
PARTS = (
    Part(
        name="dynamics",
        source="three public implementations of Fossen's equations (von Benzon's parameters)",
        asked=(
            Asked(
                key="rel_error",
                what="6-DOF accelerations of 200 states: largest error over the largest component",
                high=1e-9,
                how=_BAR,
            ),
        ),
        compute=dynamics_figures,
    ),
    Part(
        name="thruster_t200",
        source="Blue Robotics, September 2019",
        asked=(
            Asked(key="thrust_N", what="T200 thrust: rms at the worst of 5 voltages", unit="N", high=0.3, how=_BAR),
            Asked(key="rpm_pct", what="T200 speed: rms of full, worst voltage", unit="%", high=1.0, how=_BAR),
            Asked(key="power_pct", what="T200 power: rms of full, worst voltage", unit="%", high=1.0, how=_BAR),
            Asked(key="pulse_us", what="T200 pulse from thrust: rms, worst voltage", unit="us", high=4.0, how=_BAR),
            Asked(key="deadband_us", what="T200 dead band: largest error of an end", unit="us", high=0.0, how=_BAR),
        ),
        compute=thrust_figures,
    ),
    Part(
        name="thruster_steps",
        source="National Geographic Exploration Technology Lab, load cell at 1 kHz",
        asked=(
            Asked(key="r2", what="thruster lag: R2 of the fit to a step of 2 V", low=0.95, how=_BAR),
            Asked(
                key="blade_s",
                what="thruster lag: passing time of a blade found in the force",
                unit="s",
                low=0.95 * 0.03532,
                high=1.05 * 0.03532,
                how="three blades at the measured 59.3 rad/s, within 5 %",
            ),
        ),
        compute=lag_figures,
    ),
    Part(
        name="ardusub",
        source="ArduPilot's AP_Motors6DOF; a BlueROV2 Heavy's telemetry log (C. McQueen)",
        asked=(
            Asked(key="factors", what="48 motor factors of vectored_6dof: largest difference", high=0.0, how=_BAR),
            Asked(key="signs", what="motor factors against the BlueROV2 Heavy's geometry: disagreements", high=0.0,
                  how=_BAR),
            Asked(
                key="bad_records",
                what="bad records found in the telemetry log",
                low=1967.0,
                high=1967.0,
                how="the count of pymavlink, as stated with the log",
            ),
        ),
        compute=ardusub_figures,
    ),
    Part(
        name="auv_dvl",
        source="Snapir AUV, Cohen and Klein 2025; truth by Delph INS",
        asked=(
            Asked(key="median_pct", what="dead reckoning with a Doppler log: median drift of the distance", unit="%",
                  high=1.0, how=_BAR),
            Asked(key="worst_pct", what="dead reckoning with a Doppler log: worst drift of seven legs", unit="%",
                  high=2.0, how=_BAR),
        ),
        compute=doppler_figures,
    ),
    Part(
        name="currents",
        source="NOAA station s08010, Southampton Shoal",
        asked=(
            Asked(key="current_m_s", what="tidal current at the first two readings: largest difference", unit="m/s",
                  high=1e-6, how="rounding"),
        ),
        compute=current_figures,
    ),
    Part(
        name="vehicle_models",
        source="uuv_simulator, bluerov2_gz, vortex-auv",
        asked=(
            Asked(key="matrix", what="RexROV's matrix from its description against the shipped one", high=1e-6,
                  how=_BAR),
            Asked(key="orca", what="rank of Orca's matrix (8 thrusters)", low=6.0, high=6.0,
                  how="stated with the file"),
            Asked(key="heavy", what="rank of the BlueROV2 Heavy's matrix (8 thrusters)", low=6.0, high=6.0,
                  how="fully actuated by its maker"),
            Asked(key="six", what="rank of the BlueROV2's matrix (6 thrusters)", low=5.0, high=5.0,
                  how="its maker's vehicle has no pitch"),
        ),
        compute=model_figures,
    ),
)  # fmt: skip
