"""All that concerns the compiler: `njit` (`compiled.py`, `kernels.py`), its cache (`cache_folder.py`),
`precompile.py`.
"""
