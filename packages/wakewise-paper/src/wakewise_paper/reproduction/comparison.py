"""Methods and approaches side by side, measured; each cell with the command that shows it.

The paper has two tables of methods in words, which are not quoted here. In their place stand two that are flown: the
methods of this package, and ways to stir less that need no such method.
"""

from __future__ import annotations

from wakewise_paper.reproduction.claim import UNQUOTED, PublishedFigure
from wakewise_paper.reproduction.table_trials import APPROACHES, COMPARED

COLUMNS = (
    ("target_speed_mean_m_s", "wash at the target", "mm/s", 1e3),
    ("position_rmse_mm", "distance from the wished place", "mm", 1.0),
    ("roll_pitch_rms_deg", "roll and pitch", "deg", 1.0),
    ("energy_kJ", "energy", "kJ", 1.0),
    ("sign_flips_per_s", "reversals", "1/s", 1.0),
    ("ray_optical_depth", "silt on the rays", "", 1.0),
    ("solve_ms_p99", "control step, 99th percentile", "ms", 1.0),
    ("collisions", "collisions", "", 1.0),
)
"""Figure, title, unit and factor of each column."""


def comparison_claims() -> tuple[PublishedFigure, ...]:
    """A claim for each cell; the paper's value is not known for any."""
    return tuple(
        PublishedFigure(
            method=method,
            figure=figure,
            title=title,
            unit=unit,
            paper=None,
            said=UNQUOTED,
            side="none",
            scale=scale,
            how=command_of(method),
        )
        for method in (*COMPARED, *APPROACHES)
        for figure, title, unit, scale in COLUMNS
    )


def command_of(method: str) -> str:
    """What to type to see a cell's flights again."""
    return f"wakewise reproduce comparison --methods '{method}'"


def tables() -> dict[str, tuple[str, ...]]:
    """Both tables: title and rows."""
    return {"methods": COMPARED, "approaches": tuple(APPROACHES)}
