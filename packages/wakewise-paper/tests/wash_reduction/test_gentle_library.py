"""Scenarios of the gentle bench: files with sources, one world for all methods, names."""

import pytest

from wakewise.core.errors import InputError
from wakewise_paper.wash_reduction.bench import METHODS
from wakewise_paper.wash_reduction.flight import TRIM, parts_of, wrong_current_m_s
from wakewise_paper.wash_reduction.scenario_files import (
    SCENARIOS,
    VEHICLES,
    fields_of,
    load_scenario_file,
    names_of,
    sample_conditions,
)


@pytest.mark.parametrize("name", SCENARIOS)
def test_every_scenario_says_why_and_whence(name):
    """Numbers have sources; what every world draws is drawn, but in the plain tank."""
    file = load_scenario_file(name)
    assert len(file.why) > 40 and file.trims_source and file.current_source
    assert all(field.source for field in file.fields.values())
    _, draws = fields_of(name)
    assert ("tank.jets.half_width_growth" in draws) == (name != "calm")


@pytest.mark.parametrize("name", SCENARIOS)
def test_what_a_seed_draws_lies_within_its_stratum(name):
    """Trim and current's speed are where the file has them; no two scenarios share a seed."""
    file = load_scenario_file(name)
    for seed in range(1, 10):
        found = sample_conditions(name, seed)
        low, high = file.trims_N[found.trim]
        assert low <= found.trim_N <= high
        north, east, _ = found.current_W_m_s
        assert file.current_m_s[0] - 1e-4 <= (north**2 + east**2) ** 0.5 <= file.current_m_s[1] + 1e-4
    assert len({sample_conditions(other, 1).seed for other in SCENARIOS}) == len(SCENARIOS)


@pytest.mark.slow
def test_methods_and_levers_of_one_seed_meet_the_same_world(monkeypatch):
    """Trials of one seed differ in method and control alone, in scenarios and in worlds."""
    monkeypatch.setattr("wakewise_paper.flights.HOVER_S", 7.0)  # of those before a trim; it is enough for one
    for scenario in ("close/bluerov2-heavy", "world/mud"):
        plain = parts_of(scenario, "dp", 2)
        for method, more in (
            ("wake-aware", {}),
            ("wake-aware" + TRIM, {}),
            ("wake-aware", {"control": {"allocation.advection": False}}),
            ("wake-aware", {"wrong_current": True}),
        ):
            other = parts_of(scenario, method, 2, **more)
            same = other.scenario.model_copy(update={"control": plain.scenario.control, "method": "dp"})
            assert same == plain.scenario
            assert other.route.duration_s == plain.route.duration_s
            assert (other.start.X_WB.p_m == plain.start.X_WB.p_m).all()


def test_a_wrong_current_is_wrong_by_what_it_says():
    """A third too fast or too slow, and turned by 30 deg to either side; the seeds draw all four."""
    ways = set()
    for seed in range(30):
        north, east, down = wrong_current_m_s((0.1, 0.0, 0.0), seed)
        assert down == 0.0 and abs(east / north) == pytest.approx(3**-0.5, rel=1e-3)
        ways.add((round((north**2 + east**2) ** 0.5, 3), east > 0.0))
    assert ways == {(0.13, True), (0.13, False), (0.07, True), (0.07, False)}


def test_names_stand_for_vehicles_and_worlds():
    """`orbit` is flown by both vehicles, `worlds` are nine; all by default; others are refused."""
    assert names_of(("orbit",)) == tuple(f"orbit/{vehicle}" for vehicle in VEHICLES)
    assert len(names_of(("worlds",))) == 9 and names_of(("world/mud", "calm/paper")) == ("calm/paper", "world/mud")
    assert len(names_of(None)) == len(SCENARIOS) * len(VEHICLES) + 9 and names_of(()) == ()
    with pytest.raises(InputError, match="allowed: orbit"):
        names_of(("magic",))
    assert METHODS[0] == "dp"
