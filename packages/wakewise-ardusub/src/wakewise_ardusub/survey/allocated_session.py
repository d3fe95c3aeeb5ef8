"""Session of a survey that allocates thrusts by the script on the autopilot: the same plan, without GUIDED.

On the operator's consent ALT_HOLD is requested where it is not there, and the output gate is engaged. From then on the
thrusts of `survey_control` act through the script, and the mode stays. All that ends a survey by GUIDED targets ends
this one as well (`survey_safety.fault_of`), and so does every fault of the gate (`engagement_fsm`): the gate releases
the motors, the script has the autopilot enter ALT_HOLD anew, and then POSHOLD is requested where there is a position.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from wakewise.core.interfaces import BodyState
from wakewise.robot.vehicles import Vehicle
from wakewise_ardusub.link.engagement_fsm import EngagementLimits, faults
from wakewise_ardusub.link.message_state import LinkState, MavlinkMessage
from wakewise_ardusub.link.output_gate import OutputGate
from wakewise_ardusub.link.protocol import ALT_HOLD, ENGAGED_NAME, MANUAL, REASON_NAME, STABILIZE
from wakewise_ardusub.link.session_log import SessionLog
from wakewise_ardusub.survey.guided_messages import SurveyTarget
from wakewise_ardusub.survey.survey_control import SurveyController, state_of_filter
from wakewise_ardusub.survey.survey_plan import MakeLines
from wakewise_ardusub.survey.survey_safety import SurveyFacts, SurveyLimits
from wakewise_ardusub.survey.transect_session import (
    ASK_S,
    ASKS_FOR_S,
    ENGAGED,
    PERIOD_S,
    TransectOptions,
    TransectSession,
)

RELEASED_S = 0.5
"""How long the script may take to say that no thrust acts any more, before POSHOLD is requested all the same."""
BANDWIDTH_RAD_S = 0.5
"""Of the depth target: at 1 rad/s it follows the rangefinder's noise, and the bed is blown at half as hard again."""
HEAVY_N = 0.5
DEEPEST_M = 300.0
MOST_TILT_RAD = math.radians(30.0)
_NOT_ENABLED = 1


def gate_limits(limits: SurveyLimits) -> EngagementLimits:
    """Limits of the output gate on a survey: ALT_HOLD alone, and the distance from the target place.

    Place and sticks may be older than beside a pilot who flies: the vehicle is slow, and the bound to the hold is 1 s.
    """
    return EngagementLimits(
        pose_s=0.4,
        operator_s=0.4,
        modes=frozenset({ALT_HOLD}),
        depth_m=(limits.least_depth_m, DEEPEST_M),
        distance_m=limits.off_m,
        tilt_rad=MOST_TILT_RAD,
    )


class AllocatedTransectSession(TransectSession):
    """A survey of one vehicle whose thrusts the companion chooses; parameters as of `TransectSession`.

    Raises
    ------
    InputError
        If the vehicle has more thrusters than the script drives, or no stable gains.
    """

    def __init__(
        self,
        *,
        send: Callable[[str, Mapping[str, Any]], None],
        lines: MakeLines,
        vehicle: Vehicle,
        options: TransectOptions,
        clock: Callable[[], float],
        journal: SessionLog | None = None,
        system: int = 1,
        session: int = 1,
    ) -> None:
        options = replace(options, limits=replace(options.limits, mode=ALT_HOLD))
        super().__init__(
            send=send,
            lines=lines,
            vehicle=vehicle,
            options=options,
            clock=clock,
            journal=journal,
            system=system,
            session=session,
        )
        self.gate = OutputGate(
            send=send,
            drive=self._motors,
            limits=gate_limits(options.limits),
            journal=journal,
            system=system,
            session=session,
            clock=clock,
        )
        self._controller = SurveyController(vehicle)
        self._looped_s = -math.inf
        self._heading_rad = 0.0
        self.weight_N: float | None = None
        self.gate.begin()

    def tick(self) -> None:
        """Judge, and send what is due; to be called at 20 Hz or more."""
        self.gate.tick()  # a program that stood still lets go before it decides anything
        now_s = self._clock()
        heard = self._place is not None and math.isfinite(sum(self.known.attitude))
        if heard and now_s - self._looped_s >= PERIOD_S - 1e-3:
            self._looped_s = now_s
            self.gate.estimated(self._state_now(now_s))
        super().tick()

    def _heard(self, said: MavlinkMessage, _now_s: float) -> LinkState:
        self.gate.take(said)
        return self.gate.known

    def _engage(self, now_s: float) -> str:
        said = self.gate.press()
        return super()._engage(now_s) if self.gate.entry is not None else said

    def _settle(self, now_s: float) -> None:
        super()._settle(now_s)
        self._heading_rad = self.known.attitude[2]
        self._controller.begin()
        if self._depth is not None:
            self._depth = replace(self._depth, bandwidth_rad_s=BANDWIDTH_RAD_S)

    def _begin(self, now_s: float) -> None:
        """The plan, and a warning of the weight that vertical thrusters held while it settled."""
        super()._begin(now_s)
        self.weight_N = self._controller.weight_N
        if self.weight_N > HEAVY_N:
            heavy = f"the vehicle weighs {self.weight_N:.1f} N in water, and lifting it blows at the bed: add buoyancy"
            self.warning = "; ".join(filter(None, (self.warning, heavy)))
        self._write("weight", weight_N=self.weight_N, warning=self.warning)

    def line(self) -> str:
        """One line of how it stands."""
        if self.state != "ready":
            return super().line()
        return f"ready  {'; '.join(filter(None, (self.ended_by, 'Enter begins, in ALT_HOLD')))}"

    def figures(self) -> dict[str, Any]:
        """As of `TransectSession`, with the weight in water."""
        return {**super().figures(), "weight_N": self.weight_N}

    def _begin_by_mode(self, now_s: float) -> None:
        """No mode is consent; but once ALT_HOLD is there that was asked for on consent, the gate is engaged."""
        if self.state == "asked" and self.known.mode == ALT_HOLD and self.gate.engagement.state == "ready":
            self._engage(now_s)

    def _amiss(self, facts: SurveyFacts) -> str:
        """What the survey lacks, which the gate is told; else what the gate found."""
        gate = self.gate
        lacks = gate.survey_fault = super()._amiss(facts)
        if self.state in ENGAGED:
            return lacks or ("" if gate.entry is not None or self.state == "asked" else gate.engagement.why)
        if self._place is not None:
            gate.target_W_m = self._place[0]
        reason, age_s = self.known.named_value(REASON_NAME, self._clock())
        if not lacks and age_s < gate.limits.script_s and round(reason) == _NOT_ENABLED:
            return "the script is not enabled; the pilot sets WKW_ENABLE to 1"
        asks = self.known.mode in (MANUAL, STABILIZE)  # on consent ALT_HOLD is requested
        found = faults(gate.facts(), gate.limits, engaged=False)
        words = [fault.text for fault in found if not (asks and fault.kind == "mode")]
        if gate.engagement.state == "refused":
            words.append(gate.engagement.why)
        return lacks or next(iter(words), "")

    def _state_now(self, now_s: float) -> BodyState:
        assert self._place is not None  # nobody asks before a position was heard
        place, velocity = self._place
        return state_of_filter(
            place,
            velocity,
            self.known.attitude,
            self.known.rates_rad_s,
            now_s - self._last_s["position"],
            self.current_W_m_s,
        )

    def _drive(self, target: SurveyTarget, now_s: float, dt_s: float) -> None:
        """Thrusts of one step; the gate judges them once more before they leave."""
        entry = self.gate.entry
        if entry is None or self._place is None:
            return
        if self.state == "settling":  # the bow stays where it was on consent
            target = replace(target, heading_rad=self._heading_rad)
        estimate, bed = self._state_now(now_s), self.track.bed(now_s)
        way_rad = target.heading_rad
        if self.plan is not None and self.at is not None and self.at.leg < len(self.plan.legs):
            way = self.plan.legs[self.at.leg].way_at(self.at.along_m)
            way_rad = math.atan2(way[1], way[0])
        thrusts = self._controller.thrusts_N(
            estimate, target, bed_m=math.nan if bed is None else bed[0], way_rad=way_rad, dt_s=dt_s
        )
        self.gate.target_W_m = target.place_W_m
        if not np.isfinite(thrusts).all():
            self._let_go("thrusts that are not numbers", now_s)
        else:
            self.gate.command(thrusts, entry)

    def _let_go(self, why: str, now_s: float) -> None:
        """Release the motors first; then as a survey by GUIDED targets ends."""
        self.gate.release(why)
        super()._let_go(why, now_s)

    def _hold_on(self, now_s: float) -> None:
        """Once no thrust acts, ask for POSHOLD until it is there; without a position ALT_HOLD stays."""
        known, over_s = self.known, now_s - self._since_s
        acts, age_s = known.named_value(ENGAGED_NAME, now_s)
        released = (age_s < over_s and acts < 0.5) or over_s > RELEASED_S
        own = (ALT_HOLD,) if self._facts.takeover else (ALT_HOLD, STABILIZE)  # the script leaves ALT_HOLD for a turn
        heard = known.heartbeat_s > self._since_s
        there = self._hold_mode == ALT_HOLD and released
        if there or (heard and (known.mode not in own or known.armed is False)):
            self._enter("ended" if self.finished or self.refused or self._quits else "waiting", self.why)
        elif over_s > ASKS_FOR_S:
            words = "POSHOLD was refused, ALT_HOLD drifts with the current" if heard else "the autopilot did not answer"
            self._enter("ended", f"{self.why}; {words}")
        elif released and now_s - self._last_s["mode"] >= ASK_S:
            self._request(self._hold_mode, now_s)

    def _post(self, name: str, fields: Mapping[str, Any]) -> None:
        if name != "heartbeat":  # the gate sends it
            super()._post(name, fields)
