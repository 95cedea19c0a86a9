import json
from importlib.metadata import version

import torch

from geneoh.denoisers import library
from geneoh.nn.checkpoint import Checkpoint, save_checkpoint

SCREEN = (24, 80)
"""Lines and columns of the smallest terminal that is in use."""


def test_info_fits_on_one_screen(geneoh, monkeypatch):
    monkeypatch.delenv("GENEOH_MANO_DIR", raising=False)
    said = geneoh("info").stdout
    lines, columns = SCREEN
    assert sum(1 + len(line) // columns for line in said.splitlines()) < lines


def test_info_names_versions_devices_hands_and_weights(geneoh):
    result = geneoh("info")
    assert f"torch {version('torch')}" in result.stdout
    assert "cpu: " in result.stdout
    assert "embedded right: 778 vertices" in result.stdout
    assert "motion: " in result.stdout


def test_info_says_why_a_mano_folder_cannot_be_used(geneoh, tmp_path):
    result = geneoh("info", "--mano", tmp_path)
    assert "mano right: not available" in result.stdout


def test_info_as_json_holds_how_the_weights_were_trained(geneoh, tmp_path):
    found = json.loads(geneoh("info", "--json", "--mano", tmp_path).stdout)
    assert found["versions"]["torch"] == version("torch")
    assert "MANO_RIGHT.pkl" in found["hands"]["mano right"]["problem"]
    assert found["weights"]["motion"]["training"]["stage"] == "motion"
    assert found["weights"]["motion"]["training"]["config"]["motion"]["depth"] > 0
    for stage in ("text", "interaction", "body_hands"):
        assert "config" in found["generators"][stage]["training"]


def test_info_as_json_has_null_where_there_is_no_number(geneoh, tmp_path, monkeypatch):
    checkpoint = Checkpoint({"weight": torch.zeros(2)}, {"error_left": float("nan")})
    save_checkpoint(tmp_path / "motion.safetensors", checkpoint)
    monkeypatch.setattr(library, "SHIPPED", tmp_path)
    said = geneoh("info", "--json").stdout
    assert "NaN" not in said
    assert json.loads(said)["weights"]["motion"]["training"] == {"error_left": None}


def test_info_tells_sound_weights_from_damaged_ones(geneoh, tmp_path, monkeypatch):
    checkpoint = Checkpoint({"weight": torch.zeros(1000, 1000)}, {"steps": 1000})
    save_checkpoint(tmp_path / "motion.safetensors", checkpoint)
    (tmp_path / "spatial.safetensors").write_text("no weights")
    monkeypatch.setattr(library, "SHIPPED", tmp_path)
    said = geneoh("info").stdout
    assert "motion: 1.00 M parameters, 3.8 MiB" in said
    assert "spatial: not usable" in said
