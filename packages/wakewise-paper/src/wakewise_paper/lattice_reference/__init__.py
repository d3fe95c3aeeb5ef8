"""Lattice Boltzmann reference computations: cases run to their end, time averages and the laws measured on them.

`reference_cases.py` has the cases by name. The solver's kernels (D3Q19) and the stored table of one jet are in
`wakewise.simulation.lattice`. `run.py` advances a case, `engines.py` selects the processor or a CUDA device
(`cuda_engine.py`), `numpy_step.py` is the reference implementation of the step. `wall_model.py` gives walls the stress
of the law of the wall; the cases of jets do without. `mean_field.py` averages a run about the axis of its jet,
`crossing_jets.py` and `jet_past_box.py` compute the fields of two crossing jets and of a jet past a box; `data/` holds
their results.
"""
