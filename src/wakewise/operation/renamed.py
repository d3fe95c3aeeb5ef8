"""What became of the fields of older scenarios: another name, or gone, and why."""

from __future__ import annotations

from collections.abc import Mapping

_EVIDENCE = "gone, gained nothing (docs/research-log/0014)"
_CONSTANT = "gone, a constant now"


def _moved(group: str, **names: str) -> dict[str, str]:
    return {f"tank.{old}": f"tank.{group}.{new}" for old, new in names.items()}


_SENSORS = [
    "pose_rate_hz",
    "pose_noise_m",
    "pose_noise_rad",
    "pose_latency_s",
    "pose_dropout",
    "pose_range_m",
    "pose_outages_s",
    "tracking_rate_hz",
    "tracking_noise_m",
    "tracking_latency_s",
    "imu_rate_hz",
    "gyro_noise_rad_s",
    "gyro_bias_rad_s",
    "accelerometer_noise_m_s2",
    "accelerometer_bias_m_s2",
    "depth_rate_hz",
    "depth_noise_m",
]
_MISMATCH = ["trim_N", "trim_range_N", "mass_pct", "damping_pct", "added_mass_pct", "thrust_pct"]
_PRIORS = [
    "gyro_bias_std_rad_s",
    "gyro_bias_walk_rad_s2",
    "accelerometer_bias_std_m_s2",
    "accelerometer_bias_walk_m_s3",
    "acceleration_noise_m_s2",
    "turning_noise_rad_s2",
    "gain_std",
    "drag_std",
    "inertia_std",
    "current_std_m_s",
    "lasting_s",
    "pose_slow_std_m",
    "pose_slow_std_rad",
    "pose_slow_s",
    "force_std_N",
    "force_walk_N",
    "moment_std_N_m",
    "moment_walk_N_m",
    "start_std_m",
    "start_std_rad",
    "start_std_m_s",
    "start_std_rad_s",
    "settle_s",
    "gate_patience",
]

RENAMED: Mapping[str, str] = {
    **_moved(
        "current",
        current_m_s="velocity_m_s",
        current_file="file",
        current_file_from_s="from_s",
        current_file_to_s="to_s",
        current_file_gain="gain",
        current_file_gap_s="gap_s",
        background_m_s="turbulence_m_s",
    ),
    **_moved("waves", wave_amplitude_m="amplitude_m", wave_period_s="period_s", wave_heading_deg="heading_deg"),
    **_moved(
        "pump", pump_speed_m_s="speed_m_s", pump_diameter_m="diameter_m", pump_at_m="at_m", pump_towards="towards"
    ),
    **_moved("jets", turbulence="turbulence", swirl="swirl", inflow_loss="inflow_loss"),
    **_moved(
        "silt",
        water="kind",
        silt="load_kg_m2",
        grain_m="grain_m",
        grain_density_kg_m3="grain_density_kg_m3",
        suspended_mg_l="suspended_mg_l",
        pickup="pickup",
        erosion_kg_m2_s="erosion_kg_m2_s",
        erosion_threshold_Pa="threshold_Pa",
    ),
    **_moved(
        "tether",
        tether_diameter_m="diameter_m",
        tether_length_m="length_m",
        tether_from_m="from_m",
        tether_at_B_m="at_B_m",
    ),
    **_moved("sensors", **{name: name for name in _SENSORS}),
    **_moved("mismatch", **{name: name for name in _MISMATCH}),
    "control.wake.sum": "control.superposition",
    "control.plan.superposition": "control.superposition",
    "control.plan.w_disturbance": "control.w_disturbance",
    "control.plan.w_effort": "control.w_effort",
    "control.plan.exposure_s": "imaging.exposure_s",
    "control.plan.edge_width_deg": "control.wake.edge_width_deg",
    "control.levers.incoherent": "control.superposition",
    "control.levers.tilt_deg": "control.plan.attitude_tolerance_rad",
}
"""Dotted names of older scenarios, and the fields that say the same now."""

GONE: Mapping[str, str] = {
    "tank.background_length_m": f"{_CONSTANT} (wakewise.simulation.tank.settings)",
    **dict.fromkeys((f"control.levers.{name}" for name in ("quiet", "quiet_gain", "quiet_lead_s")), _EVIDENCE),
    **dict.fromkeys((f"control.plan.{name}" for name in ("quiet_gain", "travel", "persistence")), _EVIDENCE),
    "control.levers.level_deg": "gone, 4 % for a camera 30 mm off its place (docs/research-log/0014)",
    **dict.fromkeys(
        (f"control.levers.{name}" for name in ("halo", "halo_points", "halo_m", "halo_weight")),
        "gone, drift does the same better (docs/research-log/0014)",
    ),
    **dict.fromkeys(
        (f"control.levers.bed_{name}" for name in ("points", "radius_m", "weight")),
        f"{_CONSTANT} (wakewise.control.levers)",
    ),
    **dict.fromkeys(
        (f"control.levers.drift_{name}" for name in ("s", "spread_m_s", "points", "weight")),
        "gone, jets follow the current themselves (wakewise.wake.advected_jets)",
    ),
    "control.w_previous": "gone, five times w_effort by argument (wakewise.control.settings)",
    **dict.fromkeys(
        (f"control.{name}" for name in ("estimator_lag_s", "gyro_lag_s", "integral_share")),
        f"{_CONSTANT} (wakewise.control.tracker)",
    ),
    "control.hold_s": f"{_CONSTANT} (wakewise.control.loop)",
    "control.plan.w_time": "gone, no mission asked for a transit of free duration",
    **dict.fromkeys(
        (
            f"control.plan.{name}"
            for name in [
                "plan_hz",
                "deadline_s",
                "rate_limit_N_s",
                "rho",
                "smooth_N",
                "clearance_m",
                "barrier_reach_m",
                "tolerance",
                "second_start_every",
            ]
        ),
        f"{_CONSTANT} (wakewise.planning.problem)",
    ),
    **dict.fromkeys(
        (f"estimation.{name}" for name in _PRIORS), "gone, taken for granted (wakewise.estimation.settings.Priors)"
    ),
    **dict.fromkeys(
        (f"tank.{name}" for name in ("plant_step_s", "max_parcels", "max_silt_particles")),
        f"{_CONSTANT} (wakewise.simulation.tank.settings)",
    ),
    **dict.fromkeys(
        (
            f"imaging.{name}"
            for name in [
                "port_glass_m",
                "port_index",
                "lamp_offset_m",
                "flakes_per_kg",
                "electrons_per_s",
                "read_noise_e",
            ]
        ),
        f"{_CONSTANT} (wakewise.vision.imaging.settings)",
    ),
    **dict.fromkeys(
        (
            f"reconstruction.{name}"
            for name in [
                "peak_threshold",
                "exhaustive_up_to",
                "sequence_overlap",
                "pose_neighbours",
                "bundle_iterations",
                "min_registered",
                "agreement_px",
                "random_seed",
            ]
        ),
        f"{_CONSTANT} (wakewise.vision.reconstruction)",
    ),
}
"""Dotted names of older scenarios that nothing says any more, and why."""

METHODS_GONE: Mapping[str, str] = {
    "planner": "gone: `wake-aware` with control.levers off",
    "planner-paper": "gone: `wakewise bench planner` has the paper's recipe",
}


def became(dotted: str, found: object = None) -> str | None:
    """What became of a field of an older scenario, such as "now tank.mismatch.trim_N"; None if it never was one.

    A name that has since become a group (`tank.silt`) is only old where something else than a group was `found` there.
    """
    if dotted == "method" and isinstance(found, str):
        return METHODS_GONE.get(found)
    if dotted in RENAMED:
        return None if isinstance(found, Mapping) else f"now {RENAMED[dotted]}"
    return GONE.get(dotted)
