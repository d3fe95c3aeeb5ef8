"""Who flies by hand: ranges from which each seed draws a person, with the source of every number.

Nothing here is fitted to how a flight ends. Where a number has no source it is called an estimate, and its range is
wide.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, field_validator

from wakewise.settings import Settings

Range = tuple[float, float]
Attended = Annotated[int, Field(ge=1, le=4)]


class PersonSettings(Settings):
    """What a person at the sticks is drawn from: lowest and highest value of each property, all equally likely.

    Sources. [MJ] D. T. McRuer and H. R. Jex, A review of quasi-linear pilot models, 1967,
    doi 10.1109/THFE.1967.234304. [LBK] W. H. Levison, S. Baron and D. L. Kleinman, A model for human controller
    remnant, 1969, doi 10.1109/TMMS.1969.299906. [C] R. C. Cliff, Attention sharing in the performance of a dynamic
    dual task, 1973, doi 10.1109/TSMC.1973.4309212. [AS] ArduSub's factory parameters for the BlueROV2, 4.0.0.
    """

    seed: int | None = Field(
        default=None, ge=0, description="which person flies; none = the one that the trial's seed draws"
    )
    delay_s: Range = Field(
        default=(0.20, 0.35), description="from eye to hand, neuromuscular lag included (s) [MJ: the effective delay]"
    )
    video_s: Range = Field(
        default=(0.10, 0.25),
        description="from lens to screen (s); estimate: low-latency H.264 over a tether aims below 0.2",
    )
    phase_margin_deg: Range = Field(
        default=(30.0, 60.0),
        description="phase that a person keeps in hand when choosing how hard to steer (deg); less overshoots more; "
        "estimate round what [MJ] find",
    )
    lead_most_s: Range = Field(
        default=(2.0, 5.0), description="longest lead a person can make against inertia (s) [MJ: up to about 5]"
    )
    remnant: Range = Field(
        default=(0.007, 0.014),
        description="noise of what is seen, over pi times its variance, per rad/s, at full attention "
        "[LBK: 0.01, in constant proportion to the variance]",
    )
    attended: Attended = Field(
        default=2, description="axes minded at a time, of four; [C]: one, estimate: two, those of one stick"
    )
    dwell_s: Range = Field(
        default=(0.4, 1.0), description="how long these are minded before others are (s), estimate: one or two glances"
    )
    image_step: Range = Field(
        default=(0.01, 0.03),
        description="displacement across the picture let be, over the distance; estimate: 1 to 3 % of the frame",
    )
    size_step: Range = Field(
        default=(0.03, 0.06),
        description="change of distance that is let be, over the distance; estimate: just noticeable change of size",
    )
    rate_step_per_s: Range = Field(
        default=(0.005, 0.015),
        description="motion that is not seen, over the distance (1/s); estimate: 0.1 deg/s at the eye, on a screen",
    )
    azimuth_drift_deg: Range = Field(
        default=(3.0, 8.0), description="how well the place on the circle is known by eye, rms (deg), estimate"
    )
    standoff_drift: Range = Field(
        default=(0.04, 0.10), description="how well a distance is kept by eye without a scale, rms, a share; estimate"
    )
    level_drift: Range = Field(
        default=(0.02, 0.06), description="how well a level is kept by eye, rms, over the distance; estimate"
    )
    heading_drift_deg: Range = Field(
        default=(1.0, 3.0), description="how well the target is kept in the middle, rms (deg); estimate"
    )
    drift_s: Range = Field(default=(20.0, 60.0), description="how long such an error lasts (s); estimate")
    pace: Range = Field(
        default=(0.8, 1.2), description="speed that a person starts with over the one that is wished; estimate"
    )
    trim_s: Range = Field(
        default=(6.0, 15.0), description="how fast a steady push is learned (s); estimate: a few corrections"
    )
    gain: Range = Field(
        default=(0.25, 0.5), description="pilot gain: full stick over full thrust [AS: JS_GAIN_MIN to JS_GAIN_DEFAULT]"
    )
    stick_step: Range = Field(
        default=(0.02, 0.05), description="finest steps of a thumb on a stick, over its full way; estimate"
    )

    @field_validator("*")
    @classmethod
    def _in_order(cls, value: object) -> object:
        if isinstance(value, tuple) and not 0.0 < value[0] <= value[1]:
            raise ValueError(
                f"[{value[0]:g}, {value[1]:g}] must be a lowest and a highest value, more than 0, in order"
            )
        return value

    @field_validator("phase_margin_deg")
    @classmethod
    def _steers_at_all(cls, value: Range) -> Range:
        if value[1] >= 90.0:
            raise ValueError(f"{value[1]:g} deg leaves nothing to steer with, must be less than 90")
        return value
