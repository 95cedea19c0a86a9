"""Damage to files, and a guard against what a pickle that runs would do; for all readers' tests."""

import builtins
import os
import pickle
import random
import subprocess

import numpy as np
import torch

FORBIDDEN = (
    (os, "system"),
    (os, "popen"),
    (subprocess, "Popen"),
    (builtins, "eval"),
    (pickle, "load"),
    (pickle, "loads"),
    (pickle, "Unpickler"),
    (torch, "load"),
    (np, "load"),
)


class Forbidden(BaseException):
    """Something was called that only a pickle that runs would call."""


def forbid(monkeypatch) -> None:
    """Fail when any road out of a pickle is taken."""

    def forbidden(*_, **__):
        raise Forbidden

    for module, name in FORBIDDEN:
        monkeypatch.setattr(module, name, forbidden)


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
