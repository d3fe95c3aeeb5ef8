"""Rows of parameters: every group is there, missing ones are marked, sources and estimates follow the file."""

from dataclasses import replace

from wakewise.robot.vehicles import ParameterRow, load_draft, parameters


def row(rows: list[ParameterRow], quantity: str) -> ParameterRow:
    return next(r for r in rows if r.quantity.startswith(quantity))


def test_values_carry_unit_source_and_mark() -> None:
    rows = parameters(load_draft("paper"))
    mass, inertia = row(rows, "mass"), row(rows, "inertia")
    assert (mass.value, mass.unit, mass.source, mass.estimate) == (
        "4.5",
        "kg",
        "the paper's table of the vehicle",
        False,
    )
    assert (inertia.value, inertia.estimate) == ("0.075, 0.105, 0.122", True)
    assert row(rows, "propeller").value == "0.06"
    assert row(rows, "horizontal field").value == "90"


def test_what_is_missing_has_no_value_and_no_source() -> None:
    rows = parameters(load_draft("orca"))
    assert {r.quantity for r in rows if r.value is None} >= {"displaced volume", "propeller diameter", "camera place"}
    assert all(r.source == "" and not r.estimate for r in rows if r.value is None)


def test_couplings_and_products_are_hinted_at() -> None:
    rows = parameters(load_draft("rexrov"))
    assert row(rows, "inertia").value == "525.39, 794.2, 691.23 (products up to 33.41)"
    assert row(rows, "added mass: coupling").value == "up to 409.44"


def test_thrusters_that_differ_are_listed_in_turn() -> None:
    paper = load_draft("paper")
    mixed = replace(paper, thrusters=(replace(paper.thrusters[0], max_forward_N=None), *paper.thrusters[1:3]))
    assert row(parameters(mixed), "thrust forward").value == "?, 51, 51"


def test_a_thrust_table_is_shown_where_there_is_one() -> None:
    assert row(parameters(load_draft("bluerov2-heavy")), "thrust table").value == "t200 at 16 V"
    assert not any(r.quantity == "thrust table" for r in parameters(load_draft("rexrov")))
