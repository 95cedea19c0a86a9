from dataclasses import asdict

import pytest
import torch

from geneoh.denoisers.latent import LatentConfig, LatentDenoiser
from geneoh.denoisers.library import CLEANING_STAGES, PAPER_STAGES, load_denoisers
from geneoh.denoisers.motion import MotionConfig, MotionDenoiser
from geneoh.denoisers.relations import RelationConfig, RelationDenoiser
from geneoh.denoisers.spatial import SpatialConfig, SpatialDenoiser
from geneoh.denoisers.temporal import TemporalConfig, TemporalDenoiser
from geneoh.denoisers.trajectory import TrajectoryConfig, TrajectoryDenoiser
from geneoh.errors import CheckpointError
from geneoh.nn.checkpoint import Checkpoint, save_checkpoint

NETWORKS = {
    "motion": MotionDenoiser(MotionConfig(width=16, depth=1, heads=2)),
    "trajectory": TrajectoryDenoiser(TrajectoryConfig(width=16, depth=1, heads=2)),
    "relations": RelationDenoiser(RelationConfig(width=16, depth=1, heads=2, point_width=8)),
    "spatial": SpatialDenoiser(SpatialConfig(width=16)),
    "temporal": TemporalDenoiser(TemporalConfig(width=16, depth=1, heads=2)),
    "latent": LatentDenoiser(LatentConfig(latent=6, point_width=8, width=16, depth=1, heads=2)),
}


def saved(network: torch.nn.Module, stage: str) -> Checkpoint:
    half = {name: tensor.half() for name, tensor in network.state_dict().items()}
    return Checkpoint(half, {"stage": stage, "config": {stage: asdict(network.config)}})


@pytest.fixture
def folder(tmp_path):
    for stage, network in NETWORKS.items():
        save_checkpoint(tmp_path / f"{stage}.safetensors", saved(network, stage))
    return tmp_path


def test_networks_are_rebuilt_from_their_files(folder):
    denoisers = load_denoisers(folder)
    for stage, network in NETWORKS.items():
        loaded = getattr(denoisers, stage)
        assert loaded.config == network.config
        assert not loaded.training
        assert not any(p.requires_grad for p in loaded.parameters())
        for name, tensor in network.state_dict().items():
            got = loaded.state_dict()[name]
            assert got.dtype == torch.float32
            assert torch.equal(got, tensor.half().float())


def test_networks_are_kept_until_a_file_of_theirs_changes(folder):
    first = load_denoisers(folder)
    assert load_denoisers(folder) is first
    assert load_denoisers(folder, paper=False) is not first
    other = SpatialDenoiser(SpatialConfig(width=24))
    save_checkpoint(folder / "spatial.safetensors", saved(other, "spatial"))
    assert load_denoisers(folder).spatial.config.width == 24


@pytest.mark.parametrize("stage", NETWORKS)
def test_a_missing_stage_is_told(folder, stage):
    (folder / f"{stage}.safetensors").unlink()
    with pytest.raises(CheckpointError, match=rf"{stage}\.safetensors: expected weights there"):
        load_denoisers(folder, paper=stage in PAPER_STAGES)


def test_the_three_stages_are_enough_where_the_papers_form_is_not_asked_for(folder):
    for stage in PAPER_STAGES:
        (folder / f"{stage}.safetensors").unlink()
    denoisers = load_denoisers(folder, paper=False)
    assert denoisers.trajectory is None
    assert denoisers.relations is None


def test_the_papers_three_stages_are_enough_for_its_form(folder):
    for stage in CLEANING_STAGES:
        (folder / f"{stage}.safetensors").unlink()
    denoisers = load_denoisers(folder, paper=True)
    assert denoisers.latent is not None
    assert denoisers.latent.config == NETWORKS["latent"].config


def test_weights_of_another_network_are_refused(folder):
    wrong = Checkpoint(
        saved(NETWORKS["spatial"], "spatial").tensors, saved(NETWORKS["motion"], "motion").record
    )
    save_checkpoint(folder / "motion.safetensors", wrong)
    with pytest.raises(CheckpointError, match=r"motion\.safetensors: expected weights of this"):
        load_denoisers(folder)


@pytest.mark.parametrize(
    "record",
    [
        {},
        {"config": {}},
        {"config": {"motion": "wide"}},
        {"config": {"motion": {"width": 16, "rooms": 3}}},
        {"config": {"motion": {"width": 16, "depth": 1, "heads": 2.0}}},
        {"config": {"motion": {"width": 16, "depth": 10**30, "heads": 2}}},
    ],
)
def test_weights_whose_record_does_not_fit_are_refused(folder, record):
    tensors = saved(NETWORKS["motion"], "motion").tensors
    save_checkpoint(folder / "motion.safetensors", Checkpoint(tensors, record))
    with pytest.raises(CheckpointError, match=r"motion\.safetensors: expected weights of this"):
        load_denoisers(folder)
