"""What a campaign's folder was made for: its trials by name, and the version that makes them."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

from wakewise.core.errors import InputError
from wakewise.core.files import write_json
from wakewise.experiments.campaigns.definition import Campaign, PlannedTrial
from wakewise.experiments.campaigns.store import read_store
from wakewise.experiments.campaigns.versions import source_version

PLAN = "plan.json"


@dataclass(frozen=True, kw_only=True)
class PlanEntry:
    """A trial of the plan."""

    key: str
    name: str
    factors: Mapping[str, str | int]


@dataclass(frozen=True, kw_only=True)
class CampaignPlan:
    """What a campaign's folder was made for.

    Parameters
    ----------
    name : str
    campaign : mapping
        The campaign file, resolved.
    wakewise : str
        Version of the package.
    sources : str
        Hash of the sources that matter.
    trials : tuple of PlanEntry
    """

    name: str
    campaign: Mapping[str, Any]
    wakewise: str
    sources: str
    trials: tuple[PlanEntry, ...]


def keep_plan(folder: Path, campaign: Campaign, trials: Sequence[PlannedTrial]) -> None:
    """Write the plan into a campaign's folder, in place of an earlier one of the same version.

    Raises
    ------
    InputError
        If what is there was made by other sources: figures of two versions are no comparison.
    """
    sources = source_version(trials[0].task.sources)
    if (folder / PLAN).exists():
        before = read_plan(folder)
        if before.sources != sources and before.campaign.get("stages") == campaign.stages:
            raise InputError(
                f"--out {folder}: holds trials of another version (Wakewise {before.wakewise}, sources "
                f"{before.sources[:8]}; now {version('wakewise')}, {sources[:8]}); give another --out"
            )
    told = {
        "name": campaign.name,
        "campaign": campaign.model_dump(mode="json"),
        "wakewise": version("wakewise"),
        "sources": sources,
        "trials": [{"key": one.task.key, "name": one.task.name, "factors": dict(one.factors)} for one in trials],
    }
    write_json(folder / PLAN, told, lasting=True)


def read_plan(folder: Path) -> CampaignPlan:
    """The plan of a campaign's folder.

    Raises
    ------
    InputError
        If there is no campaign, or one of another version.
    """
    read_store(folder)
    path = folder / PLAN
    try:
        told = json.loads(path.read_text(encoding="utf-8"))
        trials = tuple(PlanEntry(key=one["key"], name=one["name"], factors=one["factors"]) for one in told["trials"])
        return CampaignPlan(
            name=told["name"],
            campaign=told["campaign"],
            wakewise=told["wakewise"],
            sources=told["sources"],
            trials=trials,
        )
    except FileNotFoundError:
        raise InputError(f"{folder}: no campaign file was run here, its {PLAN} is missing") from None
    except (OSError, ValueError, KeyError, TypeError):
        raise InputError(f"{path}: cannot be read; `wakewise campaign run` with the same file writes it anew") from None
