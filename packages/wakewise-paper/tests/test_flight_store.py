"""Flights are kept by what was flown and by what flies them."""

from pools import Here
from wakewise.experiments.campaigns.store import open_store
from wakewise.experiments.trials import BenchOptions
from wakewise_paper import flight_batches
from wakewise_paper.flight_batches import FlightStore, store_folder
from wakewise_paper.wash_reduction.flight import WashTrial

FLY = f"{__name__}:made_up"
flown = []


def made_up(trial):
    """Figures of a flight that nobody made."""
    flown.append(trial)
    return {"target_speed_mean_m_s": float(trial.seed)}


def test_flights_are_kept_by_what_was_flown(tmp_path, monkeypatch):
    """The same trial is found again as it was, another is not, and `fresh` finds none; nonsense counts as not flown."""
    monkeypatch.setattr(flight_batches, "compile_kernels", lambda **_: None)
    store = FlightStore(tmp_path / "c")
    trial = WashTrial(
        scenario="orbit/paper", method="dp", seed=1, control=(("allocation.advection", False), ("w", (1.0, 2.0)))
    )
    assert store.load(trial, FLY) is None
    flown.clear()
    rows, failures, known = flight_batches.fly_all({("a", "b", 1): trial}, FLY, store, BenchOptions(), lambda _: Here())
    assert (rows, failures, known) == ({("a", "b", 1): {"target_speed_mean_m_s": 1.0}}, [], 0)
    assert flown == [trial]
    assert store.load(trial, FLY) == {"target_speed_mean_m_s": 1.0}
    assert flight_batches.fly_all({("a", "b", 1): trial}, FLY, store, BenchOptions(), lambda _: Here())[2] == 1
    assert store.load(WashTrial(scenario="orbit/paper", method="dp", seed=2), FLY) is None
    assert store.load(trial, f"{__name__}:another") is None
    fresh = FlightStore(store.folder, fresh=True)
    assert fresh.load(trial, FLY) is None
    assert flight_batches.fly_all({("a", "b", 1): trial}, FLY, fresh, BenchOptions(), lambda _: Here())[2] == 0
    assert flown == [trial, trial]
    (open_store(store.folder).place(store.task(trial, FLY).key) / "figures.json").write_text("[1, 2")
    assert store.load(trial, FLY) is None


def test_what_flies_is_part_of_a_flight():
    """Flights and models name the parts of the package that can change them."""
    assert set(flight_batches.FLIES) < set(flight_batches.PHOTOGRAPHS)
    task = FlightStore(store_folder()).task(WashTrial(scenario="orbit/paper", method="dp", seed=1), FLY)
    assert task.sources == flight_batches.FLIES and len(task.key) == 32


def test_the_cache_folder_follows_the_environment(monkeypatch, tmp_path):
    """XDG_CACHE_HOME is where users say that caches go."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert store_folder().is_relative_to(tmp_path)
