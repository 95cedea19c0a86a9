"""Damage to files, and a guard against what a pickle that runs would do; for all readers' tests."""

import builtins
import os
import pickle
import random
import subprocess
import sys

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
    evaluate = eval

    def forbidden(*given, **__):
        if sys._getframe(1).f_globals.get("__name__") == "typing":  # annotations, for jaxtyping
            return evaluate(*given)
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


ODD_VALUES = (
    *(None, True, -1, 0, 1.5, 1e300, 10**400, float("nan"), float("inf"), "text", b"bytes"),
    *([], {}, [1, 2, [3]], (1, 2), {"a": 1}, np.zeros(0), np.zeros((3, 3)), np.array("text")),
    *(np.zeros((2, 2, 2, 2)), np.full((9, 3), np.nan), np.array(None, dtype=object)),
)
"""Values that a damaged file may hold in the place of any other."""


def changed_value(value, draw: random.Random):
    """A value as decoded from a file, with one thing in it that no such file should hold."""
    if isinstance(value, np.ndarray) and value.dtype != object:
        return changed_array(value, draw)
    if draw.random() < 0.1 or not isinstance(value, dict | list | tuple) or not value:
        return draw.choice(ODD_VALUES)
    keys = list(value) if isinstance(value, dict) else list(range(len(value)))
    items = dict(value) if isinstance(value, dict) else dict(enumerate(value))
    key, chance = draw.choice(keys), draw.random()
    if chance < 0.1:
        del items[key]
    elif chance < 0.2:
        items[draw.choice([3, None, -5, 10**9, "0010000000", (1, 2)])] = items.pop(key)
    else:
        items[key] = changed_value(items[key], draw)
    return items if isinstance(value, dict) else list(items.values())


def changed_array(array: np.ndarray, draw: random.Random) -> np.ndarray:
    """An array of other length, other type, or with numbers that are no measurements."""
    odd = draw.choice([np.nan, np.inf, 0, -1e9, 1e300])
    if array.ndim and draw.random() < 0.3:
        return draw.choice([array[:-1], np.concatenate([array, array]), array[:0]])
    if array.dtype.names is not None:
        array, field = array.copy(), draw.choice(array.dtype.names)
        with np.errstate(all="ignore"):
            array[field] = np.full(array[field].shape, odd).astype(array[field].dtype)
        return array
    if array.dtype.kind not in "fiu" or not array.size:
        return np.array("text")
    array = np.array(array, dtype=np.float64)
    place = slice(None) if draw.random() < 0.3 else draw.randrange(array.size)
    array.reshape(-1)[place] = odd
    return array
