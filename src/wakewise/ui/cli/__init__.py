"""The command line: one file per command; parsing and wiring only. Start reading in `main.py`, then the command's own
file.
"""

import os

# Read by OpenBLAS when NumPy or pycolmap load it, here and in processes that are started. Matrices here are small, or
# many at a time on threads of their own; with more threads each product of some size leaves them spinning for a while.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
