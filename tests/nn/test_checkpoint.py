import json

import pytest
import torch
from safetensors.torch import save_file

from geneoh.errors import CheckpointError
from geneoh.nn.checkpoint import Checkpoint, load_checkpoint, save_checkpoint

TENSORS = {"weight": torch.arange(6.0).reshape(2, 3), "count": torch.tensor([1, 2])}
RECORD = {"stage": "motion", "config": {"motion": {"width": 16}}, "step": 3, "loss": 0.5}


def test_a_checkpoint_comes_back_as_it_was_saved(tmp_path):
    path = tmp_path / "a" / "b.safetensors"  # the folders are made
    save_checkpoint(path, Checkpoint(TENSORS, RECORD))
    loaded = load_checkpoint(path)
    assert loaded.record == RECORD
    assert loaded.tensors.keys() == TENSORS.keys()
    for name, tensor in TENSORS.items():
        assert torch.equal(loaded.tensors[name], tensor)
        assert loaded.tensors[name].dtype == tensor.dtype


@pytest.mark.parametrize("half", [torch.float16, torch.bfloat16])
def test_half_precision_comes_back_as_float32(tmp_path, half):
    path = tmp_path / "half.safetensors"
    save_checkpoint(path, Checkpoint({"w": TENSORS["weight"].to(half)}, RECORD))
    loaded = load_checkpoint(path).tensors["w"]
    assert loaded.dtype == torch.float32
    assert torch.equal(loaded, TENSORS["weight"])


@pytest.mark.parametrize("kept", [torch.float32, torch.float64, torch.int64, torch.bool])
def test_other_types_come_back_as_they_were(tmp_path, kept):
    path = tmp_path / "w.safetensors"
    save_checkpoint(path, Checkpoint({"w": TENSORS["weight"].to(kept)}, RECORD))
    assert load_checkpoint(path).tensors["w"].dtype == kept


def test_parameters_and_transposed_views_can_be_saved(tmp_path):
    path = tmp_path / "views.safetensors"
    weight = torch.nn.Parameter(TENSORS["weight"])
    save_checkpoint(path, Checkpoint({"w": weight, "t": weight.T}, {}))
    assert torch.equal(load_checkpoint(path).tensors["t"], TENSORS["weight"].T)


def test_saving_replaces_the_file_whole_and_leaves_nothing_beside_it(tmp_path):
    path = tmp_path / "w.safetensors"
    for step in (1, 2):
        save_checkpoint(path, Checkpoint(TENSORS, {"step": step}))
    assert load_checkpoint(path).record == {"step": 2}
    assert list(tmp_path.iterdir()) == [path]


def test_equal_checkpoints_are_equal_files(tmp_path):
    paths = [tmp_path / name for name in "ab"]
    for path in paths:
        save_checkpoint(path, Checkpoint(TENSORS, RECORD))
    assert paths[0].read_bytes() == paths[1].read_bytes()


def test_a_missing_file_is_told_with_its_path(tmp_path):
    with pytest.raises(CheckpointError, match=r"no\.safetensors: expected weights there"):
        load_checkpoint(tmp_path / "no.safetensors")


def test_a_folder_in_place_of_a_file_is_refused(tmp_path):
    with pytest.raises(CheckpointError, match="expected a file of weights that you may read"):
        load_checkpoint(tmp_path)


@pytest.mark.parametrize("kept", [0, 5, 100, -1])
def test_a_truncated_file_is_refused(tmp_path, kept):
    path = tmp_path / "w.safetensors"
    save_checkpoint(path, Checkpoint(TENSORS, RECORD))
    path.write_bytes(path.read_bytes()[:kept])
    with pytest.raises(CheckpointError, match=r"w\.safetensors: expected a safetensors file"):
        load_checkpoint(path)


@pytest.mark.parametrize("metadata", [None, {"format": "pt"}, {"record": "no json"}])
def test_a_file_without_a_record_is_refused(tmp_path, metadata):
    path = tmp_path / "w.safetensors"
    save_file(TENSORS, path, metadata=metadata)
    with pytest.raises(CheckpointError, match="record"):
        load_checkpoint(path)


def test_a_record_with_a_number_too_long_to_read_is_refused(tmp_path):
    path = tmp_path / "w.safetensors"
    save_file(TENSORS, path, metadata={"record": f'{{"step": {"9" * 5000}}}'})
    with pytest.raises(CheckpointError, match=r"w\.safetensors"):
        load_checkpoint(path)


def test_a_record_holds_what_json_holds(tmp_path):
    path = tmp_path / "w.safetensors"
    save_checkpoint(path, Checkpoint({}, RECORD))
    assert json.dumps(load_checkpoint(path).record) == json.dumps(RECORD)
