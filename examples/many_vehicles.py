"""How stiffly should my vehicle hold its place, over hundreds that each differ and meet another current?"""

import numpy as np

import wakewise as ww
from wakewise.core.geometry import matrix_from_quat
from wakewise.robot.vehicles import compile_body, pack_bodies, perturbed, step_batch

rov, rng, n = ww.load_vehicle("bluerov2-heavy"), np.random.default_rng(1), 400
drawn = [perturbed(rov, rng, mass_pct=10, damping_pct=40, added_mass_pct=30, trim_N=2) for _ in range(n)]
bodies, currents = pack_bodies([compile_body(vehicle) for vehicle in drawn]), rng.uniform(-0.15, 0.15, (n, 3))
mix, unmix = rov.allocation_matrix.T, np.linalg.pinv(rov.allocation_matrix).T
for stiffness in (30.0, 300.0, 3000.0, 30000.0):  # N/m, damped for a mass of 20 kg
    states = np.tile([0.0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0], (n, 1))  # position, quaternion, twist
    for _ in range(250):  # 10 s of each, 500 steps
        seen = states + 0.01 * rng.standard_normal((n, 13))  # a centimetre, a degree, a centimetre per second
        back_B = np.einsum("kji,kj->ki", matrix_from_quat(seen[:, 3:7]), -stiffness * seen[:, :3])
        force, moment = back_B - np.sqrt(80 * stiffness) * seen[:, 7:10], -8 * seen[:, 4:7] - 2 * seen[:, 10:]
        thrusts_N = np.clip(np.hstack([force, moment]) @ unmix, rov.thrust_lower_N, rov.thrust_upper_N)
        step_batch(bodies, states, thrusts_N @ mix, 0.02, currents_W_m_s=currents, steps=2, out=states)
    off_mm = 1e3 * np.linalg.norm(states[:, :3], axis=1)
    print(f"{stiffness:g} N/m: {np.median(off_mm):.0f} mm off, the worst {off_mm.max():.0f} mm")
