"""Control: from an estimate and a goal to thrusts, by one pipeline whose stages a method chooses.

All methods share one PID (with feed-forward, slowed where its margins ask for it), so that what they do to the water
can be compared at equal wrench. `make_controller` makes one by name, ours or one from outside.

Start reading in `pipeline.py` and `methods.py`.

- `pipeline.py`: the stages in order, and the state that all of them share.
- `methods.py`: the methods by name, as settings of two makers.
- `attitude_optimizer.py`: hull attitude about the camera's hinge.
- `mpc_controller.py`: plan, tube and tracking correction.
- `pid.py`, `gain_margins.py`: PID with feed-forward, and how stiff it may be.
- `manual.py`, `operator_model.py`, `operator_population.py`: a person at two sticks.
- `ardusub.py`, `motor_mix.py`: the loops and the mixer that such vehicles are shipped with.
- `null_space_allocation.py`: one wrench to n thrusts, step by step.
- `failsafe.py`: what is flown where a part fails.
- `thruster_pwm.py`: thrusts in the dead zone as pulses.
- `bumpless_transfer.py`: change of the method in flight.
- `velocity_reference.py`, `motion_profile.py`: goals from an operator's velocity.
- `forward_jet_exclusion.py`: thrust limits without jets ahead.
- `bed_points.py`: points near the bed as part of the region.
- `ballast_advice.py`, `ballast_from_hover.py`: ballast for a mission, and from a hover.
- `settings.py`: what a user may set.
"""

from wakewise.control.gain_margins import Gains, desired_gains, vehicle_axes
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
    "desired_gains",
    "make_controller",
    "make_pid",
    "vehicle_axes",
    "vehicle_layout",
    "with_failsafe",
    "with_pwm",
]
