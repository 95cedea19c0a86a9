import json

import pytest
import torch
from safetensors.torch import save_file

from geneoh.files.tensors import (
    DamagedTensorsError,
    all_tensors,
    opened_tensors,
    write_tensors,
)


def test_tensors_and_their_record_come_back(tmp_path):
    path = tmp_path / "a" / "b.safetensors"
    kept = {"x": torch.arange(6.0).view(2, 3).mT, "n": torch.tensor([1, 2])}
    write_tensors(path, kept, {"seed": 3, "names": ["ä"]}, parents=True)
    with opened_tensors(path) as (file, record):
        found = all_tensors(file)
    assert record == {"seed": 3, "names": ["ä"]}
    assert found.keys() == kept.keys()
    assert all(torch.equal(found[name], kept[name]) for name in kept)


@pytest.mark.parametrize(
    "record", ["[" * 100_000, "no JSON", "[1, 2]", '"text"', "7" * 5000, json.dumps(None)]
)
def test_a_record_that_is_none_is_damage(tmp_path, record):
    path = tmp_path / "w.safetensors"
    save_file({"x": torch.zeros(1)}, path, metadata={"record": record})
    with pytest.raises(DamagedTensorsError), opened_tensors(path):
        pass


def test_a_damaged_header_is_told_in_a_short_sentence(tmp_path):
    path = tmp_path / "w.safetensors"
    header = json.dumps({"x" * 20_000: {"dtype": "F32", "shape": ["a"], "data_offsets": [0, 4]}})
    path.write_bytes(len(header).to_bytes(8, "little") + header.encode() + bytes(4))
    with pytest.raises(DamagedTensorsError) as caught, opened_tensors(path):
        pass
    assert 0 < len(str(caught.value)) < 300


def test_what_a_reader_misses_is_damage_and_a_missing_file_is_none(tmp_path):
    path = tmp_path / "w.safetensors"
    save_file({"x": torch.zeros(1)}, path, metadata={"record": "{}"})
    with pytest.raises(DamagedTensorsError, match="seed"), opened_tensors(path) as (_, record):
        record["seed"]
    with pytest.raises(FileNotFoundError), opened_tensors(tmp_path / "no"):
        pass
