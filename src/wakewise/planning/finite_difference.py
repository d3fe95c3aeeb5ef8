"""D of a wake model that the kernels do not know, added to a horizon that they rolled out without it."""

from __future__ import annotations

from wakewise.core.geometry import Pose
from wakewise.core.interfaces import WakeModel
from wakewise.planning.kernels import PlanWork
from wakewise.planning.problem import SMOOTH_N, PlanTerms
from wakewise.robot.vehicles import Vehicle
from wakewise.scene.targets import Region
from wakewise.wake.finite_difference import FiniteDifferenceWake, thinned


def numeric_wake(wake: WakeModel, region: Region, vehicle: Vehicle, terms: PlanTerms) -> FiniteDifferenceWake:
    """A wake model without kernels, over some of the region's points; weights add up to 1 as in `wake_table`."""
    points, weights = thinned(region.points_W_m, region.weights)
    return FiniteDifferenceWake(
        model=wake,
        points_W_m=points,
        weights=weights / float(weights.sum()),
        positions_B_m=vehicle.thruster_positions_B_m,
        axes_B=vehicle.thruster_axes_B,
        areas_m2=vehicle.disk_areas_m2,
        coherent=terms.superposition == "coherent",
        smooth_N=SMOOTH_N,
    )


def add_numeric(wake: FiniteDifferenceWake, weight: float, majorise: float, work: PlanWork, *, slopes: bool) -> float:
    """Add `weight` times D of every stage to the work of `wakewise.planning.kernels.horizon`; returns their sum.

    With `slopes` also its derivatives, the block thrust by thrust times `majorise`.
    """
    for k, thrusts in enumerate(work.T):
        X_WB = Pose(work.X[k, :3], work.X[k, 3:7])
        if not slopes:
            work.D[k] = wake.value(X_WB, thrusts)
            continue
        work.D[k], gradient, H = wake.stage(X_WB, thrusts)
        work.gx[k, :6] += weight * gradient[:6]
        work.gT[k] += weight * gradient[6:]
        work.Q[k] += weight * H[:6, :6]
        work.S[k] += weight * H[6:, :6]
        work.R[k] += majorise * weight * H[6:, 6:]
    total = weight * float(work.D.sum())
    work.parts[0] += total
    return total
