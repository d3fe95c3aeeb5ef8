"""What the tests of the lattice share."""

import numba
import pytest


@pytest.fixture
def one_thread():
    """Small lattices on one thread: on a busy machine threads that wait for one another cost more than they save."""
    before = numba.get_num_threads()
    numba.set_num_threads(1)
    yield
    numba.set_num_threads(before)
