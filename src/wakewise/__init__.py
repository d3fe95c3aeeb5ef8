"""Wakewise: fly over-actuated underwater vehicles so gently that the target's water stays still."""

from importlib.metadata import version

__version__ = version("wakewise")
