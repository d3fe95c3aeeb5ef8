"""Core: arrays, errors, settings, geometry, interfaces, files, plugins; `jit/` is all that concerns the compiler."""
