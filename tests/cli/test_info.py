from importlib.metadata import version

import torch

from geneoh.denoisers import library
from geneoh.nn.checkpoint import Checkpoint, save_checkpoint


def test_info_names_versions_devices_hands_and_weights(geneoh):
    result = geneoh("info")
    assert result.exit_code == 0, result.output
    assert f"torch {version('torch')}" in result.stdout
    assert "cpu: " in result.stdout
    assert "embedded right: " in result.stdout
    assert "Weights" in result.stdout


def test_info_says_why_a_mano_folder_cannot_be_used(geneoh, tmp_path):
    result = geneoh("info", "--mano", tmp_path)
    assert result.exit_code == 0, result.output
    assert "mano right: not available" in result.stdout


def test_info_shows_how_the_weights_were_trained(geneoh, tmp_path, monkeypatch):
    record = {"steps": 1000, "config": {"motion": {"depth": 6}}}
    checkpoint = Checkpoint({"weight": torch.zeros(1000, 1000)}, record)
    save_checkpoint(tmp_path / "motion.safetensors", checkpoint)
    (tmp_path / "spatial.safetensors").write_text("no weights")
    monkeypatch.setattr(library, "SHIPPED", tmp_path)
    said = geneoh("info").stdout
    assert "motion: 1.00 M parameters, 3.8 MiB" in said
    assert "steps = 1000" in said
    assert "config.motion.depth = 6" in said
    assert "spatial: not usable" in said
