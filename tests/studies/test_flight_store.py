"""Flights are kept by what was flown and by what flies them."""

from wakewise.studies.flight_store import FlightStore, source_version, store_folder
from wakewise.studies.gentle.flight import Trial

ROW = {"target_speed_mean_m_s": 1.0}


def test_flights_are_kept_by_what_was_flown(tmp_path):
    """The same trial is found again, another is not, and `fresh` finds none; nonsense on disk counts as not flown."""
    store, trial = FlightStore(tmp_path), Trial(scenario="orbit/paper", method="dp", seed=1)
    assert store.load(trial) is None
    store.save(trial, ROW)
    assert store.load(trial) == ROW and len(source_version()) == 64
    assert store.load(Trial(scenario="orbit/paper", method="dp", seed=2)) is None
    assert store.load(Trial(scenario="orbit/paper", method="dp", seed=1, wrong_current=True)) is None
    assert FlightStore(tmp_path, fresh=True).load(trial) is None
    store.path(trial).write_text("[1, 2")
    assert store.load(trial) is None


def test_the_cache_folder_follows_the_environment(monkeypatch, tmp_path):
    """XDG_CACHE_HOME is where users say that caches go."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert store_folder().is_relative_to(tmp_path)
