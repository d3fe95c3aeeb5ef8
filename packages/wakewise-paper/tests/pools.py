"""A stand-in for the processes of a bench, for tests."""

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
