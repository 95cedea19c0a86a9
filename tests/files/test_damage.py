"""Damaged files of every kind that holds pickles: values or one sentence, and nothing is run."""

import pickle
import random
import zlib
from io import BytesIO

import numpy as np
import pytest
import torch
from damage import damaged, forbid

from geneoh.errors import InputError
from geneoh.files.values import decode, read_values

TRIALS = 200
"""Damaged files of each kind."""


def content() -> dict:
    return {
        "00000": {"hand_pose": torch.arange(4.0), "trans": np.arange(3.0)},
        "name": "mug",
        "frames": [1, 2, (3, None)],
        "objects": np.array({"x": np.arange(2)}, dtype=object),
    }


def saved(write) -> bytes:
    stream = BytesIO()
    write(stream)
    return stream.getvalue()


def kinds() -> dict[str, bytes]:
    held = np.array(content(), dtype=object)
    made = {f"protocol {p}": pickle.dumps(content(), protocol=p) for p in (0, 2, 4, 5)}
    return {
        **made,
        "compressed": zlib.compress(made["protocol 4"]),
        "checkpoint": saved(lambda f: torch.save(content(), f)),
        "stream": saved(lambda f: torch.save(content(), f, _use_new_zipfile_serialization=False)),
        "npy": saved(lambda f: np.save(f, held)),
        "npz": saved(lambda f: np.savez(f, a=held, b=np.arange(3))),
    }


@pytest.mark.filterwarnings("ignore")  # numpy warns of headers that it then refuses
@pytest.mark.parametrize("kind", kinds())
def test_damage_ends_in_one_sentence(kind, tmp_path, monkeypatch):
    data, draw, path = kinds()[kind], random.Random(kind), tmp_path / "a.bin"
    assert decode(data, "a")

    forbid(monkeypatch)
    sentences = []
    for _ in range(TRIALS):
        path.write_bytes(damaged(data, draw))
        try:
            read_values(path)
        except InputError as error:
            sentences.append(str(error))
    assert sentences
    assert not any("\n" in sentence for sentence in sentences)
    assert [file.name for file in tmp_path.iterdir()] == ["a.bin"]
