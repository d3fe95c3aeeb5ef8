"""What of a campaign is compared with what."""

import pytest

from wakewise.core.errors import InputError
from wakewise.experiments.campaigns.definition import CampaignPlan, PlanEntry
from wakewise.experiments.campaigns.summary import measures, method_contrasts, paired_groups
from wakewise.experiments.campaigns.table import Results, TrialRecord


def campaign(trials):
    """Trials from rows of (method, target, world, seed, figures or None or "waiting")."""
    made = []
    for k, (method, target, world, seed, figures) in enumerate(trials):
        factors = {"method": method, "target": target, "world": world, "seed": seed}
        state = "waiting" if figures == "waiting" else "failed" if figures is None else "done"
        entry = PlanEntry(key=f"k{k}", name=f"{method}/{seed}", factors=factors)
        known = figures if isinstance(figures, dict) else {}
        reason = "it fell over" if figures is None else None
        made.append(TrialRecord(entry=entry, state=state, figures=known, reason=reason, attempts=1, took_s=2.0))
    plan = CampaignPlan(
        name="first", campaign={"methods": ["dp"]}, wakewise="0", sources="s", trials=tuple(m.entry for m in made)
    )
    return Results(plan=plan, made=tuple(made), drivers=0, others=0)


def speeds(mm_s):
    return {"target_speed_mean_m_s": 1e-3 * mm_s, "energy_kJ": 1.0}


def test_methods_are_compared_in_each_world():
    """A winner in one water is none in another; the speed of the water leads where no model was made."""
    rows = [(m, "brain", w, k, speeds(v + 0.1 * k)) for k in range(4) for m, w, v in
            [("dp", "mud", 9), ("ours", "mud", 3), ("dp", "reef", 2), ("ours", "reef", 8)]]  # fmt: skip
    found = paired_groups(campaign(rows))
    assert [measure.figure for measure in measures(found)] == ["target_speed_mean_m_s", "energy_kJ"]
    winners = {(measure.figure, one.world): one.winner for measure, one in method_contrasts(found)}
    assert winners["target_speed_mean_m_s", "mud"] == "ours" and winners["target_speed_mean_m_s", "reef"] == "dp"


def test_worlds_are_compared_where_that_is_asked():
    """What is compared is told by name; the rest of what differs is where."""
    rows = [("dp", t, w, k, speeds(v)) for k in range(3) for t in ("a", "b") for w, v in [("mud", 9), ("reef", 1)]]
    found = paired_groups(campaign(rows), "world")
    assert {(place["method"], place["world"]) for place in found} == {("mud", "all"), ("reef", "all")}
    (measure, one), *_ = method_contrasts(found)
    assert (measure.figure, one.winner, one.trials) == ("target_speed_mean_m_s", "reef", 6)


def test_what_has_not_ended_is_not_compared_and_what_failed_counts():
    """A pair needs both; a failure keeps its reason."""
    rows = [("dp", "a", "mud", 1, speeds(5)), ("ours", "a", "mud", 1, speeds(4))]
    rows += [("dp", "a", "mud", 2, speeds(5)), ("ours", "a", "mud", 2, "waiting"), ("ours", "a", "mud", 3, None)]
    found = paired_groups(campaign(rows))
    assert len(found) == 4 and found[-1]["reason"] == "it fell over"
    assert method_contrasts(found)[0][1].trials == 1 and method_contrasts(found)[0][1].failed == {"dp": 0, "ours": 1}


@pytest.mark.parametrize("compare", ["seed", "colour"])
def test_what_is_no_factor_cannot_be_compared(compare):
    """In one line with what can."""
    with pytest.raises(InputError, match="allowed: method, target, world"):
        paired_groups(campaign([("dp", "a", "mud", 1, speeds(1))]), compare)
