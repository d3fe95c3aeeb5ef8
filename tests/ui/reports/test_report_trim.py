"""A page's sentence on the ballast that a flight lacked."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import polars as pl

import wakewise as ww
from wakewise.ui.reports.report import trim_html


@dataclass(frozen=True)
class Told:
    """What the sentence is made from."""

    settings: Any
    steps: Any


def hover(weight_N: float) -> pl.DataFrame:
    """Eight seconds of a level hover that lacked this weight."""
    twist = ("u_m_s", "v_m_s", "w_m_s", "p_rad_s", "q_rad_s", "r_rad_s")
    zero = [f"{who}_{name}" for who in ("est", "goal") for name in twist]
    zero += ["est_qx", "est_qy", "est_qz", "load_X_N", "load_Y_N", "load_K_Nm", "load_M_Nm", "load_N_Nm"]
    columns = dict.fromkeys([*zero, *(f"command_{i + 1}_N" for i in range(8))], 0.0)
    columns |= {"est_qw": 1.0, "load_Z_N": weight_N}
    return pl.DataFrame({"time_s": np.arange(400) / 50.0, **{k: np.full(400, v) for k, v in columns.items()}})


def test_a_heavy_vehicle_is_told_of_and_one_in_trim_is_not() -> None:
    """One paragraph, or nothing; nothing, too, where there is no record or the vehicle came from Python."""
    scenario = ww.Scenario.preset("quick", world="tank")
    assert trim_html(Told(scenario, hover(3.0))) == (
        "<p>Before the next flight: add 3.0 N of float in the middle "
        "(it is 3.0 +- 0.0 N heavy, two standard deviations).</p>"
    )
    assert trim_html(Told(scenario, hover(0.1))) == ""
    assert trim_html(Told(None, hover(3.0))) == trim_html(Told(scenario, None)) == ""
    given = scenario.model_copy(update={"overrides": {"vehicle": "mine"}})
    assert trim_html(Told(given, hover(3.0))) == ""
