"""Drag as other sources have it."""

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.robot.vehicles import (
    DragCase,
    draft_yaml,
    drag_coefficients,
    load_draft,
    load_vehicle,
    possible_drags,
    with_drag,
)
from wakewise.robot.vehicles.library import parse_vehicle

HOVER_M_S = 0.036
"""The default current, which a hovering vehicle holds against."""


@pytest.mark.parametrize("name", ["paper", "bluerov2-heavy"])
@pytest.mark.parametrize("speed_m_s", [0.01, 0.036, 0.5])
def test_a_box_has_the_drag_of_a_box_at_every_speed(name: str, speed_m_s: float) -> None:
    """1.05 on each face of the vehicle's own outer box, to the rounding of the file."""
    box = with_drag(load_vehicle(name), "box")
    assert drag_coefficients(box, speed_m_s) == pytest.approx(np.full(3, 1.05), rel=2e-4)


def test_the_believed_drag_at_hover_is_three_boxes() -> None:
    """Linear terms that were identified at cruise count most at hover: 3.1 in surge and 3.7 in sway."""
    assert drag_coefficients(load_vehicle("paper"), HOVER_M_S)[:2] == pytest.approx([3.06, 3.69], abs=0.01)


def test_the_papers_identified_case_has_the_coefficients_of_the_heavy() -> None:
    """Scaling by frontal area is keeping the coefficients."""
    scaled, heavy = with_drag(load_vehicle("paper"), "von-benzon"), load_vehicle("bluerov2-heavy")
    assert drag_coefficients(scaled, HOVER_M_S) == pytest.approx(drag_coefficients(heavy, HOVER_M_S), rel=0.005)


def test_a_case_changes_damping_and_nothing_else() -> None:
    """Added mass, thrusters and name stay; as believed is the vehicle itself."""
    heavy = load_vehicle("bluerov2-heavy")
    other = with_drag(heavy, "wu-2018")
    assert np.diag(other.hydrodynamics.linear_damping)[:3].tolist() == [4.03, 6.22, 5.18]
    assert np.array_equal(other.hydrodynamics.added_mass, heavy.hydrodynamics.added_mass)
    assert (other.name, other.thrusters, other.mass_kg) == (heavy.name, heavy.thrusters, heavy.mass_kg)
    assert with_drag(heavy, "nominal") is heavy


def test_a_seed_draws_each_case_alike() -> None:
    """Believed, box and Wu: a third of the draws each, within three sigma of 600."""
    heavy = load_vehicle("bluerov2-heavy")
    drawn = [
        with_drag(heavy, "random", np.random.default_rng(seed)).hydrodynamics.quadratic_damping[0, 0]
        for seed in range(600)
    ]
    counts = [drawn.count(value) for value in (141.0, 76.67, 18.18)]
    assert sum(counts) == 600
    assert min(counts) > 200 - 35


def test_without_cases_a_draw_is_the_believed_drag() -> None:
    """There is nothing else to draw."""
    rexrov = load_vehicle("rexrov")
    assert with_drag(rexrov, "random", np.random.default_rng(1)) is rexrov


def test_what_may_be_drawn_is_told() -> None:
    """All sets for `random`, else the one that is named."""
    paper = load_vehicle("paper")
    assert possible_drags(paper, "random") == ("nominal", "box", "von-benzon")
    assert possible_drags(paper, "box") == ("box",)


def test_a_case_that_is_not_there_is_refused() -> None:
    """One line tells which there are; reserved names and damping that pushes are refused in the file."""
    with pytest.raises(InputError, match=r"tank.mismatch.drag: 'bx', paper .* nominal, box, von-benzon, random"):
        with_drag(load_vehicle("paper"), "bx")
    with pytest.raises(InputError, match="drag_cases: random is not a name"):
        DragCase(
            name="random",
            source="x",
            estimate=False,
            linear_damping=np.zeros((6, 6)),
            quadratic_damping=np.zeros((6, 6)),
        )
    text = draft_yaml(load_draft("bluerov2-heavy"))
    with pytest.raises(InputError, match=r"drag_cases\.wu-2018"):
        parse_vehicle(text.replace("quadratic_N_s2_m2: [18.18, 21.66, 36.99]", ""), "x.yaml", "x")
