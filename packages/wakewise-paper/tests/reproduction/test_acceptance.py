"""What the paper's tables are judged by, and what of them is met."""

from wakewise_paper.reproduction.claim import glances, setup_of, tallies


def place(method, seed, rmse, energy=1.0, target="brain", world="pump-tank"):
    """A trial as a page is told of it."""
    figures = {} if rmse is None else {"rmse_mm": rmse, "energy_kJ": energy}
    return {"world": world, "method": method, "target": target, "seed": seed, "folder": "x", "figures": figures,
            "reason": None if rmse is not None else "no model"}  # fmt: skip


def test_worlds_are_judged_apart_and_tables_without_methods_not_at_all():
    """A winner in one water is none in another."""
    places = [place("a", 1, 1.0), place("b", 1, 2.0), place("a", 1, 3.0, world="mud"), place("b", 1, 1.0, world="mud")]
    assert [one.winner for one in glances("dynamic", places)] == ["a", "b"]
    assert glances("wake", places) == []


def row(world, met, figure="f", *, paper=1.0, sure=True, by_all=False, preliminary=False):
    """A row of a table, judged."""
    return {"method": "m", "figure": figure, "paper": paper, "met": met, "sure": sure, "world": world,
            "setup": setup_of(world, None), "met_by_all": by_all, "preliminary": preliminary}  # fmt: skip


def test_figures_are_counted_set_up_by_set_up_and_the_papers_own_comes_first():
    """A figure that is met at sea alone is not met in the paper's own set-up; the circular world stands last."""
    rows = [row("paper", True), row("reef", True), row("pump-tank", False), row("pump-tank", True, "g", sure=False)]
    rows += [row("reef", True, "h", paper=None), row("reef", None, "i")]
    told = [(one.setup, one.met, one.judged, one.surely) for one in tallies({"t": rows})]
    assert told == [("the paper's own", 1, 2, 0), ("reef", 1, 1, 1), ("paper", 1, 1, 1)]


def test_what_every_method_meets_and_what_few_pairs_meet_is_counted_beside():
    """Of the figures that are met; one that is not met counts in neither."""
    rows = [
        row("reef", True, by_all=True),
        row("reef", True, "g", preliminary=True),
        row("reef", False, "h", sure=True),
    ]
    (one,) = tallies({"t": rows})
    assert (one.judged, one.met, one.surely, one.by_all, one.preliminary) == (3, 2, 2, 1, 1)


def test_flows_and_what_is_not_flown_are_set_ups_of_their_own():
    """A wake model is held against each flow by itself."""
    assert [setup_of("-", "oracle"), setup_of("-", None), setup_of("reef", None)] == [
        "flow oracle",
        "no flight",
        "reef",
    ]
