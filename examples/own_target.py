"""How gently is a target of my own photographed?"""

import sys

import trimesh

import wakewise as ww
from wakewise.scene.targets import Mesh, place_on_bed

parts = ww.Scenario.preset("quick").parts()
if sys.argv[2:]:  # a mesh file: PLY, STL, OBJ, OFF or GLB, z up, scaled to 0.2 m
    target = ww.load_target(sys.argv[2], size_m=0.2)
else:  # or a mesh made here: z up, in m, standing on z = 0
    vase = trimesh.creation.revolve([(0, 0), (0.05, 0), (0.08, 0.06), (0.04, 0.14), (0.05, 0.18), (0, 0.18)])
    target = place_on_bed("vase", Mesh(vase.vertices, vase.faces), parts.target.bed_z_m)
parts = parts.replace(target=target)
print(f"{target.name}: {len(target.mesh.faces)} faces, radius {target.radius_m:.2f} m")
seconds = float(sys.argv[1]) if sys.argv[1:] else None
for method in ("dp", "wake-aware"):
    print(ww.fly(parts.replace(method=method), duration_s=seconds))
# ww.trial(parts, "runs/vase") would also photograph, reconstruct, judge and report.
