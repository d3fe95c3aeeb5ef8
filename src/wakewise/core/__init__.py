"""Core: what all other packages use.

- `interfaces.py`: the Protocols and records between the parts of a flight. `geometry/`: rotations, poses.
- `arrays.py`, `checks.py`, `constants.py`, `size_limits.py`: arrays, argument checks, constants, limits of sizes.
- `settings.py`, `safe_yaml.py`, `plugins.py`: settings records, YAML that executes nothing, parts by name.
- `files.py`, `run_lock.py`, `subprocesses.py`, `threads.py`: whole files, one run per folder, child processes, threads.
- `errors.py`, `lazy_imports.py`, `optional_dependencies.py`: exceptions, imports at first use, missing packages.
- `jit/`: all that concerns the compiler.
"""
