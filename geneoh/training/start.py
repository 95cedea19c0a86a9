"""Weights that a run starts from, to fine-tune a trained network on other data."""

from dataclasses import replace
from pathlib import Path

from torch import Tensor

from geneoh.baselines.networks import BASELINES
from geneoh.baselines.networks import SHIPPED as BASELINE_WEIGHTS
from geneoh.choices import StageName
from geneoh.config import as_dict, flat, setting_differences, with_table
from geneoh.denoisers.library import SHIPPED
from geneoh.errors import CheckpointError, ConfigError
from geneoh.nn.checkpoint import load_checkpoint
from geneoh.training.config import TrainConfig
from geneoh.training.stages import build_model
from geneoh.training.tasks import Task


def started_from(
    folder: Path | None, stage: StageName, config: TrainConfig
) -> tuple[TrainConfig, dict[str, Tensor]]:
    """Initial weights of a stage, and the config with the network size of these weights.

    They are read from STAGE.safetensors in the folder; None means the shipped ones. The latent
    stage keeps its autoencoder and trains only its denoiser.

    Raises:
        CheckpointError: there are no weights of this version of the network.
        ConfigError: the config asks for another network size than that of the weights.
    """
    shipped = BASELINE_WEIGHTS if stage in BASELINES else SHIPPED
    path = (folder or shipped) / f"{stage}.safetensors"
    saved, wanted = load_checkpoint(path), getattr(config, stage)
    try:
        size = dict(saved.record["config"][stage])
        network = with_table(type(wanted)(), size, str(path))
        config = replace(config, autoencoder_steps=0, **{stage: network})
        build_model(stage, config).load_state_dict(saved.tensors)
    except (KeyError, TypeError, ValueError, RuntimeError) as error:
        raise CheckpointError(
            f"{path}: expected weights of this version's {stage} network, got others "
            f"({str(error).splitlines()[-1].strip()}); start without them"
        ) from error
    default = flat(as_dict(type(network)()))
    chosen = {name: v for name, v in flat(as_dict(wanted)).items() if v != default[name]}
    if differs := setting_differences(as_dict(network), chosen):
        raise ConfigError(
            f"--start: the {stage} network of {path} has {differs}; leave that out, or start "
            "without the weights"
        )
    return config, saved.tensors


def weights_for(task: Task, path: Path | None) -> dict[str, Tensor] | None:
    """Initial weights of a task's network from a file; None without a file.

    Raises:
        CheckpointError: the file is missing, or holds weights of another network.
    """
    if path is None:
        return None
    saved = load_checkpoint(path)
    try:
        task.network().load_state_dict(saved.tensors)
    except RuntimeError as error:
        raise CheckpointError(
            f"{path}: expected weights of the {task.name} network that is asked for, got others "
            f"({str(error).splitlines()[-1].strip()}); name the --config that they were trained "
            "with, or start without them"
        ) from error
    return saved.tensors
