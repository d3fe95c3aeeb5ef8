"""The exact allocation against SciPy's SLSQP from the pseudo-inverse, on the same problems; and what each costs."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.optimize import LinearConstraint, minimize

from wakewise.arrays import Array
from wakewise.control import Weights, compile_layout, gentle_allocation, pseudo_inverse
from wakewise.control.view import WakeView
from wakewise.experiments.benches.cases import REGION, VEHICLE, cases
from wakewise.experiments.benches.timing import BenchOptions, timed_us
from wakewise.wake import disturbance, wake_model


def run(options: BenchOptions) -> dict[str, Any]:
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
