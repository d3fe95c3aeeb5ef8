"""The study of failing models, and the front of wash against energy."""

import json

import pytest

from wakewise.core.errors import InputError
from wakewise.experiments.campaigns.flights import FLY, scenario_of
from wakewise.experiments.campaigns.study import StudyResult
from wakewise.experiments.trials.timing import BenchOptions
from wakewise.ui.cli.main import run
from wakewise_paper.cli.bench_models import show_front, show_models
from wakewise_paper.model_failure import bench
from wakewise_paper.model_failure.cases import USUAL, PartFile, cases_of, load_parts
from wakewise_paper.reports.models_bench_plot import draw_front, draw_models
from wakewise_paper.reproduction.table_trials import METHOD_PLACES
from wakewise_paper.wash_reduction import energy_front


def case_names():
    """Every case of every part."""
    return [(part, case.name) for part in load_parts() for case in cases_of(part)]


@pytest.mark.slow
@pytest.mark.parametrize(("part", "name"), case_names())
def test_every_case_is_a_scan_that_can_begin(part, name):
    """Its fields are a scenario's, with few target points; what is checked before a flight finds nothing."""
    case = next(case for case in cases_of(part) if case.name == name)
    settings = case.trial(case.methods[-1], 2101).task.settings
    scenario = scenario_of(settings | {"scenario": {**settings["scenario"], "target.points": 60}})
    parts = scenario.parts()
    assert parts.preflight.clearance_m >= parts.scenario.mission.clearance_m


def test_one_quantity_differs_from_the_usual_case():
    """Each value of an axis changes its own field alone, and is told in the axis' unit."""
    usual, *others = cases_of("doses")
    assert usual.name == USUAL and usual.doses["trim"] == 4.0 and usual.doses["stiffness"] == 8.0
    for case in others:
        (axis,) = case.doses
        field = load_parts()["doses"].axes[axis].field
        changed = {key for key in case.fields if case.fields[key] != usual.fields.get(key)}
        assert changed == {field}
    assert next(case for case in others if case.name == "exposure=33").fields["imaging.exposure_s"] == 0.033


def test_a_part_holds_cases_or_axes():
    """Neither and both are refused."""
    with pytest.raises(ValueError, match="must hold one of them"):
        PartFile(title="part", first_seed=1, seeds=1, methods=("dp",), fields={})


def made_up(trials):
    """A study's result with figures by method and seed."""
    rows, failures = {}, {}
    for part, case, method, seed in trials:
        better = 0.5 if method == "wake-aware" else 0.0
        spread = 0.01 * (seed % 5)
        rows[part, case, method, seed] = {
            "rmse_mm": 2.0 - better + spread,
            "completeness_pct": 90.0,
            "completeness_1mm_pct": 60.0,
            "success": float(method == "wake-aware" or seed % 3 > 0),
            "target_speed_mean_m_s": 0.01 * (1.0 - better) * (1.0 + spread),
            "energy_kJ": 1.0 + better,
            "sway_wash_mm": None,
        }
    return StudyResult(rows, failures, frozenset())


def test_differences_are_of_pairs_of_one_seed():
    """RMSE by the difference, wash and energy by the ratio, each with its number of pairs; success as a share."""
    cases = cases_of("sheltered")
    trials = bench.planned({"sheltered": cases}, ("dp", "wake-aware"), 6)
    assert len(trials) == 12
    part = bench.part_figures("sheltered", cases, ("dp", "wake-aware"), made_up(trials))
    dp, ours = part["rows"]
    assert "rmse_mm_more" not in dp and dp["success_pct"] == pytest.approx(100.0 * 4 / 6)
    assert ours["rmse_mm_more"] == pytest.approx(-0.5) and ours["rmse_mm_more_pairs"] == 6
    assert ours["target_speed_mean_m_s_ratio"] == pytest.approx(0.5)
    assert ours["sway_wash_mm_ratio"] is None and ours["sway_wash_mm_ratio_pairs"] == 0
    assert ours["success_interval_pct"][1] == 100.0 and ours["success_interval_pct"][0] < 100.0


def test_a_part_with_one_method_is_held_against_its_first_case():
    """What helps is told over what is flown without help."""
    cases, methods = cases_of("advice"), ("dp", "weighted-pseudo-inverse", "wake-aware")
    trials = bench.planned({"advice": cases}, methods, 2)
    part = bench.part_figures("advice", cases, methods, made_up(trials))
    first, *others = part["rows"]
    assert (first["case"], first["method"]) == ("unchanged", "dp") and "rmse_mm_more" not in first
    for row in others:
        assert row["rmse_mm_more"] == pytest.approx(-0.5 if row["method"] == "wake-aware" else 0.0)


@pytest.mark.parametrize("part", load_parts())
def test_a_row_names_the_method_that_was_flown(part):
    """What a trial's scenario has is what its factors and the table say, but for the place of a plug-in."""
    for case in cases_of(part):
        for method in case.methods:
            trial = case.trial(method, 2101)
            assert trial.method == method
            assert trial.task.settings["scenario"]["method"] in (method, METHOD_PLACES.get(method))


def test_a_model_that_was_not_made_counts_as_the_worst_in_differences():
    """Else a method that fails where it is hard would look better; in means it has no part."""
    ours = {1: {"rmse_mm": 1.0}, 2: None, 3: {"rmse_mm": None}}
    theirs = {seed: {"rmse_mm": 2.0} for seed in (1, 2, 3)}
    told = bench.against(ours, theirs)
    assert (told["rmse_mm_more"], told["rmse_mm_more_pairs"]) == (pytest.approx((-1.0 + 18.0 + 18.0) / 3.0), 3)
    assert bench.model_figures(ours)["rmse_mm"] == 1.0


def test_silt_is_told_of_flights_without_models(capsys):
    """Such a trial is a flight; its part has ratios of silt over the first method, and no success."""
    cases, methods = cases_of("silt"), ("dp", "wake-aware")
    trials = bench.planned({"silt": cases}, methods, 3)
    assert {trial.task.work for trial in trials.values()} == {FLY}
    clouded = {"dp": 0.4, "wake-aware": 0.6}
    rows = {
        key: {"ray_optical_depth": clouded[key[2]] * (1.0 + 0.1 * (key[3] % 3)), "silt_lifted_g": 50.0}
        for key in trials
    }
    part = bench.part_figures("silt", cases, methods, StudyResult(rows, {}, frozenset()))
    first, second = part["rows"][:2]
    assert first["flights"] == 3 and "success_pct" not in first and "ray_optical_depth_ratio" not in first
    assert second["ray_optical_depth_ratio"] == pytest.approx(1.5) and "rmse_mm_more" not in second
    show_models({"parts": {"silt": part}, "flights": 6, "failed": 0, "failures": []})
    assert "1.50" in capsys.readouterr().out


def test_doses_are_drawn_and_shown(tmp_path, capsys):
    """A picture of the doses, a table of every part; without doses it is said what is missing."""
    cases = {part: cases_of(part) for part in ("doses", "sheltered")}
    trials = bench.planned(cases, ("dp", "mpc", "weighted-pseudo-inverse", "wake-aware"), 2)
    made = made_up(trials)
    parts = {part: bench.part_figures(part, own, ("dp", "wake-aware"), made) for part, own in cases.items()}
    result = {"parts": parts, **made.counts}
    draw_models(result, tmp_path / "doses.svg")
    assert (tmp_path / "doses.svg").stat().st_size > 5000
    show_models(result)
    assert "as usual" in capsys.readouterr().out
    with pytest.raises(InputError, match="part 'doses', which was not made"):
        draw_models({"parts": {}}, tmp_path / "none.svg")
    with pytest.raises(InputError, match="ending"):
        draw_models(result, tmp_path / "doses.txt")
    with pytest.raises(InputError, match="no doses were flown by these methods"):
        draw_models({"parts": {"doses": parts["doses"] | {"rows": []}}}, tmp_path / "none.svg")


def test_an_unknown_part_is_refused():
    """In one line with what there is."""
    with pytest.raises(InputError, match="--scenarios: 'dose' is not known, allowed: mechanisms, doses"):
        bench.run(BenchOptions(scenarios=("dose",)))
    with pytest.raises(InputError, match="--methods: needs dp, which the others of part sheltered are held against"):
        bench.run(BenchOptions(scenarios=("sheltered",), methods=("wake-aware",)))
    with pytest.raises(InputError, match="--methods: needs dp"):
        energy_front.run(BenchOptions(seeds=2, methods=("wake-aware",)))
    with pytest.raises(InputError, match="--seeds 9: the front has 8 seeds"):
        energy_front.run(BenchOptions(seeds=9))


def point(energy, wash):
    """A place of the front."""
    return {"energy": energy, "wash": wash}


def test_the_knee_is_where_more_energy_stops_to_pay():
    """Farthest below the line between both ends; of two points there is none."""
    bent = {"a": point(1.0, 1.0), "b": point(1.1, 0.3), "c": point(1.5, 0.25), "d": point(2.0, 0.2)}
    assert energy_front.knee(bent) == "b"
    assert energy_front.knee({"a": point(1.0, 1.0), "b": point(2.0, 0.5)}) is None


def test_a_front_is_read_at_an_energy_within_its_range():
    """Linear in logarithms; None outside."""
    points = [point(1.0, 1.0), point(4.0, 0.25)]
    assert energy_front.interpolated(points, 2.0) == pytest.approx(0.5)
    assert energy_front.interpolated(points, 5.0) is None and energy_front.interpolated([], 1.0) is None


def test_the_front_of_a_place_holds_every_rival_at_its_energy(tmp_path, capsys):
    """Ours at the same energy over the rival's wash; drawn and shown."""
    wash = {"dp": 1.0, "no-forward-jets": 0.5, "weighted-pseudo-inverse": 0.6, "allocation-only": 0.5}
    energy = {"dp": 1.0, "no-forward-jets": 1.3, "weighted-pseudo-inverse": 1.2, "allocation-only": 9.0}
    for k, name in enumerate(energy_front.LIMITS):
        wash[name], energy[name] = 0.9 - 0.2 * k, 1.0 + 0.1 * k
    rows = {
        ("payload", method, seed): {"target_speed_mean_m_s": 0.01 * wash[method] * seed, "energy_kJ": energy[method]}
        for method in energy_front.METHODS
        for seed in (1, 2)
    }
    place = energy_front.front_of("payload", energy_front.METHODS, rows)
    assert place["methods"]["dp"]["wash"] == pytest.approx(1.0)
    against = place["wash_ratio_at_equal_energy"]
    assert against["weighted-pseudo-inverse"] == pytest.approx(0.5 / 0.6)
    assert against["allocation-only"] is None
    result = {"places": {"payload": place}, "flights": 2, "failed": 0, "failures": []}
    draw_front(result, tmp_path / "front.png")
    assert (tmp_path / "front.png").stat().st_size > 5000
    show_front(result)
    assert "outside the front" in capsys.readouterr().out


def test_the_benches_are_listed_and_refuse_a_picture_that_they_do_not_draw(capsys):
    """`bench` lists both; `--plot` names those that draw."""
    assert run(["bench", "--json"]) == 0
    assert {"models", "front"} <= set(json.loads(capsys.readouterr().out)["benches"])
    for words, said in (
        (["dynamics", "--plot", "x.svg"], "those that do: front, gentle, models, operator"),
        (["models", "--scenarios", "advice", "--plot", "x.svg"], "draws doses, which --scenarios leaves out"),
        (["truth", "--only", "dynamics", "--plot", "x.svg", "--data", "."], "draws cube_channel, which --only leaves"),
        (["models", "--methods", ","], "--methods ',': no name in it"),
        (["dynamics", "--only", "dynamics"], "--only: of `wakewise bench truth` and `wakewise bench gpu` alone"),
    ):
        assert run(["bench", *words]) == 2
        assert said in " ".join(capsys.readouterr().err.split())
