"""Laws of words and numbers."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from wakewise.ui.reports.text import THIN_SPACE, grouped, number, unit
from wakewise.ui.reports.trial import Metrics


def test_numbers_have_three_digits_and_no_exponents() -> None:
    """As a person would write them."""
    told = {
        0: "0", 1.4213: "1.42", 29: "29", 0.0181: "0.0181", 51234: f"51{THIN_SPACE}234", 94.0: "94", 97.94: "97.9",
        1234.5: "1234", 123456.7: f"123{THIN_SPACE}457", 2.5e-7: "2.50 × 10⁻⁷", -3.14159: "-3.14",
        2000.0: f"2{THIN_SPACE}000",
    }  # fmt: skip
    assert {value: number(value) for value in told} == told


@given(st.floats(min_value=1e-9, max_value=1e12))
def test_a_written_number_reads_back_within_half_a_percent(value: float) -> None:
    """Three significant digits are kept, whatever the size."""
    text = number(value).replace(THIN_SPACE, "")
    if "×" in text:
        mantissa, power = text.split(" × 10")
        text = mantissa + "e" + power.translate(str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789"))
    assert abs(float(text) - value) <= 0.0051 * value


def test_units_follow_the_ending_of_a_key() -> None:
    """Unless metrics.json gives one."""
    metrics = Metrics(values={}, why={}, definitions={}, units={"odd_s": "fortnights"})
    said = {
        "rmse_mm": "mm", "target_speed_p95_m_s": "m/s", "completeness_1mm_pct": "%", "turbidity_mean_per_m": "1/m",
        "solve_ms_p99": "ms", "sign_flips_per_s": "1/s", "energy_kJ": "kJ", "wall_s": "s", "f_score": "", "images": "",
        "odd_s": "fortnights",
    }  # fmt: skip
    assert {key: unit(metrics, key) for key in said} == said


@given(st.lists(st.text(min_size=1), unique=True))
def test_no_figure_is_lost_in_grouping(keys: list[str]) -> None:
    """Every key is in exactly one group."""
    metrics = Metrics(values=dict.fromkeys(keys, 1), why={}, definitions={}, units={})
    assert sorted(key for group in grouped(metrics).values() for key in group) == sorted(keys)
