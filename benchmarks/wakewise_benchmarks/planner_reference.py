"""IPOPT on the planner's own objective: what a plan's quality is held against. Needs casadi, a development
dependency.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

import numpy as np

from wakewise.core.arrays import Array
from wakewise.planning.planner import Planner


class IpoptReference:
    """Minimises the cost of commands within their limits, from any start, with exact gradients and their differences.

    IPOPT: A. Waechter and L. T. Biegler, Mathematical Programming 106 (2006) 25, doi 10.1007/s10107-004-0559-y.

    Raises
    ------
    ImportError
        Where casadi is not installed.
    """

    def __init__(self, planner: Planner, iterations: int = 20) -> None:
        casadi: Any = import_module("casadi")

        table, stages = planner.model.table, planner.model.settings.stages
        self._shape = (stages, planner.model.thrusters)
        size = stages * planner.model.thrusters
        shape = self._shape

        class Gradient(casadi.Callback):  # type: ignore[misc]
            def __init__(self) -> None:
                casadi.Callback.__init__(self)
                self.construct("gradient", {})

            def get_n_in(self) -> int:
                return 2

            def get_n_out(self) -> int:
                return 1

            def get_sparsity_in(self, i: int) -> object:
                return casadi.Sparsity.dense(size if i == 0 else 1, 1)

            def get_sparsity_out(self, _: int) -> object:
                return casadi.Sparsity.dense(1, size)

            def eval(self, args: list[Any]) -> list[object]:
                U = np.array(args[0]).reshape(shape)
                return [casadi.DM(planner.gradient(U)).T]

        class Cost(casadi.Callback):  # type: ignore[misc]
            def __init__(self) -> None:
                casadi.Callback.__init__(self)
                self._gradient = Gradient()
                self.construct("cost", {})

            def get_n_in(self) -> int:
                return 1

            def get_n_out(self) -> int:
                return 1

            def get_sparsity_in(self, _: int) -> object:
                return casadi.Sparsity.dense(size, 1)

            def get_sparsity_out(self, _: int) -> object:
                return casadi.Sparsity.dense(1, 1)

            def eval(self, args: list[Any]) -> list[object]:
                return [planner.cost(np.array(args[0]).reshape(shape))]

            def has_jacobian(self) -> bool:
                return True

            def get_jacobian(self, *_: object) -> object:
                return self._gradient

        class Hessian(casadi.Callback):  # type: ignore[misc]
            def __init__(self) -> None:
                casadi.Callback.__init__(self)
                self.construct("hessian", {})

            def get_n_in(self) -> int:
                return 4

            def get_n_out(self) -> int:
                return 1

            def get_sparsity_in(self, i: int) -> object:
                return casadi.Sparsity.dense(*((size, 1), (0, 1), (1, 1), (0, 1))[i])

            def get_sparsity_out(self, _: int) -> object:
                return casadi.Sparsity.upper(size)

            def eval(self, args: list[Any]) -> list[object]:
                z, scale = np.array(args[0]).reshape(-1), float(args[2])
                H = np.empty((size, size))
                here = planner.gradient(z.reshape(shape)).copy()
                for i in range(size):
                    moved = z.copy()
                    moved[i] += 1e-6
                    H[i] = (planner.gradient(moved.reshape(shape)) - here) / 1e-6
                return [casadi.triu(casadi.DM(0.5 * scale * (H + H.T)))]

        self._cost, self._hessian = Cost(), Hessian()
        z = casadi.MX.sym("z", size)
        options = {
            "hess_lag": self._hessian,
            "ipopt.max_iter": iterations,
            "ipopt.tol": 1e-4,
            "ipopt.acceptable_iter": 0,
            "ipopt.print_level": 0,
            "ipopt.sb": "yes",
            "print_time": False,
        }
        self._solver = casadi.nlpsol("plan", "ipopt", {"x": z, "f": self._cost(z)}, options)
        self._bounds = {"lbx": np.tile(table.lower, stages), "ubx": np.tile(table.upper, stages)}

    def solve(self, start_N: Array) -> tuple[Array, float]:
        """Commands, shape (N, n), and their cost, for the problem last loaded into the planner."""
        found = self._solver(x0=start_N.reshape(-1), **self._bounds)
        return np.array(found["x"]).reshape(self._shape), float(found["f"])
