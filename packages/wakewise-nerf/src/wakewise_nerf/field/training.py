"""Training of a field, step by step, with checkpoints from which it goes on as if it had never stopped."""

from __future__ import annotations

import pickle
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import torch

from wakewise.core.errors import StageError
from wakewise.core.files import whole_file
from wakewise.core.interfaces import Progress
from wakewise_nerf.field.field import OccupancyGrid, RadianceField
from wakewise_nerf.field.rendering import RayTable, render
from wakewise_nerf.field.settings import FieldSettings

# Where the loss turns from squares to absolute values, so that specks in a photo do not rule (P. J. Huber, 1964).
HUBER = 0.1
# L2 regularisation of the networks (Mueller et al. 2022, section 4); the grid has none.
WEIGHT_DECAY = 1e-6
FEWEST_RAYS = 64
# Before empty space is known, rays are sampled this much more coarsely.
WARMUP_COARSENING = 4
REPORT_EVERY = 20


class TrainingState:
    """All that changes while a field learns: field, occupancy, optimiser, step, and rays per step.

    Every random draw of a step follows from the seed and the step's number alone, so nothing of it has to be kept.
    """

    def __init__(self, settings: FieldSettings, device: Any) -> None:
        self.settings = settings
        self.device = device
        self.field = RadianceField(settings).to(device)
        self.occupancy = OccupancyGrid(settings.occupancy, 2.0 / settings.samples).to(device)
        networks = [*self.field.density_network.parameters(), *self.field.colour_network.parameters()]
        # Adam as in the paper: a tiny epsilon, since many entries of the grid see few and small gradients.
        self.optimiser = torch.optim.Adam(
            [
                {"params": [self.field.grid.table], "first_rate": settings.grid_rate},
                {"params": networks, "first_rate": settings.network_rate, "weight_decay": WEIGHT_DECAY},
                {"params": [self.field.beyond], "first_rate": settings.network_rate},
            ],
            betas=(0.9, 0.99),
            eps=1e-15,
        )
        self.step = 0
        self.rays = min(settings.rays, max(FEWEST_RAYS, 2 * settings.samples_per_step // settings.samples))
        self.losses: list[float] = []

    def advance(self, table: RayTable) -> Any:
        """Take one step; its loss, a tensor without shape."""
        settings, step = self.settings, self.step
        warm = step < settings.warmup_steps
        draw = torch.Generator().manual_seed(_seed(settings.random_seed, 0, step))
        rows = torch.randint(0, len(table), (self.rays,), generator=draw).to(self.device)
        jitter = torch.rand((self.rays, 1), generator=draw).to(self.device)
        origins, directions, wanted = table.batch(rows)
        seen = render(
            self.field,
            None if warm else self.occupancy,
            origins,
            directions,
            samples=settings.samples // (WARMUP_COARSENING if warm else 1),
            jitter=jitter,
        )
        loss = torch.nn.functional.smooth_l1_loss(seen.colour, wanted, beta=HUBER)
        self.optimiser.zero_grad(set_to_none=True)
        loss.backward()
        for group in self.optimiser.param_groups:
            group["lr"] = group["first_rate"] * settings.last_rate ** (step / settings.steps)
        self.optimiser.step()
        change = settings.samples_per_step / max(seen.points, 1)
        desired = round(self.rays * min(max(change, 0.5), 2.0))
        self.rays = min(max(desired, min(FEWEST_RAYS, settings.rays)), settings.rays)
        self.step += 1
        if self.step % settings.occupancy_every == 0 or self.step == settings.warmup_steps:
            chance = torch.Generator(device=self.device).manual_seed(_seed(settings.random_seed, 1, step))
            early = self.step <= settings.warmup_steps
            self.occupancy.update(self.field, chance, all_cells=early, apply=self.step >= settings.warmup_steps)
        return loss.detach()

    def state(self) -> dict[str, Any]:
        """Return all that has to be kept to go on."""
        return {
            "field": self.field.state_dict(),
            "occupancy": self.occupancy.state_dict(),
            "optimiser": self.optimiser.state_dict(),
            "step": self.step,
            "rays": self.rays,
            "losses": self.losses,
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Go back to a kept state."""
        self.field.load_state_dict(state["field"])
        self.occupancy.load_state_dict(state["occupancy"])
        self.optimiser.load_state_dict(state["optimiser"])
        self.step, self.rays, self.losses = state["step"], state["rays"], list(state["losses"])


def train(
    table: RayTable, settings: FieldSettings, device: Any, checkpoint: Path, key: str, progress: Progress
) -> TrainingState:
    """Train to the last step, from the checkpoint where it is of the same key.

    `key`: fingerprint of all that the result depends on; a checkpoint of another is overwritten. Raises StageError if
    the loss is no longer finite.
    """
    torch.set_num_threads(settings.threads)
    training = TrainingState(settings, device)
    kept = read_checkpoint(checkpoint, device)
    if kept is not None and kept["key"] == key:
        training.restore(kept["training"])
    told: list[Any] = []
    while training.step < settings.steps:
        told.append(training.advance(table))
        last = training.step == settings.steps
        if training.step % REPORT_EVERY == 0 or last:
            loss = float(torch.stack(told).mean())
            told.clear()
            if not np.isfinite(loss):
                raise StageError(f"neural field: training diverged by step {training.step}; lower the rates")
            training.losses.append(loss)
            progress(training.step, settings.steps, f"loss {loss:.5f}, {training.rays} rays")
        # Only at a report, so that the record of losses goes on where it stopped.
        due = training.step % (settings.checkpoint_every // REPORT_EVERY * REPORT_EVERY or REPORT_EVERY) == 0
        if due or last:
            with whole_file(checkpoint) as temporary:
                torch.save({"key": key, "training": training.state()}, temporary)
    return training


def read_checkpoint(path: Path, device: Any) -> dict[str, Any] | None:
    """What a checkpoint holds; nothing if it is missing or damaged, as training then begins anew."""
    if not path.is_file():
        return None
    try:
        kept = torch.load(path, map_location=device, weights_only=True)
    except (RuntimeError, ValueError, KeyError, EOFError, OSError, pickle.UnpicklingError, zipfile.BadZipFile):
        return None
    whole = isinstance(kept, dict) and {"key", "training"} <= kept.keys()
    return kept if whole else None


def _seed(*parts: int) -> int:
    """One well-mixed number from several."""
    return int(np.random.SeedSequence(parts).generate_state(1, np.uint64)[0] >> np.uint64(1))
