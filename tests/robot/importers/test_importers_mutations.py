"""A good file with anything in it changed gives a refusal in one line, or a vehicle whose forces have unit length."""

import random
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from test_importers_bad_input import WHOLE

from wakewise.core.errors import InputError
from wakewise.robot.importers import import_vehicle
from wakewise.robot.importers.thruster_checks import UNIT_SLACK
from wakewise.robot.vehicles import check_report
from wakewise.robot.vehicles.draft import MAX_THRUSTERS

MATRICES = {
    "b.yaml": "thruster_names: [a, b, c]\ntam: [[1,0,0],[0,1,0],[0,0,1],[0,0,0.2],[0,0,-0.3],[0.5,-0.5,0]]\nmass: 3\n",
    "c.yaml": "thrusters:\n- {name: a, pose: [1, 0, 0, 0, 0, 0.785]}\n- {name: b, pose: [-1, 0, 0, 0, 0, -0.785]}\n",
    "d.yaml": "thruster_positions: [[1,0,0],[0,1,0],[0,0,1],[1,1,1]]\n"
    "thruster_orientations: [[0,0,45],[0,0,-45],[0,90,0],[0,-90,0]]\nframe: vectored_4dof\n",
    "e.xacro": """<robot name="r" xmlns:xacro="http://ros.org/wiki/xacro">
<xacro:property name="p" value="${[0.1, 0.2, 0.3]}"/>
<xacro:property name="at" value="0.1 0.2 0.3 0 0 0.5"/><link name="base_link"/><link name="thruster_1"/>
<joint name="j" type="fixed"><parent link="base_link"/><child link="thruster_1"/>
<origin xyz="${' '.join(at.split()[0:3])}" rpy="0 0 ${p[1:][0]}"/></joint></robot>""",
}
GOOD = {**WHOLE, **MATRICES}
NUMBER = re.compile(r"(?<![\w.])-?\d+\.?\d*(?:e-?\d+)?")
WORDS = re.compile(r"[A-Za-z_]{3,}")
TOKENS = ("NaN", "1e308", "", "${", "]", "[[", "<", "[/red]", "pose", "rpy", "thruster_1", "6dof", "- ", "\x1b[31m")
FIGURES = ("0", "1", "-1", "45", "0.5", "1.570796", "-90", "180", "7", "1e-9", "1e6", "0.7071", "3")


def mutated(text: str, rng: random.Random) -> str:
    """One small change of the kinds that people and machines make."""
    kind = rng.randrange(6)
    numbers, words = list(NUMBER.finditer(text)), list(WORDS.finditer(text))
    at = rng.randrange(len(text) + 1)
    if kind <= 1 and numbers:
        match = rng.choice(numbers)
        return text[: match.start()] + rng.choice(FIGURES) + text[match.end() :]
    if kind == 2 and words:
        one, other = rng.choice(words), rng.choice(words)
        return text[: one.start()] + other[0] + text[one.end() :]
    if kind == 3:
        lines = text.splitlines(keepends=True)
        line = rng.choice(lines)
        return text.replace(line, rng.choice(("", line * 2)), 1)
    if kind == 4:
        return text[:at] + rng.choice(TOKENS) + text[at:]
    return text[:at] + text[at + rng.choice((1, 5, 40)) :]


def require_sound(path: Path) -> None:
    """Read a file; what is read has unit forces, no more thrusters than the cap, and can be checked."""
    try:
        draft = import_vehicle(path, skip_missing=True)
    except InputError as fault:
        assert "\n" not in str(fault) and len(str(fault)) < 1000
        return
    if not draft.thrusters and draft.shipped_matrix is None:
        return
    matrix = draft.allocation_matrix
    assert 0 < matrix.shape[1] <= MAX_THRUSTERS
    np.testing.assert_allclose(np.linalg.norm(matrix[:3], axis=0), 1.0, atol=UNIT_SLACK + 1e-12)
    assert np.isfinite(matrix).all()


@pytest.mark.parametrize("name", list(MATRICES))
def test_the_unbroken_files_load(tmp_path: Path, name: str) -> None:
    """What is spoiled below is read as it stands."""
    (tmp_path / name).write_text(GOOD[name])
    draft = import_vehicle(tmp_path / name)
    assert check_report(draft, None)["rank"] >= 1


@settings(max_examples=300, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.sampled_from(sorted(GOOD)), st.integers(0, 2**32 - 1), st.integers(1, 4))
def test_no_mutation_gives_a_traceback_or_a_vehicle_of_other_forces(
    tmp_path: Path, name: str, seed: int, times: int
) -> None:
    """A file spoiled in up to four places is refused in one line, or read with columns of unit force."""
    rng, text = random.Random(seed), GOOD[name]
    for _ in range(times):
        text = mutated(text, rng) or " "
    (tmp_path / name).write_text(text)
    require_sound(tmp_path / name)


UNIT = st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda v: np.linalg.norm(v) > 0.1)
LEVER = st.tuples(*[st.floats(-0.9, 0.9)] * 3)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(st.tuples(UNIT, LEVER), min_size=1, max_size=9), st.sampled_from(["rows", "columns", "flat", "poses"]))
def test_any_matrix_is_read_as_its_geometry_has_it(
    tmp_path: Path, thrusters: list[tuple[tuple[float, ...], tuple[float, ...]]], way: str
) -> None:
    """Random thrusters written as rows, columns, flat or as places give one matrix, unless the reader questions it."""
    axes = np.array([axis for axis, _ in thrusters]) / np.linalg.norm([axis for axis, _ in thrusters], axis=1)[:, None]
    places = np.array([place for _, place in thrusters])
    matrix = np.hstack([axes, np.cross(places, axes)]).T
    text = {
        "rows": f"tam: {matrix.T.tolist()}",
        "columns": f"tam: {matrix.tolist()}",
        "flat": f"tam: {matrix.ravel().tolist()}",
        "poses": "thrusters:\n"
        + "".join(
            f"- {{position: {p.tolist()}, direction: {a.tolist()}}}\n" for p, a in zip(places, axes, strict=True)
        ),
    }[way]
    path = tmp_path / "m.yaml"
    path.write_text(f"body_frame: base_link_frd\n{text}")
    draft = import_vehicle(path)
    if not any("QUESTIONED" in note for note in draft.notes):
        np.testing.assert_allclose(draft.allocation_matrix, matrix, atol=1e-9)
