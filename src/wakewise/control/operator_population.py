"""Who flies by hand: ranges from which each seed draws a person, with the source of every number.

Nothing here is fitted to how a flight ends. What has no source is called an estimate, and its range is wide.

[MJ] D. T. McRuer and H. R. Jex, A review of quasi-linear pilot models, 1967, doi 10.1109/THFE.1967.234304.
[LBK] W. H. Levison, S. Baron and D. L. Kleinman, A model for human controller remnant, 1969,
doi 10.1109/TMMS.1969.299906.
[C] R. C. Cliff, Attention sharing in the performance of a dynamic dual task, 1973, doi 10.1109/TSMC.1973.4309212.
[AS] ArduSub's factory parameters for the BlueROV2, 4.0.0.
[SA] Four dive logs of QGroundControl, Seattle Aquarium, BlueROV2 Heavy, 15 August 2022, public: of 7,292 rows under
water the pilot gain is 20 % in 56 %, 30 % in 39 %, 40 % in 5 %.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

from wakewise.core.errors import InputError

Range = tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class OperatorPopulation:
    """What people at the sticks are drawn from: lowest and highest value of each property, all between equally likely.

    Parameters
    ----------
    delay_s
        From eye to hand, neuromuscular lag included [MJ: the effective delay].
    video_s
        From lens to screen. Estimate: low-latency H.264 over a tether aims below 0.2 s.
    phase_margin_deg
        Phase kept in hand when choosing how hard to steer; less overshoots more. Estimate round what [MJ] find.
    lead_most_s
        Longest lead that can be made against inertia [MJ: up to about 5 s].
    remnant
        Noise of what is seen, over pi times its variance, at full attention [LBK: 0.01, whatever is steered].
    dwell_s
        How long some axes are minded before others are. Estimate: one or two glances.
    image_step
        Displacement across the picture that is let be, over the distance. Estimate: 1 to 3 % of the frame.
    size_step
        Change of distance that is let be, over the distance. Estimate: a just noticeable change of size.
    rate_step_per_s
        Motion that is not seen, over the distance. Estimate: 0.1 deg/s at the eye, on a screen.
    azimuth_drift_deg, standoff_drift, level_drift, heading_drift_deg
        How well the place on the circle, the distance, the level (shares of the distance) and the target in the middle
        are kept by eye, without a scale: rms of an error that lasts `drift_s`. Estimates.
    pace
        Speed that a person starts with over the one that is desired. Estimate.
    trim_s
        How fast a steady push is learned. Estimate: a few corrections.
    gain
        Pilot gain, full stick over full thrust [AS: JS_GAIN_MIN to JS_GAIN_DEFAULT].
    stick_step
        Finest steps of a thumb on a stick, over its full way. Estimate.
    attended : int
        Axes minded at a time, of four. [C] finds one channel; estimate: two, those of one stick.

    Raises
    ------
    InputError
        If a range is not in order or not above zero, a margin leaves no phase to steer with, or none or more than four
        axes are minded.
    """

    delay_s: Range = (0.20, 0.35)
    video_s: Range = (0.10, 0.25)
    phase_margin_deg: Range = (30.0, 60.0)
    lead_most_s: Range = (2.0, 5.0)
    remnant: Range = (0.007, 0.014)
    dwell_s: Range = (0.4, 1.0)
    image_step: Range = (0.01, 0.03)
    size_step: Range = (0.03, 0.06)
    rate_step_per_s: Range = (0.005, 0.015)
    azimuth_drift_deg: Range = (3.0, 8.0)
    standoff_drift: Range = (0.04, 0.10)
    level_drift: Range = (0.02, 0.06)
    heading_drift_deg: Range = (1.0, 3.0)
    drift_s: Range = (20.0, 60.0)
    pace: Range = (0.8, 1.2)
    trim_s: Range = (6.0, 15.0)
    gain: Range = (0.25, 0.5)
    stick_step: Range = (0.02, 0.05)
    attended: int = 2

    def __post_init__(self) -> None:
        for one in fields(self):
            value = getattr(self, one.name)
            if isinstance(value, tuple) and not 0.0 < value[0] <= value[1]:
                raise InputError(f"{one.name}: [{value[0]:g}, {value[1]:g}], must be above 0 and in order")
        if self.phase_margin_deg[1] >= 90.0:
            raise InputError(
                f"phase_margin_deg: {self.phase_margin_deg[1]:g} leaves nothing to steer with, allowed < 90"
            )
        if not 1 <= self.attended <= 4:
            raise InputError(f"attended: {self.attended} axes, allowed 1 to 4")


POPULATION = OperatorPopulation()
"""Those who are drawn unless others are named."""
CAREFUL = OperatorPopulation(gain=(0.2, 0.3))
"""Survey pilots: the same people at the pilot gain of survey dives [SA]. The finest push is `stick_step` times the
gain, and the most is the gain, so both are smaller; nothing else is changed."""
