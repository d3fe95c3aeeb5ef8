"""The command line: one file per command; parsing and wiring only. Start reading in `main.py`, then the command's own
file.
"""
