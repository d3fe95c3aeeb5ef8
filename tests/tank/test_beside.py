"""Work on a thread of its own."""

import threading

import pytest

from wakewise.tank.beside import Beside


@pytest.mark.parametrize("cores", [1, 2])
def test_work_is_done_when_waited_for(monkeypatch, cores):
    """After `wait` everything that was started has been done, in order, however many cores there are."""
    monkeypatch.setattr("os.cpu_count", lambda: cores)
    beside, done = Beside("work"), []
    for k in range(5):
        beside.start(lambda k=k: done.append((k, threading.current_thread() is threading.main_thread())))
    beside.wait()
    assert [k for k, _ in done] == list(range(5))
    assert {on_main for _, on_main in done} == {cores == 1}


def test_what_went_wrong_is_raised_once(monkeypatch):
    """An error of the work comes out of `wait`; afterwards new work may begin."""
    monkeypatch.setattr("os.cpu_count", lambda: 2)
    beside, done = Beside("work"), []
    beside.start(lambda: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        beside.wait()
    beside.wait()
    beside.start(lambda: done.append(1))
    beside.wait()
    assert done == [1]
