"""The figures of a trial: what each is called, its unit, its definition, and how they are gathered and compared.

What to hold a flight's figures against: the water without it, thrusts shared out as `dp` does, grains that move.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
import polars as pl

from wakewise.allocation import disturbance_of, min_norm_allocation
from wakewise.control import vehicle_layout
from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose
from wakewise.operation import Parts
from wakewise.simulation.tank import TankSettings, tank_ambient
from wakewise.simulation.tank.grains import threshold_stress_Pa
from wakewise.vision.evaluation import SURFACE_DEFINITIONS
from wakewise.wake import InfluenceModel

Figures = dict[str, Any]

Better = Literal["less", "more", "none"]

_SURFACE_BETTER: dict[str, Better] = {
    "accuracy_p90_mm": "less", "completeness_visible_1mm_pct": "more", "completeness_visible_2mm_pct": "more",
    "visible_pct": "more", "icp_displacement_mm": "less", "icp_matched_pct": "more", "outside_pct": "none",
}  # fmt: skip

# key: (unit, definition, which side is better). The order is that of tables. Target speeds are the excess over the flow
# without thrusters. "none": the figure says what was flown or how it was measured, and neither side is better.
_FIGURES: dict[str, tuple[str, str, Better]] = {
    "method": ("", "how thrusts were chosen", "none"),
    "seed": ("", "every random draw of the trial follows from it", "none"),
    "success": ("", "rmse_mm < 3 and completeness_pct > 85", "more"),
    "rmse_mm": ("mm", "root mean square distance from the reconstructed cloud, thinned to 0.8 mm, to the true surface, "
                "each distance capped at rmse_cap_mm; only what stands 10 mm or more above the bed counts", "less"),
    "rmse_cap_mm": ("mm", "cap on a single distance in rmse_mm", "none"),
    "accuracy_median_mm": ("mm", "median distance from the cloud to the true surface", "less"),
    "completeness_pct": ("%", "share of the true surface with a cloud point within 3 mm, over samples spread evenly by "
                         "area", "more"),
    "completeness_visible_pct": ("%", "the same, over surface seen by at least three photographs", "more"),
    "completeness_1mm_pct": ("%", "share of the true surface with a cloud point within 1 mm", "more"),
    "completeness_2mm_pct": ("%", "share of the true surface with a cloud point within 2 mm", "more"),
    "rmse_mean_shape_mm": ("mm", "rmse_mm against the mean over the exposures of the shapes in which a target that "
                           "yields was photographed, instead of its shape at rest in still water", "less"),
    "f_score": ("%", "harmonic mean of precision and recall at 3 mm (Tanks and Temples), 0 to 100", "more"),
    **{key: (*SURFACE_DEFINITIONS[key], better) for key, better in _SURFACE_BETTER.items()},
    "coverage_predicted_pct": ("%", "completeness_pct as the coverage guide expects it before leaving: share of the "
                               "target, as it was surveyed or mapped in flight, that photographs saw well from where "
                               "they were estimated", "more"),
    "coverage_sure_pct": ("%", "the same with a photograph to spare: the lower end of what is expected", "more"),
    "coverage_agreement_pct": ("%", "share of the target's patches, of about 1 cm, of which the guide said rightly "
                               "whether most of it is within 3 mm of the model", "more"),
    "coverage_trivial_pct": ("%", "the same of the better of two guesses without a guide: all of it, or nothing",
                             "none"),
    "scale_error_pct": ("%", "by how much the model is too large, less than 0: too small; from the spread of its "
                        "camera centres against the true ones", "none"),
    "rmse_scaled_mm": ("mm", "rmse_mm of the model brought to the truth's place and size by the true camera centres",
                       "less"),
    "images": ("", "photographs taken", "none"),
    "registered_images": ("", "photographs that found their place in the model", "more"),
    "features_per_image": ("", "mean number of SIFT keypoints in a photograph", "more"),
    "inlier_matches": ("", "feature matches that passed two-view geometry, summed over pairs", "more"),
    "mapping": ("", "how cameras were found: from known poses (the vehicle's, triangulated and adjusted), or from the "
                "photographs alone, as where the poses did not fit (photo by photo, all photos at once)", "none"),
    "reprojection_px": ("px", "mean reprojection error of the sparse model", "less"),
    "cameras_rmse_mm": ("mm", "rms distance of reconstructed camera centres from the vehicle's estimates, aligned",
                        "less"),
    "target_speed_mean_m_s": ("m/s", "water speed at the target's surface, excess over the flow without the vehicle, "
                              "mean over surface and time from the first leg on", "less"),
    "target_speed_p95_m_s": ("m/s", "95th percentile over the surface of the same, mean over time", "less"),
    "exposure_speed_mean_m_s": ("m/s", "target_speed_mean_m_s while the shutter is open", "less"),
    "exceedance_1cm_s_pct": ("%", "share of the target's surface, and of time, where that excess is more than 1 cm/s",
                             "less"),
    "exceedance_ambient_pct": ("%", "the same where it is more than the water's own mean speed there without the "
                               "vehicle", "less"),
    "exposure_exceedance_1cm_s_pct": ("%", "exceedance_1cm_s_pct while the shutter is open", "less"),
    "bed_speed_p95_m_s": ("m/s", "95th percentile of the excess speed just above the bed within 0.3 m of the target, "
                          "mean over time", "less"),
    "turbidity_mean_per_m": ("1/m", "beam attenuation by silt around the target, mean over time", "less"),
    "exposure_speed_p95_m_s": ("m/s", "target_speed_p95_m_s while the shutter is open", "less"),
    "target_pressure_mean_Pa": ("Pa", "dynamic pressure of the whole water, currents included, at the target's "
                                "surface, mean over surface and time", "less"),
    "target_pressure_p95_Pa": ("Pa", "95th percentile over the surface of the same, mean over time", "less"),
    "exposure_pressure_mean_Pa": ("Pa", "target_pressure_mean_Pa while the shutter is open", "less"),
    "exposure_pressure_p95_Pa": ("Pa", "target_pressure_p95_Pa while the shutter is open", "less"),
    "bed_shear_p95_Pa": ("Pa", "95th percentile of the stress of the whole water on the bed within 0.3 m of the "
                         "target, mean over time", "less"),
    "bed_over_threshold_pct": ("%", "share of the bed within 0.2 m of the vertical through the target's centre, and of "
                               "time, where the stress of the whole water moves grains", "less"),
    "bed_over_threshold_s": ("s", "time in which grains move anywhere on that part of the bed", "less"),
    "tracer_speed_mean_m_s": ("m/s", "speed of tracers at the target's surface over 1/30 s, as PIV would see the whole "
                              "water, mean over surface and time", "less"),
    "ray_optical_depth": ("", "beam attenuation by silt along the rays from camera to target, end to end, mean over "
                          "rays and time", "less"),
    "exposure_optical_depth": ("", "ray_optical_depth while the shutter is open", "less"),
    "silt_lifted_g": ("g", "what the bed gave up by the end of the flight, settled again or not; sand at every hop",
                      "less"),
    "silt_suspended_max_g": ("g", "most silt in the water at any time of the flight", "less"),
    "sway_rms_mm": ("mm", "rms way of the target's surface from its shape at rest in still water, sliding not counted, "
                    "while the shutter is open", "less"),
    "sway_wash_mm": ("mm", "rms way of the target's surface from where the same water without the vehicle would have "
                     "it, while the shutter is open: what of the sway is the wash's", "less"),
    "sway_peak_mm": ("mm", "largest way of any place of the surface from there at any time", "less"),
    "sway_mean_mm": ("mm", "how far the mean of the surface is from its place at rest, mean over the exposures: the "
                     "steady part of the sway", "less"),
    "sway_about_mean_mm": ("mm", "rms over the exposures of how far the mean of the surface is from that mean place: "
                           "the part by which photographs disagree", "less"),
    "target_stress_peak_Pa": ("Pa", "largest stress in the target's tissue by bending, at any time", "less"),
    "target_drag_peak_N": ("N", "largest drag of the water on the whole of a target that yields, at any time", "less"),
    "shifted_mm": ("mm", "how far a target that lies loose has slid by the end of the flight", "less"),
    "disturbance": ("m2/s2", "D as the controller's wake model sees it, over the points that its method watches, mean "
                    "over time; methods that watch other points cannot be compared by it", "none"),
    "disturbance_flown": ("m2/s2", "D of the commanded thrusts at the estimated poses, by the settings' wake model "
                          "over the target's own points whatever the method watches, mean over time; a model's "
                          "estimate, nothing measured", "less"),
    "disturbance_least_thrusts": ("m2/s2", "the same, had each of these wrenches been made with the least thrusts, as "
                                  "dp shares them out", "none"),
    "ambient_speed_m_s": ("m/s", "speed of the water's own motion (current, waves, pump, turbulence) at the target's "
                          "surface without thrusters or target, mean over surface and time", "none"),
    "grain_threshold_Pa": ("Pa", "bed shear stress from which the scenario's loose grains move", "none"),
    "position_rmse_mm": ("mm", "distance of the true vehicle from where it was desired to be", "less"),
    "path_rmse_mm": ("mm", "distance of the true vehicle from the nearest point of the desired path", "less"),
    "estimate_rmse_mm": ("mm", "distance of the estimated vehicle from the true one", "less"),
    "velocity_deviation_pct": ("%", "rms difference of true and desired velocity over the rms of the latter", "less"),
    "roll_pitch_rms_deg": ("deg", "rms error in roll and pitch", "less"),
    "roll_pitch_max_deg": ("deg", "largest error in roll or pitch at any step", "less"),
    "attitude_rmse_deg": ("deg", "rms angle between true and desired attitude", "less"),
    "energy_kJ": ("kJ", "electrical energy of the thrusters", "less"),
    "sign_flips_per_s": ("1/s", "reversals of thrust, all thrusters together, per second", "less"),
    "duration_s": ("s", "length of the flight from the first leg on; what comes before, settling, is in no figure",
                   "none"),
    "solve_ms_median": ("ms", "thread CPU time of one control step, median", "less"),
    "solve_ms_p99": ("ms", "thread CPU time of one control step, 99th percentile", "less"),
    "fallbacks": ("", "control steps whose answer was not the method's own, or fell short of the wrench asked for",
                  "less"),
    "collisions": ("", "times the hull touched floor, walls or target", "less"),
    "wall_s": ("s", "time from start to figures, all sittings", "less"),
    "cpu_s": ("s", "CPU time of the same, all threads", "less"),
}  # fmt: skip

UNITS = {key: unit for key, (unit, _, _) in _FIGURES.items()}
DEFINITIONS = {key: text for key, (_, text, _) in _FIGURES.items()}
BETTER: dict[str, Better] = {key: better for key, (_, _, better) in _FIGURES.items()}
"""Which side of a figure is better; "none" where neither is."""

# Ratio of two trials, named as in tables, and the figure it is taken from.
_RATIOS = {
    "target_speed": "target_speed_mean_m_s",
    "exposure_speed": "exposure_speed_mean_m_s",
    "disturbance_flown": "disturbance_flown",
    "rmse": "rmse_mm",
    "energy": "energy_kJ",
    "position_rmse": "position_rmse_mm",
}


@dataclass
class MetricsCollector:
    """Figures as the stages hand them in; those that no stage could compute get a reason."""

    figures: Figures = field(default_factory=dict)
    reasons: dict[str, str] = field(default_factory=dict)

    def add(self, figures: Figures) -> None:
        """Take in figures of a stage."""
        self.figures.update(figures)

    def missing(self, keys: tuple[str, ...], reason: str) -> None:
        """Say why these could not be computed."""
        self.reasons.update(dict.fromkeys(keys, reason))

    def finish(self) -> Figures:
        """All figures in order; null ones have their reason under `why`, every one its unit and definition."""
        result: Figures = {key: self.figures.get(key) for key in _FIGURES}
        result |= {key: value for key, value in self.figures.items() if key not in _FIGURES}
        why = {
            key: self.reasons.get(key, "nothing in this trial measured it")
            for key, value in result.items()
            if value is None
        }
        return result | {"why": why, "units": UNITS, "definitions": DEFINITIONS}


def comparison(methods: dict[str, Figures]) -> Figures:
    """Trials side by side, and ratios of each to the first: null with a reason where a figure is missing or zero."""
    first = next(iter(methods.values()))
    ratios: dict[str, Figures] = {}
    for name, figures in methods.items():
        ratio: Figures = {}
        why: dict[str, str] = {}
        for short, key in _RATIOS.items():
            value, base = figures.get(key), first.get(key)
            if value is None or base is None:
                ratio[short], why[short] = None, f"{key} is missing"
            elif base == 0:
                ratio[short], why[short] = None, f"{key} of the first method is zero"
            else:
                ratio[short] = value / base
        ratios[name] = ratio | ({"why": why} if why else {})
    return {"methods": methods, "ratios": ratios}


INSTANTS = 400
"""At most so many control steps, spread evenly over the flight, are shared out anew."""
LOOKS = 200
"""Instants at which the water's own motion is looked at."""


def add_reference_values(gathering: MetricsCollector, parts: Parts, steps: pl.DataFrame) -> None:
    """Add disturbance_flown, disturbance_least_thrusts, ambient_speed_m_s and grain_threshold_Pa, or why there is none.

    `steps` is the table of steps.parquet from the first leg on.
    """
    try:
        gathering.add(allocation_figures(parts, steps))
    except InputError as fault:
        gathering.missing(("disturbance_flown", "disturbance_least_thrusts"), str(fault))
    gathering.add({"ambient_speed_m_s": ambient_speed_m_s(parts, steps["time_s"].to_numpy())})
    threshold = grain_threshold_Pa(parts.scenario.tank)
    gathering.add({"grain_threshold_Pa": threshold})
    if threshold is None:
        no_grains = ("grain_threshold_Pa", "bed_over_threshold_pct", "bed_over_threshold_s")
        gathering.missing(no_grains, "neither bed nor water holds loose grains (tank.silt)")


def allocation_figures(parts: Parts, steps: pl.DataFrame) -> Figures:
    """Mean D of the thrusts commanded, and of the least thrusts that make the same wrenches from the same poses.

    Both by the wake model of `scenario.control.wake` over the target's own points, at the estimated poses.

    Raises InputError if the table lacks a command or an estimate.
    """
    vehicle = parts.vehicle
    commands = [f"command_{i + 1}_N" for i in range(len(vehicle.thrusters))]
    places, turns = [f"est_{a}_m" for a in "xyz"], [f"est_q{a}" for a in "wxyz"]
    lost = [name for name in (*commands, *places, *turns) if name not in steps.columns]
    if lost:
        raise InputError(f"steps: no column {lost[0]}, needs commands and estimates of every step")
    picks = np.unique(np.linspace(0, steps.height - 1, min(INSTANTS, steps.height)).astype(int))
    some = steps[picks]
    thrusts, p, q = (some.select(names).to_numpy().astype(np.float64) for names in (commands, places, turns))
    known = np.isfinite(np.column_stack([thrusts, p, q])).all(axis=1)
    if not known.any():
        raise InputError("steps: no step has both a command and an estimate")
    view = InfluenceModel.of(vehicle, parts.region, parts.wake, parts.scenario.control.superposition)
    layout = vehicle_layout(vehicle)
    flown, least = [], []
    for T, place, turn in zip(thrusts[known], p[known], q[known], strict=True):
        G = view.gram(Pose(place, turn))
        shared = min_norm_allocation(layout, layout.B @ T).thrusts_N
        flown.append(disturbance_of(G, T))
        least.append(disturbance_of(G, shared))
    return {"disturbance_flown": float(np.mean(flown)), "disturbance_least_thrusts": float(np.mean(least))}


def ambient_speed_m_s(parts: Parts, time_s: Array) -> float:
    """Mean speed of the water's own motion over the surface points of a region and the times of a flight."""
    region = parts.region
    surface = region.points_W_m[region.distance_m <= 0.0]
    points = surface if len(surface) else region.points_W_m
    ambient = tank_ambient(parts.scenario.tank, parts.seeds.tank())
    when = np.linspace(float(time_s[0]), min(float(time_s[-1]), ambient.end_s), LOOKS)
    return float(np.mean([np.linalg.norm(ambient.velocity(points, float(t)), axis=1).mean() for t in when]))


def grain_threshold_Pa(tank: TankSettings) -> float | None:
    """Stress from which the bed's grains move, as the tank itself takes it; None where there are no grains."""
    silt = tank.silt
    if silt.load_kg_m2 == 0.0 and silt.suspended_mg_l == 0.0:
        return None
    if silt.threshold_Pa is not None:
        return silt.threshold_Pa
    return threshold_stress_Pa(silt.grain_m, silt.grain_density_kg_m3, tank.density_kg_m3)
