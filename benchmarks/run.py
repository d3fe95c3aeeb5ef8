"""Speed and quality, side by side with a peer in the same run. Thread CPU, median and p99 after warm-up.

Prints a table, or with --json one object. Not part of the tests: figures depend on the machine.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.optimize import LinearConstraint, minimize

from wakewise.arrays import Array
from wakewise.control import Weights, compile_layout, gentle_allocation, pseudo_inverse
from wakewise.control.view import WakeView
from wakewise.geometry import Pose, look_at, quat_from_matrix
from wakewise.imaging import ImagingSettings, Scene, photograph
from wakewise.interfaces import BodyState
from wakewise.missions import MissionSettings, plan_route
from wakewise.tank import Tank, TankSettings
from wakewise.targets import coral, place_on_bed, sample_region
from wakewise.vehicles import compile_body, load_vehicle, step_rk4
from wakewise.wake import disturbance, gram, point_disturbance, wake_model

VEHICLE = load_vehicle("paper")
TARGET = place_on_bed("branching", coral("branching", 0), 1.5)
REGION = sample_region(TARGET, 300, np.random.default_rng(0))


def timed_us(work: Callable[[], Any], repeats: int) -> dict[str, float]:
    """Median and p99 of a call in microseconds of thread CPU, after a warm-up."""
    for _ in range(max(3, repeats // 20)):
        work()
    spans = np.empty(repeats)
    for k in range(repeats):
        began = time.thread_time_ns()
        work()
        spans[k] = (time.thread_time_ns() - began) / 1e3
    return {"median_us": float(np.median(spans)), "p99_us": float(np.percentile(spans, 99))}


def cases(count: int) -> list[tuple[Pose, Array]]:
    """Poses round the target that look at it, each with a wrench of station keeping."""
    rng = np.random.default_rng(1)
    drawn = []
    for _ in range(count):
        azimuth, elevation, reach = rng.uniform(0, 2 * np.pi), rng.uniform(0.3, 1.3), rng.uniform(0.5, 0.9)
        away = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), -np.sin(elevation)])
        eye = TARGET.centre_W_m + reach * away
        X_WB = Pose(eye, quat_from_matrix(look_at(eye, TARGET.centre_W_m)))
        drawn.append((X_WB, rng.normal(size=6) * [3, 3, 3, 0.2, 0.3, 0.3]))
    return drawn


def bench_disturbance() -> dict[str, Any]:
    """The Gram matrix of D against the sum over points in NumPy."""
    X_WB, _ = cases(1)[0]
    origins, axes = X_WB.apply(VEHICLE.thruster_positions_B_m), VEHICLE.thruster_axes_B @ X_WB.R.T
    thrusts = np.linspace(-3.0, 4.0, 8)
    place = (REGION.points_W_m, REGION.weights, origins, axes, VEHICLE.disk_areas_m2)
    result: dict[str, Any] = {}
    for name in ("paper", "jet"):
        model = wake_model(name)
        by_matrix = disturbance(gram(model, *place), thrusts)
        by_points = point_disturbance(model, *place, thrusts)
        result[name] = {
            "gram": timed_us(lambda model=model: gram(model, *place), 2000),
            "points_numpy": timed_us(lambda model=model: point_disturbance(model, *place, thrusts), 300),
            "gram_vs_points_rel_error": abs(by_matrix - by_points) / max(by_points, 1e-300),
        }
    return result


def bench_allocator() -> dict[str, Any]:
    """The exact allocation against SciPy's SLSQP from the pseudo-inverse, on the same problems; and what each costs."""
    layout = compile_layout(VEHICLE.allocation_matrix, VEHICLE.thrust_lower_N, VEHICLE.thrust_upper_N)
    view = WakeView.of(VEHICLE, REGION, wake_model("jet"))
    weights = Weights(disturbance=1.0 / view.total_weight, effort=1e-3)
    problems = [(view.gram(X_WB), wrench) for X_WB, wrench in cases(100)]

    def objective(T: Array, G: Array) -> float:
        return weights.disturbance * disturbance(G, T) + weights.effort * float(T @ T)

    def slsqp(G: Array, wrench: Array) -> Array:
        start = pseudo_inverse(layout.B, wrench, layout.lower_N, layout.upper_N).thrusts_N
        bounds = list(zip(layout.lower_N, layout.upper_N, strict=True))
        held = LinearConstraint(layout.B, layout.B @ start, layout.B @ start)
        found = minimize(objective, start, args=(G,), method="SLSQP", bounds=bounds, constraints=[held])
        return found.x if found.success else start

    ours = [gentle_allocation(layout, wrench, G, weights) for G, wrench in problems]
    pinv = [pseudo_inverse(layout.B, wrench, layout.lower_N, layout.upper_N).thrusts_N for _, wrench in problems]
    peer = [slsqp(G, wrench) for G, wrench in problems[:30]]
    values = np.array([objective(a.thrusts_N, G) for a, (G, _) in zip(ours, problems, strict=True)])
    values_pinv = np.array([objective(T, G) for T, (G, _) in zip(pinv, problems, strict=True)])
    values_peer = np.array([objective(T, G) for T, (G, _) in zip(peer, problems[:30], strict=True)])
    G, wrench = problems[0]
    return {
        "search": timed_us(lambda: gentle_allocation(layout, wrench, G, weights), 2000),
        "slsqp": timed_us(lambda: slsqp(G, wrench), 30),
        "pseudo_inverse": timed_us(lambda: pseudo_inverse(layout.B, wrench, layout.lower_N, layout.upper_N), 2000),
        "wrench_error_rel": float(
            max(
                np.linalg.norm(layout.B @ a.thrusts_N - w) / np.linalg.norm(w)
                for a, (_, w) in zip(ours, problems, strict=True)
            )
        ),
        "cost_over_pinv_median": float(np.median(values / values_pinv)),
        "slsqp_cost_over_ours_median": float(np.median(values_peer / values[:30])),
        "slsqp_cost_over_ours_max": float(np.max(values_peer / values[:30])),
    }


def bench_dynamics() -> dict[str, Any]:
    """One Runge-Kutta step of the vehicle."""
    body = compile_body(VEHICLE)
    p, q, nu = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]), np.array([0.1, 0.05, 0.0, 0.0, 0.1, 0.2])
    wrench, current = np.array([1.0, 0.0, 0.5, 0.0, 0.1, 0.0]), np.array([0.03, 0.02, 0.0])
    return {"step": timed_us(lambda: step_rk4(body, p, q, nu, wrench, current, 0.005), 5000)}


def bench_tank(seconds: float = 20.0) -> dict[str, Any]:
    """The world of a trial: eight thrusters at work over silt, everything measured at 10 Hz."""
    route = plan_route(TARGET.centre_W_m, MissionSettings())
    start = BodyState(X_WB=route.body(0.0, VEHICLE.X_BC).X_WB)
    tank = Tank(VEHICLE, TARGET, TankSettings(), start, np.random.default_rng(0))
    phases = np.arange(8)

    def run(duration_s: float) -> None:
        for k in range(round(duration_s / 0.02)):
            tank.step(0.7 * np.sin(0.3 * k * 0.02 + phases), 0.02)
            if k % 5 == 0:
                tank.measure()

    run(2.0)
    wall, cpu = time.perf_counter(), time.process_time()
    run(seconds)
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    return {"realtime_factor": seconds / wall, "cpu_s_per_s": cpu / seconds}


def bench_imaging() -> dict[str, Any]:
    """One photograph of the quick preset, clean water."""
    scene, settings = Scene.build(TARGET, 0), ImagingSettings()
    route = plan_route(TARGET.centre_W_m, MissionSettings())
    pose = route.X_WC_planned[0]
    rng = np.random.default_rng(0)
    photograph(scene, settings.camera(), [pose], None, settings, rng)
    wall, cpu = time.perf_counter(), time.process_time()
    for pose in route.X_WC_planned[:8]:
        photograph(scene, settings.camera(), [pose], None, settings, rng)
    return {
        "frame_s": (time.perf_counter() - wall) / 8,
        "frame_cpu_s": (time.process_time() - cpu) / 8,
        "pixels": settings.width * settings.height,
    }


BENCHES: dict[str, Callable[[], dict[str, Any]]] = {
    "disturbance": bench_disturbance,
    "allocator": bench_allocator,
    "dynamics": bench_dynamics,
    "tank": bench_tank,
    "imaging": bench_imaging,
}


def main() -> None:
    """Run the benches that were named, or all."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", help=f"any of {', '.join(BENCHES)}; all if none is named")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    chosen = parser.parse_args()
    unknown = set(chosen.names) - set(BENCHES)
    if unknown:
        parser.error(f"no bench called {', '.join(sorted(unknown))}; there are {', '.join(BENCHES)}")
    results = {name: BENCHES[name]() for name in chosen.names or BENCHES}
    if chosen.json:
        print(json.dumps(results, indent=2))
        return
    for name, result in results.items():
        print(f"\n{name}")
        _show(result, "  ")


def _show(result: dict[str, Any], indent: str) -> None:
    for key, value in result.items():
        if isinstance(value, dict) and "median_us" in value:
            print(f"{indent}{key:<34}{value['median_us']:>10.1f} us   p99 {value['p99_us']:.1f} us")
        elif isinstance(value, dict):
            print(f"{indent}{key}")
            _show(value, indent + "  ")
        else:
            print(f"{indent}{key:<34}{value:>10.4g}")


if __name__ == "__main__":
    main()
