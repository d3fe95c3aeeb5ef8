"""Jets that strike, graze and pass solid bodies in the tank's water, beside the lattice's."""

import math
from dataclasses import replace
from functools import cache

import numpy as np

from wakewise.scene.targets import Mesh, Target, coral, place_on_bed
from wakewise.simulation.water.blockage import Blockage, _surface
from wakewise.simulation.water.round_jet_closure import JetSpreading
from wakewise.simulation.water.water import Water
from wakewise_paper.lattice_reference.jet_past_box import load_past_box, momentum, past_figures
from wakewise_paper.lattice_reference.reference_cases import find_case

D_M = 0.06
AREA_M2 = math.pi * D_M**2 / 4
DENSITY = 998.0
EXIT_M_S = math.sqrt(1.0 / (DENSITY * AREA_M2))
UNIT_S = D_M / EXIT_M_S
AHEAD = ((1.0, 0.0, 0.0),)
DEEP = ((0.0, 0.0, 25.0),)


def new_water(n=1, **options):
    options = {"bed_z_m": math.inf} | options
    return Water(np.full(n, AREA_M2), density_kg_m3=DENSITY, rng=np.random.default_rng(0), **options)


def push(water, seconds, thrusts_N, at=((0.0, 0.0, 0.0),), jets=AHEAD, dt_s=0.05):
    at, axes = np.array(at, dtype=float), -np.array(jets, dtype=float)
    impulses = np.column_stack([np.array(thrusts_N, dtype=float), np.zeros(len(at))]) * dt_s
    for _ in range(round(seconds / dt_s)):
        water.step(dt_s, at, at, axes, impulses)
    return water


def box(low, high, bed_z_m=50.0) -> Target:
    """A solid box between two corners as a target far from every face."""
    low, high = np.array(low, dtype=float), np.array(high, dtype=float)
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) * (high - low) + low
    sides = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    faces = np.array([t for a, b, c, d in sides for t in ((a, b, c), (a, c, d))])
    half = 0.5 * float(np.linalg.norm(high - low))
    return Target(name="box", mesh=Mesh(corners, faces), centre_W_m=0.5 * (low + high), radius_m=half, bed_z_m=bed_z_m)


def cube(case) -> Target:
    """A case's box as a target, its jet 25 m deep."""
    return box(*(np.array(corner) * D_M + [0, 0, 25] for corner in case.boxes_D[0]))


@cache
def past_box(name, solid):
    """Fastest water 4 to 10 D down a jet past a box, and momentum 8 to 10 D down it, over the lattice's."""
    field, case = load_past_box(name), find_case(name)
    body = Blockage.of(cube(case)) if solid else None
    water = new_water(bed_z_m=50.0, turbulence=0.25, spreading=JetSpreading.of_width(0.13), body=body)
    at, behind, steps = DEEP, (field.x_D >= 8.0) & (field.x_D <= 10.0), round(80 * UNIT_S / 0.05)
    upright, planes = field.points_D()[0], field.planes_D()[behind]
    places = [points.reshape(-1, 3) * D_M + at for points in (upright, planes)]
    push(water, 40 * UNIT_S, [1.0], at)
    u, through = np.zeros(upright.shape[:-1]), np.zeros(planes.shape[:-1])
    for k in range(steps):
        push(water, 0.05, [1.0], at)
        u += water.velocity(places[0])[:, 0].reshape(u.shape) / steps / EXIT_M_S
        if k % 8 == 0:
            through += water.velocity(places[1])[:, 0].reshape(through.shape) / EXIT_M_S
    through = np.where(field.wet(planes), through / len(range(0, steps, 8)), 0.0)
    ours, theirs = past_figures(field, u), past_figures(field)
    fastest = (np.array(ours["fastest"]) / theirs["fastest"])[3:10]
    return fastest, momentum(through, field.y_D, field.z_D) / field.flux[behind], np.array(ours["drawn_D"])


def cut(target, times, first):
    """The same box in triangles of half the size, so many times over, told from another of them on."""
    corners = target.mesh.vertices_m[target.mesh.faces]
    for _ in range(times):
        a, b, c = (corners[:, k] for k in range(3))
        ab, bc, ca = 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)
        corners = (
            np.stack([(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]).transpose(2, 0, 1, 3).reshape(-1, 3, 3)
        )
    corners = np.roll(corners, first, axis=0)
    return replace(target, mesh=Mesh(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3)))


def fastest_of_cuttings():
    """Fastest water beside a box over U0, of ten cuttings that differ in where points and sources fall only."""
    case, field, found = find_case("grazing-target"), load_past_box("grazing-target"), []
    upright = field.points_D()[0]
    places = upright[field.wet(upright)] * D_M + [0.0, 0.0, 25.0]
    for k in range(10):
        body = Blockage.of(cut(cube(case), 3, 77 * k))
        water = new_water(bed_z_m=50.0, spreading=JetSpreading.of_width(0.13), body=body)
        push(water, 4.0, [1.0], DEEP)
        speeds = [np.linalg.norm(push(water, 0.5, [1.0], DEEP).velocity(places), axis=1).max() for _ in range(16)]
        found.append(max(speeds) / EXIT_M_S)
    return np.array(found)


def beside_box(name, times):
    """Mean speed a fifth of D to one D off a box, in the jet's two planes, over the lattice's, of cuttings.

    Root of the mean square over places. The lattice has the whole velocity in the upright plane only.
    """
    field, case = load_past_box(name), find_case(name)
    low, high = (np.array(corner) for corner in case.boxes_D[0])
    upright = field.points_D()[0]
    gap = np.linalg.norm(np.maximum(np.maximum(low - upright, upright - high), 0.0), axis=-1)
    near = (gap > 0.2) & (gap < 1.0)
    theirs = np.hypot(field.along, field.down)[near]
    # About an axis that strikes square both planes are alike, and a jet may turn off in either.
    planes = [upright[near]] + ([upright[near][:, [0, 2, 1]]] if low[2] == -high[2] else [])
    found = []
    for k in range(times):
        body = Blockage.of(cut(cube(case), 3, 77 * k))
        water = new_water(bed_z_m=50.0, turbulence=0.25, spreading=JetSpreading.of_width(0.13), body=body)
        push(water, 4.0, [1.0], DEEP)
        means = [np.zeros_like(plane) for plane in planes]
        for _ in range(60):
            push(water, 0.1, [1.0], DEEP)
            for p, plane in enumerate(planes):
                means[p] += water.velocity(plane * D_M + np.array(DEEP)) / EXIT_M_S / 60
        ours2 = [np.sum(mean[:, [0, 2]] ** 2) if p == 0 else np.sum(mean[:, :2] ** 2) for p, mean in enumerate(means)]
        found.append(math.sqrt(np.mean(ours2) / np.sum(theirs**2)))
    return np.array(found)


def fastest_at_corals():
    """Fastest water 2 cm off three corals over U0, shape (27,): 1 N from .3, .45 and .6 m strikes or grazes them."""
    found = []
    for kind in ("branching", "brain", "plate"):
        target = place_on_bed(kind, coral(kind, 0), 1.5)
        body, (x, y, z) = Blockage.of(target), target.centre_W_m
        points, normals, _ = _surface(target, 600, np.random.default_rng(5))
        points = points + 0.02 * normals
        points = points[points[:, 2] < 1.49]
        for away in (0.3, 0.45, 0.6):
            for beside, above in ((0.0, 0.0), (0.07, 0.0), (0.0, 0.05)):
                water = new_water(bed_z_m=1.5, body=body)
                at = [[x - away, y + beside, z - above]]
                push(water, 4.0, [1.0], at)
                speeds = [np.linalg.norm(push(water, 0.5, [1.0], at).velocity(points), axis=1).max() for _ in range(16)]
                found.append(max(speeds) / EXIT_M_S)
    return np.array(found)
