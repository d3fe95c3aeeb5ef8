"""What soft targets are made of, by name, and where each number comes from.

Measured moduli of such tissue spread over a decade between species, seasons and rates of loading, so each is one
plausible individual; `target.stiffness_Pa` and its like give another. Where a source gives no number that fits the
mesh, the number is an estimate, and its reasoning is stated.

Drag. Branches of 3 to 20 mm in 0.04 to 0.2 m/s have Reynolds numbers of 100 to 4000, where the coefficient of a
circular cylinder is 1.0 to 1.4 (D. J. Tritton 1959, J. Fluid Mech. 6, 547, doi 10.1017/S0022112059000829, up to 100;
the plateau of 1.0 to 1.2 beyond is in every textbook): 1.2. Blades are flat plates across the stream: 1.95, as M. Luhar
and H. M. Nepf 2011 use it for seagrass (Limnol. Oceanogr. 56, 2003, doi 10.4319/lo.2011.56.6.2003). Branches do not
shelter each other here, which overstates the drag of a dense bush.

Damping. In tension tests of four seaweeds 42 to 52 % of the work of loading was lost (D. L. Harder, C. L. Hurd and T.
Speck 2006, Am. J. Bot. 93, 1426). A linear tissue that is loaded and let go loses pi / 2 tan(delta) of it, so
tan(delta) is about 0.3 and the damping half of that, 0.15 of critical: by analogy for all kinds, an estimate.
"""

from __future__ import annotations

from wakewise.scene.targets.elasticity import TissueProperties

_DAMPING = 0.15

# Anemone. Mesogloea creeps to ten times its first strain in hours (R. McN. Alexander 1962, as told by S. Vogel,
# Comparative Biomechanics, Princeton 2003); its modulus then is about 0.01 MPa (O. Betz et al. in Biomimetic Research
# for Architecture and Building Construction, Springer 2016, after S. A. Wainwright et al. 1976), so that for the
# seconds of a passing wake it is about 0.1 MPa. The column is a tube of water: with a wall of a fifth of its radius, an
# estimate, its section has 1 - 0.8^4 = 0.59 of a full one's stiffness: 0.06 MPa. Flow forces on such anemones: M. A. R.
# Koehl 1977, J. Exp. Biol. 69, 87, doi 10.1242/jeb.69.1.87. Density: 98 % sea water, an estimate.
ANEMONE = TissueProperties(stiffness_Pa=6e4, density_kg_m3=1030.0, drag=1.2, damping=_DAMPING)

# Soft coral (Sinularia flexibilis and its like): mesogloea as above, made stiffer by sclerites, which does not tell its
# species apart (M.-C. Lin and C.-F. Dai 1997, Zool. Stud. 36, 58: flexible colonies bend down in flow). 0.3 MPa, three
# times the bare mesogloea, is an estimate. Density: a tenth of the volume is calcite of 2700 kg/m3, an estimate.
SOFT_CORAL = TissueProperties(stiffness_Pa=3e5, density_kg_m3=1200.0, drag=1.2, damping=_DAMPING)

# Gorgonian: a horny axis in a soft rind. The axis is a tanned collagen whose stiffness varies with sclerotization and
# calcification (K. Jeyasuria and J. C. Lewis 1987, Coral Reefs 5, 213, as told by J. C. Lewis et al. 1992, Biol. Bull.
# 183, 278). 1 GPa, the order of tanned proteins such as horn, in an axis of a third of the branch's diameter, both
# estimates, gives 1/81 of it over the whole section: 12 MPa. Density of rind and axis together: an estimate. That such
# colonies bend over and sway with the swell, at a low frequency, is observed (M. Boudina, F. P. Gosselin and S. Etienne
# 2021, J. Fluid Mech., doi 10.1017/jfm.2021.252).
GORGONIAN = TissueProperties(stiffness_Pa=1.2e7, density_kg_m3=1200.0, drag=1.2, damping=_DAMPING)

# Seagrass (eelgrass, turtle grass). Strips of low-density polyethylene, whose modulus is 0.3 GPa, stand for eelgrass in
# flumes as they bend alike (J. Lei and H. Nepf 2019, J. Fluids Struct. 87, 137); leaves of cold regions are ten times
# as flexible as those of warm ones (M. Paul and C. B. de los Santos 2019, Mar. Biol. 166, doi
# 10.1007/s00227-019-3577-2). A leaf 0.3 mm thick has 1/38 of the second moment of the lens of 1.2 mm that the
# procedural blades are drawn with, and 0.32 of its area: 8 MPa, and 0.32 of the buoyancy of a leaf of 850 kg/m3 with
# its air, an estimate. Such a blade lies down in the current of an open meadow; it is for still tanks and light
# currents.
SEAGRASS = TissueProperties(stiffness_Pa=8e6, density_kg_m3=952.0, drag=1.95, damping=_DAMPING)

TISSUES: dict[str, TissueProperties] = {
    "anemone": ANEMONE,
    "gorgonian": GORGONIAN,
    "seagrass": SEAGRASS,
    "soft-coral": SOFT_CORAL,
}
"""Tissues by the names of `target.sway`; a procedural target of the same name has the shape that goes with it."""
