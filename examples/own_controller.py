"""Is my own controller gentler than wake-aware?"""

import sys

import wakewise as ww
from wakewise.allocation import min_norm_allocation
from wakewise.control import PidState as State, make_pid, vehicle_layout


class Mine:
    def __init__(self, parts: ww.Parts) -> None:
        self.name, self.layout = "mine", vehicle_layout(parts.vehicle)
        self.tracker = make_pid(parts.vehicle, parts.control)

    def init(self) -> State:
        return self.tracker.init()

    def step(self, state: State, dt_s: float, estimate: ww.BodyState, goal: ww.Goal) -> tuple[State, ww.Command]:
        state, wrench = self.tracker.wrench(state, dt_s, estimate, goal)
        return state, ww.Command(thrusts_N=min_norm_allocation(self.layout, wrench).thrusts_N, wrench_B=wrench)


parts = ww.Scenario.preset("quick").parts()
for flown in (parts, parts.replace(controller=Mine(parts))):  # the same mission in the same water
    print(ww.fly(flown, duration_s=float(sys.argv[1]) if sys.argv[1:] else None))
