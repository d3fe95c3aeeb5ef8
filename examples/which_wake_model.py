"""Whose wake model is right, by a lattice-Boltzmann jet or by velocities that I measured?"""

import sys
from pathlib import Path

import wakewise as ww
from wakewise.wake.models import OWN_MODELS
from wakewise.wake.samples import read_samples, score
from wakewise_paper.flows import oracle_jets
from wakewise_paper.wake_validation import sampled

if sys.argv[1:]:  # CSV files with x_m, r_m, thrust_N, u_m_s, disk_diameter_m: see `wakewise wake fit --help`
    flows = [read_samples(Path(name)) for name in sys.argv[1:]]
else:
    flows = [sampled(jet, [1.0], 0.01) for jet in oracle_jets()[0]]
for flow in flows:
    print(f"{flow.title}, {len(flow)} points: R2 (1 is perfect, 0 a flow of mean speed, below is worse than that)")
    print(f"{'model':<18}{'within 15 deg, 0.1-0.3 m':>26}{'within 30 deg, 0.1-0.5 m':>26}")
    for name in OWN_MODELS:
        found = score(ww.wake_model(name), flow)
        cells = ("too few points" if r2 is None else f"{r2:.2f}" for r2 in (found.r2_core, found.r2_wake))
        print(f"{name:<18}" + "".join(f"{cell:>26}" for cell in cells))
