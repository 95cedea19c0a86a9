"""Training on another device: a pretended one, and CUDA where there is a GPU."""

from dataclasses import replace
from typing import get_args

import pytest
import torch
from stage_runs import train_stage

from geneoh.choices import StageName
from geneoh.nn.checkpoint import load_checkpoint
from geneoh.training.augmentation import AugmentationConfig, KeptContactConfig
from geneoh.training.stages import build_model

CPU = torch.device("cpu")


def trained(stage, config, clips, folder, device) -> dict[str, torch.Tensor]:
    before = build_model("motion", config).eval().requires_grad_(False).to(device)
    before = before if stage in ("spatial", "temporal", "relations", "latent") else None
    path = train_stage(stage, config, clips, clips, folder, device=device, motion_denoiser=before)
    return load_checkpoint(path).tensors


@pytest.mark.parametrize("stage", get_args(StageName))
def test_a_stage_learns_and_is_validated_alike_on_every_device(
    stage, clips, tiny, training_device, tmp_path
):
    augmentation = AugmentationConfig(contact=KeptContactConfig(share=0.5))
    config = replace(tiny, steps=2, autoencoder_steps=1, augmentation=augmentation)
    here = trained(stage, config, clips, tmp_path / "cpu", CPU)
    there = trained(stage, config, clips, tmp_path / "there", training_device)
    assert here.keys() == there.keys()
    for name, weights in there.items():
        torch.testing.assert_close(weights, here[name], atol=2e-3, rtol=0)


def test_a_run_is_continued_on_the_device_it_began_on(clips, tiny, training_device, tmp_path):
    begun = replace(tiny, steps=2)
    trained("motion", begun, clips, tmp_path / "parts", training_device)
    parts = trained("motion", tiny, clips, tmp_path / "parts", training_device)
    whole = trained("motion", tiny, clips, tmp_path / "whole", training_device)
    for name, weights in parts.items():
        torch.testing.assert_close(weights, whole[name], atol=2e-3, rtol=0)
