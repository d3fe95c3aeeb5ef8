"""Campaigns: many trials, made on one computer or on many, each once, resumable after any interruption.

- `definition.py`: the campaign file (`example.yaml`); its trials; plan.json, which says what a folder was made for.
- `flights.py`: what a trial does: a flight with setup functions and probes, or a whole scan.
- `pictures.py`: what a trial keeps.
- `study.py`: a campaign whose trials a program lists.
- `task.py`: one trial as plain values, its key and its outcome. `store.py`: the folder of a campaign.
- `run.py`: the driver's loop. `engines.py`: processes of this computer, or a Dask cluster.
- `worker.py`: the process that makes trials. `worker_process.py`: starts and watches it.
- `trial_lock.py`: which process has a trial. `attempt_log.py`: how often it was tried, and how that ended.
- `index.py`: a cache of all folders. `table.py`: means with intervals.
- `summary.py`: the first method against the next best.
- `statistics.py`: intervals, paired tests, corrections, sample sizes.
"""

from typing import TYPE_CHECKING

from wakewise.core.lazy_imports import lazy_attributes

if TYPE_CHECKING:
    from wakewise.experiments.campaigns.definition import Campaign, load_campaign, planned_trials
    from wakewise.experiments.campaigns.engines import ProcessExecutor, TrialExecutor
    from wakewise.experiments.campaigns.run import run
    from wakewise.experiments.campaigns.task import FLIES, PHOTOGRAPHS, Task, TrialOutcome

__all__ = [
    "FLIES",
    "PHOTOGRAPHS",
    "Campaign",
    "ProcessExecutor",
    "Task",
    "TrialExecutor",
    "TrialOutcome",
    "load_campaign",
    "planned_trials",
    "run",
]

lazy_attributes(__name__)
