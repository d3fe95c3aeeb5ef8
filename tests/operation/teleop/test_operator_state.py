"""Settings of an operator: what is set is checked when it is set, and read whole."""

import threading

import pytest

from wakewise.core.errors import InputError
from wakewise.operation.teleop.operator_state import (
    FIELDS,
    OperatorSettings,
    OperatorState,
    TrackingWeightMeaning,
    meaning,
    tracking_regime,
)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"w_track": 51}, "w_track: 51, must be a number from 0.5 to 50"),
        ({"w_track": float("nan")}, "w_track: nan"),
        ({"w_track": "5"}, "w_track: '5'"),
        ({"gain": True}, "gain: True, must be a number from 0.1 to 1"),
        ({"gain": 1e300}, "gain: 1e\\+300"),
        ({"mode": "fly"}, "mode: 'fly', allowed are operator, hold, scan"),
        ({"mode": ["scan"]}, "mode: "),
        ({"method": None}, "method: None, allowed are wake-aware, direct"),
        ({"precise": 1}, "precise: 1, must be true or false"),
        ({"speed": 1}, "speed: not a setting, allowed are mode,"),
    ],
)
def test_nonsense_is_refused_by_name_and_changes_nothing(change, words):
    """The message names field, value and what is allowed."""
    operator = OperatorState()
    with pytest.raises(InputError, match=words):
        operator.set(orbit=True, **change)
    assert operator.state == OperatorSettings()


def test_what_is_set_stays_set():
    """`set` gives what is set then; the rest stays."""
    operator = OperatorState(OperatorSettings(gain=0.3))
    assert operator.set(w_track=20, orbit=True) == operator.state == OperatorSettings(gain=0.3, w_track=20, orbit=True)
    assert set(FIELDS) == set(vars(operator.state))


def test_buttons_step_the_gain_within_its_range():
    """Up to 1 and down to 0.1, never beyond; precise mode toggles; capture and stop are no settings."""
    operator = OperatorState()
    for _ in range(8):
        operator.press("gain_up")
    assert operator.state.gain == 1.0
    for _ in range(12):
        operator.press("gain_down")
    assert (
        operator.state.gain == 0.1
        and operator.press("precise").precise
        and operator.press("operator").mode == "operator"
    )
    assert operator.press("capture") == operator.press("stop") == operator.state
    assert operator.state.share == pytest.approx(0.03)


def test_regimes_are_the_papers():
    """Above 10 transit, 5 work, below 2 delicate."""
    assert [tracking_regime(x) for x in (0.5, 1.9, 2.0, 5.0, 10.0, 10.1, 50.0)] == [
        "delicate",
        "delicate",
        "work",
        "work",
        "work",
        "transit",
        "transit",
    ]


def test_the_dials_meaning_is_what_was_measured():
    """Between two measurements by the logarithm, beyond them the last one; regime alone where there is none."""
    measured = {5.0: (7.0, 90.0), 20.0: (6.0, 80.0)}
    assert meaning(10.0, measured) == TrackingWeightMeaning(regime="work", deviation_pct=6.5, saved_pct=85.0)
    assert meaning(50.0, measured).saved_pct == 80.0 and meaning(0.5, measured).deviation_pct == 7.0
    assert meaning(1.0) == TrackingWeightMeaning(regime="delicate")


def test_threads_lose_no_change():
    """Two writers of different fields: both changes stand."""
    operator = OperatorState()

    def turn(field, values):
        for value in values:
            operator.set(**{field: value})

    threads = [
        threading.Thread(target=turn, args=("gain", [0.1 + 0.001 * k for k in range(300)])),
        threading.Thread(target=turn, args=("w_track", [1.0 + 0.1 * k for k in range(300)])),
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert operator.state.gain == pytest.approx(0.399) and operator.state.w_track == pytest.approx(30.9)
