"""Damaged files of every source: one sentence or a sequence, no code run, nothing half-written."""

import builtins
import os
import pickle
import random
import subprocess

import numpy as np
import pytest
import torch
from trees import CASES, scene

from geneoh.datasets.base import Known
from geneoh.datasets.convert import find_clips, read_clip, source_named
from geneoh.errors import GeneOHError

TRIALS = 10
"""Damaged files of each tree; tests/pickles adds 1,800 below the adapters."""


class Forbidden(BaseException):
    """Something was called that only a pickle that runs would call."""


def damaged(data: bytes, draw: random.Random) -> bytes:
    """Cut short, some bytes changed, a piece doubled, or a piece taken out."""
    place = draw.randrange(max(1, len(data)))
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


@pytest.fixture
def canary(monkeypatch):
    """Fail when any road out of a pickle is taken."""

    def forbidden(*_, **__):
        raise Forbidden

    for module, name in (
        (os, "system"),
        (os, "popen"),
        (subprocess, "Popen"),
        (builtins, "eval"),
        (pickle, "load"),
        (pickle, "loads"),
        (pickle, "Unpickler"),
        (torch, "load"),
        (np, "load"),
    ):
        monkeypatch.setattr(module, name, forbidden)


@pytest.mark.filterwarnings("ignore")  # numbers out of range warn before they are refused
@pytest.mark.parametrize("case", CASES, ids=lambda case: case.build.__name__)
def test_damage_ends_in_one_sentence(case, tmp_path, mano_dir, canary):
    case.build(tmp_path, scene(case.left), False)
    draw = random.Random(case.source)
    source, start = source_named(case.source), (tmp_path / case.start).resolve()
    known = Known(
        mano_dir=mano_dir,
        **{n: tmp_path / v if n in ("objects", "body") else v for n, v in case.known},
    )
    clips = find_clips(source, [start])
    files = sorted(path for path in tmp_path.rglob("*") if path.is_file())
    before = {path: path.read_bytes() for path in files}
    sentences = []
    for _ in range(TRIALS):
        path = draw.choice(files)
        path.write_bytes(damaged(before[path], draw))
        try:
            for clip in clips:
                read_clip(source, clip, known)
        except GeneOHError as error:
            sentences.append(str(error))
        path.write_bytes(before[path])
    assert sentences
    assert not any("\n" in sentence for sentence in sentences)
    assert sorted(path for path in tmp_path.rglob("*") if path.is_file()) == files
