"""Wakewise: fly over-actuated underwater vehicles so gently that the target's water stays still."""

__version__ = "0.1.0"
