"""Ctrl-C that a library swallows still ends the command."""

import pytest

from wakewise.cli.console import INTERRUPTED, Bars


def test_work_that_goes_on_after_ctrl_c_is_stopped_at_its_next_word() -> None:
    """Progress after an interrupt raises it again; without one it does not."""
    with Bars().stage("work") as progress:
        progress(0, 2, "note")
    INTERRUPTED.set()
    try:
        with pytest.raises(KeyboardInterrupt), Bars().stage("work") as progress:
            progress(1, 2, "note")
    finally:
        INTERRUPTED.clear()
