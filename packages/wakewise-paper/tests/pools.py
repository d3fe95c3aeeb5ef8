"""A stand-in for the processes of a bench, for tests."""

import json
from concurrent.futures import Future
from contextlib import contextmanager

from wakewise.core.interfaces import no_progress
from wakewise.experiments.campaigns.engines import WorkerPool
from wakewise.experiments.campaigns.worker import run_attempt
from wakewise.experiments.campaigns.worker_process import AttemptReport


class Here:
    """An engine of this process: attempts are made at once, and by no other process."""

    name = "here"

    @contextmanager
    def crew(self, driver):
        yield WorkerPool(executor=self, threads=1, size=lambda: 1, check=lambda: None)

    def submit(self, attempt, ticket, threads):
        future = Future()
        future.set_result(AttemptReport(key=ticket.trial["key"], **run_attempt(ticket, no_progress, quiet=False)))
        return future


class MadeUp:
    """Stands in for the flights of a study: `figures(name, settings)` are those of each, by the name of its trial."""

    def __init__(self, monkeypatch, bench, figures, work="wakewise.experiments.campaigns.flights.fly_stage"):
        self.flown = []
        self.figures = figures
        monkeypatch.setattr(bench, "_engine", lambda _: Here())
        monkeypatch.setattr("wakewise.experiments.campaigns.study.compile_kernels", lambda **_: None)
        monkeypatch.setattr(work, self)

    def __call__(self, settings, folder, progress):
        told = json.loads((folder.parent / "trial.json").read_text())
        self.flown.append(told["name"])
        return self.figures(told["name"], settings)
