"""What `wakewise bench operator` measures beside its flights: the cockpit's latency, and the coverage guide's word.

It is put together here since the bench, a study, lies below the cockpit.
"""

from __future__ import annotations

from typing import Any

from wakewise.core.errors import WakewiseError
from wakewise.experiments.trials import BenchOptions

LATENCY_S, BUSY = 20.0, 2
_SCANS: dict[str, dict[str, Any]] = {
    "scan": {},
    "one_orbit": {"mission.elevations_deg": [40.0], "mission.views": [16]},
}
"""A whole scan, and a pilot who leaves after one orbit."""


def add_cockpit(result: dict[str, Any], options: BenchOptions) -> None:
    """Add `latency_ms_p99`, `coverage_agreement_pct` and `coverage_ms_per_photo`, with what lies behind them.

    Latency is from a stick's message to thrusts, in `wakewise cockpit` on the default scenario with a page that takes
    every picture, while two more processes keep both cores busy. Coverage is said of the photographs of two trials of
    the quick preset and held against their models. What cannot be measured stays null, with the reason in `why`.
    """
    result["cockpit"] = _measured(result, options, ("latency_ms_p99",), _latency)
    result["coverage"] = _measured(result, options, ("coverage_agreement_pct", "coverage_ms_per_photo"), _coverage)


def _measured(result: dict[str, Any], options: BenchOptions, keys: tuple[str, ...], measure: Any) -> Any:
    try:
        found, figures = measure(options)
    except WakewiseError as fault:
        result["why"] |= dict.fromkeys(keys, str(fault))
        return None
    result |= figures
    for key in keys:
        result["why"].pop(key, None)
    return found


def _latency(options: BenchOptions) -> tuple[dict[str, Any], dict[str, Any]]:
    from wakewise.core.optional_dependencies import need
    from wakewise.operation import load_scenario
    from wakewise_paper.cockpit_latency import measure

    need("the cockpit's latency", "cockpit")
    scenario = load_scenario("quick", None, {})
    free = measure(scenario, LATENCY_S, progress=options.progress)
    busy = measure(scenario, LATENCY_S, busy=BUSY, progress=options.progress)
    found = {"free": free.figures(), "busy": busy.figures()}
    return found, {"latency_ms_p99": busy.latency_ms_p99}


def _coverage(options: BenchOptions) -> tuple[dict[str, Any], dict[str, Any]]:
    from wakewise.experiments.campaigns.study import store_folder
    from wakewise.experiments.campaigns.task import PHOTOGRAPHS, source_version
    from wakewise.experiments.trials import run_trial
    from wakewise.experiments.trials.coverage import measure_coverage
    from wakewise.operation import load_scenario

    folder = (options.store or store_folder("operator")) / "scans" / source_version(PHOTOGRAPHS)
    found: dict[str, Any] = {}
    for done, (name, changes) in enumerate(_SCANS.items()):
        options.progress(done, len(_SCANS), f"coverage: {name}")
        run_trial(load_scenario("quick", None, changes), folder / name)
        found[name] = measure_coverage(folder / name)
    whole = found["scan"]
    return found, {key: whole[key] for key in ("coverage_agreement_pct", "coverage_ms_per_photo")}
