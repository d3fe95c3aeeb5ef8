"""Campaigns: many trials, made on one computer or a cluster, each once, whatever is killed on the way.

What people write is a campaign file (`definition.py`, `definition.py`), whose trials fly scenarios (`flights.py`). A
trial is plain values (`task.py`), its folder is the truth (`store.py`), and whoever makes it claims it
(`trial_lock.py`) and notes each attempt (`attempt_log.py`). Start reading in `run.py`, the driver's loop. An attempt is
made in a process (`worker.py`) that a slot minds (`worker_process.py`, `worker_process.py`); an engine says where slots
are: in processes of this computer (`engines.py`) or on a Dask cluster (`engines.py`). `index.py` is a cache of the
folders, `definition.py` what they were made for, `table.py` what came of them, `summary.py` what is compared with what
and `summary.py` who won, with `pictures.py` for a page; `task.py` says which source made a trial, and `statistics/`
what figures of many trials say.
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
