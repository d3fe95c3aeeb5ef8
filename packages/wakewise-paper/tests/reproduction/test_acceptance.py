"""What the paper's tables are judged by, and what of them is met."""

from wakewise_paper.reproduction.claim import count_met, glances


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


def test_a_figure_counts_once_and_not_for_being_met_in_the_papers_own_water():
    """Three rows of one figure, one met at sea; another met only where the water is the planner's model."""

    def row(world, met, figure="f", paper=1.0, sure=True):
        return {"method": "m", "figure": figure, "paper": paper, "met": met, "sure": sure, "world": world}

    rows = [row("mud", False), row("reef", True), row("paper", True)]
    rows += [row("paper", True, "g"), row("mud", False, "g"), row("mud", True, "h", paper=None)]
    counted = {"quoted": 2, "met": 1, "surely": 1, "circular": 1, "own": 0, "own_judged": 0, "worlds": 2}
    assert count_met({"t": rows}) == counted
