"""A stand-in for the processes of a bench, for tests."""

from concurrent.futures import Future

from wakewise.errors import StageError


class Here:
    """A pool of this process: as executors go, and no other process."""

    def submit(self, work, trial):
        future = Future()
        try:
            future.set_result(work(trial))
        except StageError as error:
            future.set_exception(error)
        return future

    def __enter__(self):
        return self

    def __exit__(self, *_):
        return None
