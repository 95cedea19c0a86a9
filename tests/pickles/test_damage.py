"""Damaged files of every kind that holds pickles: values or one sentence, and nothing is run."""

import builtins
import os
import pickle
import random
import subprocess
import zlib
from io import BytesIO

import numpy as np
import pytest
import torch

from geneoh.errors import InputError
from geneoh.pickles.files import decode, read_values

TRIALS = 200
"""Damaged files of each kind."""


class Forbidden(BaseException):
    """Something was called that only a pickle that runs would call."""


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


def damaged(data: bytes, draw: random.Random) -> bytes:
    """Cut short, some bytes changed, a piece doubled, or a piece taken out."""
    place = draw.randrange(len(data))
    match draw.randrange(4):
        case 0:
            return data[:place]
        case 1:
            changed = bytearray(data)
            for _ in range(draw.randrange(1, 6)):
                changed[draw.randrange(len(data))] = draw.randrange(256)
            return bytes(changed)
        case 2:
            return data[:place] + data[place : place + 40] + data[place:]
        case _:
            return data[:place] + data[place + draw.randrange(1, 40) :]


@pytest.mark.filterwarnings("ignore")  # numpy warns of headers that it then refuses
@pytest.mark.parametrize("kind", kinds())
def test_damage_ends_in_one_sentence(kind, tmp_path, monkeypatch):
    data, draw, path = kinds()[kind], random.Random(kind), tmp_path / "a.bin"
    assert decode(data, "a")

    def forbidden(*_, **__):
        raise Forbidden

    for module, name in (
        (os, "system"),
        (subprocess, "Popen"),
        (builtins, "eval"),
        (pickle, "load"),
        (pickle, "loads"),
        (pickle, "Unpickler"),
        (torch, "load"),
        (np, "load"),
    ):
        monkeypatch.setattr(module, name, forbidden)
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
