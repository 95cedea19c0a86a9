"""The stages of the cleaner, and its baselines, as tasks of the training loop."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import torch
from jaxtyping import Float
from torch import Tensor, nn

from geneoh.baselines.networks import RegressionDenoiser, TochAutoencoder
from geneoh.choices import StageName
from geneoh.denoisers.latent import LatentDenoiser
from geneoh.denoisers.motion import MotionDenoiser
from geneoh.denoisers.relations import RelationDenoiser
from geneoh.denoisers.spatial import SpatialDenoiser
from geneoh.denoisers.temporal import TemporalDenoiser
from geneoh.denoisers.trajectory import TrajectoryDenoiser
from geneoh.seeds import seeded_generator
from geneoh.streamed import Streamed
from geneoh.synthesis.draws import Part
from geneoh.synthesis.motions.motion import Interactions
from geneoh.training import losses
from geneoh.training.batches import Batch, draw_batch
from geneoh.training.config import TrainConfig
from geneoh.training.processes import Team
from geneoh.training.resume import TrainState, digest
from geneoh.training.tasks import SamplesPiece, Task, divided_batch, first_weights, own_part
from geneoh.training.windows import WeightedInteractions

Loss = Callable[..., Tensor]

STAGES: dict[StageName, tuple[Callable[[Any], nn.Module], Loss]] = {
    "motion": (MotionDenoiser, losses.motion_loss),
    "spatial": (SpatialDenoiser, losses.spatial_loss),
    "temporal": (TemporalDenoiser, losses.temporal_loss),
    "trajectory": (TrajectoryDenoiser, losses.trajectory_loss),
    "relations": (RelationDenoiser, losses.relation_loss),
    "latent": (LatentDenoiser, losses.latent_loss),
    "toch": (TochAutoencoder, losses.keypoint_loss),
    "regression": (RegressionDenoiser, losses.keypoint_loss),
}
"""Network and loss of each stage."""


def build_model(stage: StageName, config: TrainConfig) -> nn.Module:
    """A new network of the stage, initialised from the config's seed."""
    network, _ = STAGES[stage]
    with first_weights(config.seed, stage, "weights"):
        return network(getattr(config, stage))


def loss_of(stage: StageName, step: int, config: TrainConfig) -> Loss:
    """The loss at a step; the latent stage first trains its autoencoder."""
    if stage == "latent" and step < config.autoencoder_steps:
        return losses.reconstruction_loss
    return STAGES[stage][1]


@dataclass(frozen=True)
class StageTask(Task):
    """Training of one stage on interactions."""

    name: StageName
    config: TrainConfig
    data: Streamed[Interactions]
    validation: Streamed[Interactions]
    motion_denoiser: MotionDenoiser | None = None  # MotionDiff, for stages that follow it
    made: Mapping[str, Any] | None = None  # how the data was made, for the record

    def network(self) -> nn.Module:
        """A new network of the stage, initialised from the config's seed."""
        return build_model(self.name, self.config)

    def batch(
        self,
        data: Streamed[Interactions],
        *parts: object,
        device: torch.device,
        part: Part | None = None,
    ) -> tuple[Batch, torch.Generator]:
        """A batch, or a part of it, with its generator; `parts` are its purpose and number."""
        config = self.config
        generator = seeded_generator(config.seed, *parts)
        batch = draw_batch(
            data,
            config.batch,
            config,
            generator=generator,
            motion_denoiser=self.motion_denoiser,
            part=part,
            device=device,
        )
        return batch, generator

    def pieces(self, step: int, team: Team, device: torch.device) -> list[SamplesPiece]:
        """This process's part of a step's batch, in pieces whose gradients are accumulated."""
        own = own_part(self.config, team)
        batch, generator = self.batch(self.data, "step", step, device=device, part=own)
        pieces, loss = [], loss_of(self.name, step, self.config)
        for piece, draws in divided_batch(batch, generator, own, self.config.accumulate):
            if self.name == "motion":
                _ = piece.motion.network_input  # cached now, in parallel to the previous step
            pieces.append(SamplesPiece(piece, draws, loss))
        return pieces

    def before_step(self, state: TrainState) -> None:
        """Switch the latent stage from training its autoencoder to training its denoiser.

        The autoencoder is then frozen with its averaged weights. One that a run starts from keeps
        its statistics, for which its denoiser was trained.
        """
        turns = state.first is None and state.step == self.config.autoencoder_steps
        if self.name == "latent" and turns:
            state.model.load_state_dict(state.average)
            device = next(state.model.parameters()).device
            set_latent_statistics(state.model, self.batch(self.data, "latent", device=device)[0])
            state.average = {n: t.clone() for n, t in state.model.state_dict().items()}

    def validate(self, model: nn.Module, index: int) -> Float[Tensor, ""]:
        """`recovered_fraction` of a validation batch: the remaining error over the input's."""
        device = next(model.parameters()).device
        batch, generator = self.batch(self.validation, "validation", index, device=device)
        return losses.recovered_fraction(model, batch, generator=generator)

    def learned_from(self) -> dict[str, Any]:
        """Fingerprints of the data and of MotionDiff, and how the data was made."""
        motion = self.motion_denoiser
        return {
            "sequences": len(self.data),
            "data": data_digest(self.data),
            "validation": data_digest(self.validation),
            "before": None if motion is None else digest(motion.state_dict().values()),
            "made": None if self.made is None else dict(self.made),
        }


@torch.no_grad()
def set_latent_statistics(model: nn.Module, batch: Batch) -> None:
    """Normalise the latent of a trained autoencoder (paper C.5: T itself is not normalised)."""
    assert isinstance(model, LatentDenoiser), "only the latent stage has one"
    encoder = model.autoencoder
    encoder.latent_mean.zero_()
    encoder.latent_std.fill_(1.0)
    latent = losses.temporal_latent(model, batch, batch.clean)
    encoder.latent_mean.copy_(latent.mean((0, 1)))
    encoder.latent_std.copy_(latent.std((0, 1)).clamp(min=1e-3))


def data_digest(data: Streamed[Interactions]) -> str:
    """A fingerprint of interactions by the hand skeletons, and by hand, object and one surface
    point of each clip in its last frame."""
    shares = [data.weight] if isinstance(data, WeightedInteractions) else []

    def at_the_end(clips: Interactions) -> Tensor:
        last = clips.wrist, clips.pose, clips.translation, clips.rotation, clips.points
        return torch.cat([values[:, -1].flatten(1) for values in last], dim=1)

    return digest([data.each(lambda clips: clips.offsets), data.each(at_the_end), *shares])
