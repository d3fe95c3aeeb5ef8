"""Control: from an estimate and a goal to thrusts, by one pipeline whose stages a method chooses.

All methods share one PID (with feed-forward, slowed where its margins ask for it), so that what they do to the water
can be compared at equal wrench. `make_controller` makes one by name, ours or one from outside.

Start reading in `pipeline.py` (the stages in order and the state) and `methods.py` (which methods there are). Stages:
`attitude_optimizer.py`, `mpc_controller.py`, `pid.py` with `gain_margins.py`, `manual.py`, `ardusub.py` with
`motor_mix.py`, `null_space_allocation.py`, `failsafe.py`, `thruster_pwm.py`. `bumpless_transfer.py` changes the method
in flight. `velocity_reference.py` and `motion_profile.py` make goals of an operator's velocity,
`forward_jet_exclusion.py` is a layout, `bed_points.py` adds to the region, `ballast_advice.py` and
`ballast_from_hover.py` advise ballast.
"""

from wakewise.control.gain_margins import Gains, vehicle_axes, wished_gains
from wakewise.control.methods import MAKERS, METHODS, ControlTask, make_controller
from wakewise.control.null_space_allocation import vehicle_layout
from wakewise.control.pid import Pid, PidState, make_pid
from wakewise.control.pipeline import Pipeline, PipelineState, with_failsafe, with_pwm
from wakewise.control.settings import AllocationSettings, ControlSettings

__all__ = [
    "MAKERS",
    "METHODS",
    "AllocationSettings",
    "ControlSettings",
    "ControlTask",
    "Gains",
    "Pid",
    "PidState",
    "Pipeline",
    "PipelineState",
    "make_controller",
    "make_pid",
    "vehicle_axes",
    "vehicle_layout",
    "wished_gains",
    "with_failsafe",
    "with_pwm",
]
