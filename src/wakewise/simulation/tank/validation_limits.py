"""Accuracy of the tank's water: each law, the value reached, and its consequence for a claim.

`reached` is the present measurement; tests/simulation/tank/test_validation_limits.py repeats every one and fails when
the table differs.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class ValidationLimit:
    """One law of the water."""

    name: str  # short, and one of its kind
    law: str  # what is compared: mostly the tank's figure over the law's or the lattice's, so that 1 would be right
    source: str
    # asked, reached: from and to.
    asked: tuple[float, float]
    reached: tuple[float, float]
    means: str  # for a claim that rests on it

    @property
    def met(self) -> bool:
        """Whether all reached values lie within the limits."""
        return self.asked[0] <= self.reached[0] and self.reached[1] <= self.asked[1]


LIMITS: tuple[ValidationLimit, ...] = (
    ValidationLimit(
        name="speed on a jet's axis",
        law="U x / sqrt(thrust / density), 0.6 to 1 m from the disk, 0.1 to 5 N",
        source="Hussein, Capp and George 1994, doi 10.1017/S002211209400323X",
        asked=(6.5, 7.0),
        reached=(6.91, 7.14),
        means="a single jet is up to 2 % too fast",
    ),
    ValidationLimit(
        name="momentum of a round jet",
        law="flux of momentum over thrust, 0.6 and 0.9 m from the disk",
        source="conservation",
        asked=(0.95, 1.05),
        reached=(0.95, 1.0),
        means="nothing beyond a few per cent",
    ),
    ValidationLimit(
        name="momentum of the widest jet",
        law="flux of momentum over thrust, 0.6 and 0.8 m from the disk, half width 0.18 of the distance",
        source="conservation",
        asked=(0.95, 1.05),
        reached=(0.84, 0.89),
        means="worlds with a propeller's wide jets have wash up to 8 % too slow",
    ),
    ValidationLimit(
        name="front of a jet that starts",
        law="distance over 2.57 M^(1/4) t^(1/2) after 2, 4 and 8 s",
        source="starting jets, as quoted in tests/simulation/water/test_water.py",
        asked=(0.9, 1.1),
        reached=(0.93, 1.0),
        means="wash arrives up to 7 % nearer than it should",
    ),
    ValidationLimit(
        name="what lingers after a stop",
        law="integral of speed over time, 4 to 8 diameters down the jet, over the lattice's",
        source="the lattice, case stop",
        asked=(0.75, 1.25),
        reached=(0.78, 0.84),
        means="wash left behind counts for a fifth too little; tank.jets.wake_life says what if it lived longer",
    ),
    ValidationLimit(
        name="bent by a current",
        law="height of the path over (x lM^2)^(1/3) beyond 2 lM, currents of 0.06 to 0.15 m/s",
        source="Fischer et al. 1979, Mixing in Inland and Coastal Waters",
        asked=(1.4, 2.1),
        reached=(1.92, 2.16),
        means="in a strong current wash passes up to 3 % of the height farther off than measured paths' upper end",
    ),
    ValidationLimit(
        name="jets head-on",
        law="mean outflow 5 to 20 cm from the axis over the lattice's",
        source="the lattice, case head-on",
        asked=(0.75, 1.25),
        reached=(1.24, 2.14),
        means="squeezing thrusters against each other looks worse than it is",
    ),
    ValidationLimit(
        name="jets that cross: on the axis",
        law="speed 1 to 6 diameters behind a crossing at right angles over the lattice's, jets as wide as its own",
        source="the lattice, case crossing",
        asked=(0.75, 1.25),
        reached=(1.28, 1.40),
        means="wash of two jets that cross is a third too fast ahead of them; round jets without fans: 2 to 2.5 times",
    ),
    ValidationLimit(
        name="jets that cross: the fan",
        law="mean speed 1 to 2 diameters above the jets' plane, 1 to 6 behind the crossing, over the lattice's",
        source="the lattice, case crossing",
        asked=(0.75, 1.25),
        reached=(0.9, 1.01),
        means="the fan is there and as strong; near the crossing it is not as high (research log 26)",
    ),
    ValidationLimit(
        name="jets that cross at 40 and 110 degrees: on the axis",
        law="speed 1 to 6 diameters behind the crossing over the lattice's, jets as wide as its own",
        source="the lattice, cases crossing-40 and crossing-110",
        asked=(0.75, 1.25),
        reached=(1.32, 1.65),
        means="wash of two jets that cross is a third to two thirds too fast ahead of them, at any angle",
    ),
    ValidationLimit(
        name="jets that cross at 40 degrees: the fan",
        law="mean speed 1 to 2 diameters above the jets' plane, 1 to 6 behind the crossing, over the lattice's",
        source="the lattice, case crossing-40",
        asked=(0.75, 1.25),
        reached=(0.50, 0.89),
        means="the flatter two jets cross, the less of the fan is there: half of it 1 diameter behind the crossing",
    ),
    ValidationLimit(
        name="jets that cross at 110 degrees: the fan",
        law="mean speed 1 to 2 diameters above the jets' plane, 1 to 6 behind the crossing, over the lattice's",
        source="the lattice, case crossing-110",
        asked=(0.75, 1.25),
        reached=(1.03, 1.89),
        means="the wider two jets cross, the longer their fan lasts: right at first, twice as fast 6 diameters on",
    ),
    ValidationLimit(
        name="a jet past a target",
        law="fastest water 4 to 10 diameters down a jet, half of one beside a cube of 0.15 m, over the lattice's",
        source="the lattice, case grazing-target",
        asked=(0.75, 1.25),
        reached=(1.02, 1.24),
        means="wash beside a target is up to a quarter too fast",
    ),
    ValidationLimit(
        name="a jet past a target: its momentum",
        law="flux of momentum 8 to 10 diameters down a jet, half of one beside a cube of 0.15 m, over the lattice's",
        source="the lattice, case grazing-target",
        asked=(0.75, 1.25),
        reached=(1.08, 1.17),
        means="wash behind a target that a jet grazes is a little too strong",
    ),
    ValidationLimit(
        name="a jet past a target: at its sides",
        law="rms of the mean speed 1 to 6 cm off that cube, of three cuttings of it into triangles, over the lattice's",
        source="the lattice, case grazing-target",
        asked=(0.75, 1.25),
        reached=(0.935, 1.02),
        means="nothing: what a target feels of a jet that grazes it",
    ),
    ValidationLimit(
        name="a jet that strikes a target: at its sides",
        law="rms of the mean speed 1 to 6 cm off a cube of 0.15 m struck square, of six cuttings, over the lattice's",
        source="the lattice, case struck-target",
        asked=(0.75, 1.25),
        reached=(0.625, 1.22),
        means="a jet that strikes square turns off to one side, not to all: speeds there are right to 40 % only",
    ),
    ValidationLimit(
        name="a jet past a target: no runaway",
        law="share of ten cuttings of that cube's surface into triangles with no water faster than 1.6 exit speeds",
        source="no water is faster than the jet that drives it",
        asked=(1.0, 1.0),
        reached=(1.0, 1.0),
        means="nothing",
    ),
    ValidationLimit(
        name="jets at corals: no runaway",
        law="fastest water 2 cm off three corals over the exit speed; 1 N from 0.3 to 0.6 m strikes or grazes them",
        source="no water is faster than the jet that drives it, by more than potential flow does past a ball (1.5)",
        asked=(0.0, 1.5),
        reached=(0.93, 1.95),
        means="for moments and at single places water at a coral may be twice as fast as it should",
    ),
    ValidationLimit(
        name="a jet past the hull",
        law="flux of momentum 8 to 10 diameters down a jet, half of one beside a cube of 0.24 m, over the lattice's",
        source="the lattice, case grazing-box",
        asked=(0.75, 1.25),
        reached=(1.49, 1.52),
        means="no hull is in a jet's way: grazing it keeps half too much, at one diameter a quarter (research log 71)",
    ),
    ValidationLimit(
        name="stress on the bed, strong jet",
        law="greatest mean stress over 0.16 rho U0^2 (D/H)^2, 1 N from 0.5 m",
        source="Beltaos and Rajaratnam 1974, J. Hydraul. Div. ASCE 100 HY10",
        asked=(0.75, 1.25),
        reached=(0.9, 1.05),
        means="silt is lifted where it should be",
    ),
    ValidationLimit(
        name="stress on the bed, weak jets",
        law="greatest mean stress over 0.16 rho U0^2 (D/H)^2, 0.1 and 0.25 N from 0.8 m",
        source="Beltaos and Rajaratnam 1974",
        asked=(0.75, 1.25),
        reached=(0.81, 0.825),
        means="weak jets lift a little less silt than they should",
    ),
    ValidationLimit(
        name="the hull's wake",
        law="size and deficit on the axis over Johansson's law, 30 to 90 momentum thicknesses behind",
        source="Johansson, George and Gourlay 2003, doi 10.1063/1.1536976",
        asked=(0.9, 1.1),
        reached=(1.0, 1.05),
        means="nothing; nearer than a few lengths of the hull no law is known to hold",
    ),
    ValidationLimit(
        name="a solid half ball",
        law="share of the normal flow that still crosses its surface",
        source="potential flow",
        asked=(0.0, 0.15),
        reached=(0.102, 0.102),
        means="nothing",
    ),
    ValidationLimit(
        name="solid corals",
        law="share of the normal flow that still crosses the surface of a branching, a brain and a plate coral",
        source="no flow through a surface",
        asked=(0.0, 0.15),
        reached=(0.157, 0.342),
        means="speeds at a coral's surface are of water that partly passes through it",
    ),
)
"""The laws, asked and reached."""

ABSENT: tuple[str, ...] = (
    "The hull blocks no jet, no jet clings to it; its wake has the momentum that drag says, but no eddies of its own.",
    "Thrust does not change near the bed, and only with tank.jets.inflow_loss in the wash of another thruster.",
    "Wall jets carry no turbulence, do not collide, and have no boundary layer. The log law is given the speed at the "
    "wall, not at 1 cm. With the speed at 1 cm, stress would be 0.16 (1 N from 0.5 m) and 0.37 (0.25 N from 0.8 m) of "
    "the law above.",
    "Gusts do not carry jets: a jet's axis does not meander, nor does the plane of two that cross.",
    "What has met once does not meet again: a fan passes other jets and fans.",
    "A cable's drag leaves no wake.",
)
"""What the tank's water has not."""


def limits_table() -> list[dict[str, str]]:
    """The laws as rows of words, for a page, the missed ones first: law, asked, reached, met, source, what it means."""

    def span(ends: tuple[float, float]) -> str:
        return f"{ends[0]:.3g} to {ends[1]:.3g}"

    return [
        {
            "name": limit.name,
            "law": limit.law,
            "source": limit.source,
            "asked": span(limit.asked),
            "reached": span(limit.reached),
            "met": "yes" if limit.met else "no",
            "means": limit.means,
        }
        for limit in sorted(LIMITS, key=lambda limit: limit.met)
    ]
