"""Wakewise: fly over-actuated underwater vehicles so gently that the target's water stays still."""

from importlib.metadata import version

from wakewise import numba_cache as numba_cache  # before Numba is imported anywhere

__version__ = version("wakewise")
