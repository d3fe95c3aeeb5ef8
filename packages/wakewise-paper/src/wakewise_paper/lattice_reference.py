"""The lattice's mean fields as jets that wake models can be held against."""

from __future__ import annotations

from wakewise.core.errors import InputError
from wakewise.simulation.lattice import load_mean_field
from wakewise_paper.flows import TableJet, table_jet

_CASES = {
    "oracle-swirl": ("swirl", "lattice, propeller with swirl"),
    "oracle": ("free", "lattice, jet without swirl"),
}


def oracle_jets() -> tuple[list[TableJet], dict[str, str]]:
    """Jets of the lattice with and without swirl, and for what is not there, why."""
    jets, missing = [], {}
    for name, (case, title) in _CASES.items():
        try:
            field = load_mean_field(case)
        except InputError as fault:
            missing[name] = str(fault)
            continue
        note = (
            f"lattice-Boltzmann, {field.cells_per_D} cells per disk diameter, actuator disk in open water, averaged "
            "over time and angle; one run scaled to all thrusts, so the thrust law holds by construction"
        )
        if field.figures.get("preliminary"):
            note += "; preliminary, on a coarser grid than is wanted"
        tables = {key: getattr(field, key) for key in ("x_D", "r_D", "axial", "radial", "swirl", "axial_rms")}
        jets.append(table_jet(name, title, note, tables))
    return jets, missing


def grid_convergence_pct() -> tuple[float | None, str]:
    """Change of the speed on the axis 0.3 m from the disk between two grids, per cent; None with the reason.

    Of the two cases, with swirl and without, the worse.
    """
    found, reasons = [], []
    for case, _ in _CASES.values():
        try:
            value = load_mean_field(case).figures.get("grid_convergence_pct")
        except InputError as fault:
            reasons.append(str(fault))
            continue
        if value is None:
            reasons.append(f"the stored mean field '{case}' of the lattice says nothing of a second grid")
        else:
            found.append(float(value))
    if reasons:
        return None, "; ".join(reasons)
    return max(found), ""
