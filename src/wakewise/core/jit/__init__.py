"""All that concerns the compiler: `njit` (`njit.py`, `kernel_cache.py`), its cache (`cache_dir.py`),
`precompile.py`.
"""
