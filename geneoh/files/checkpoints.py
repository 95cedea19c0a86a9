"""Read files of torch.save: a zip with one member per storage, or the legacy stream.

A tensor inside an ordinary pickle is in the legacy format too. Tensors become numpy arrays, also
those saved from a GPU. `torch.load(weights_only=True)` is no substitute: it refuses the numpy
arrays and sparse matrices that data sets store beside tensors.
"""

import math
import zipfile
from collections.abc import Mapping
from typing import Any

import numpy as np

from geneoh.errors import InputError
from geneoh.files.arrays import ARRAYS, first_argument, refuse_call, shape_of
from geneoh.files.pickles import PERSISTENT, Call, Loader, Rebuild
from geneoh.files.reading import SIZE_LIMIT

MAGIC = 0x1950A86A20F9469CFC6C
"""First value of the legacy stream."""

KINDS = {"Double": "<f8", "Float": "<f4", "Half": "<f2", "BFloat16": "<u2", "Bool": "?"}
KINDS |= {"Long": "<i8", "Int": "<i4", "Short": "<i2", "Char": "i1", "Byte": "u1"}
STORAGES = {f"torch.{kind}Storage": dtype for kind, dtype in KINDS.items()}
"""The numpy dtype of each storage class that a checkpoint may name."""


def rebuild_tensor(loader: Loader, call: Call) -> np.ndarray:
    """A torch tensor: (storage, offset, size, stride, ...)."""
    storage, offset, *layout = loader.value(call.args[:4])
    size, stride = map(shape_of, layout)
    count = math.prod(size)
    last = offset + sum((n - 1) * step for n, step in zip(size, stride, strict=True))
    if offset < 0 or (count and last >= len(storage)):
        raise ValueError(f"reads entry {last} of a storage of {len(storage)}")
    loader.spend(count * storage.itemsize)
    if not count:
        return np.zeros(size, storage.dtype)
    steps = tuple(step * storage.itemsize for step in stride)
    return np.lib.stride_tricks.as_strided(storage[offset:], size, steps, writeable=False).copy()


def rebuild_storage(loader: Loader, call: Call) -> np.ndarray:
    """The storage of a tensor inside an ordinary pickle: bytes in the legacy format."""
    (raw,) = loader.value(call.args)
    loader.spend(len(raw))
    storage = read_stream(raw, loader.file, TENSORS)  # without `rebuild_storage`: not nested
    loader.spend(storage.nbytes)
    return storage


TENSORS: dict[str, Rebuild] = {
    **ARRAYS,
    **dict.fromkeys(STORAGES, refuse_call),
    "torch._utils._rebuild_tensor": rebuild_tensor,
    "torch._utils._rebuild_tensor_v2": rebuild_tensor,
    "torch._utils._rebuild_parameter": first_argument,
    "torch.Size": first_argument,
}
KNOWN: dict[str, Rebuild] = {**TENSORS, "torch.storage._load_from_bytes": rebuild_storage}
"""Every name that a file may contain, and the function that builds the value of each."""


def storage_id(call: Call) -> tuple[str, str, int]:
    """Class, key and length of a storage: ("storage", class, key, location, length, ...)."""
    kind, key, _location, count = call.args[0][1:5]
    if kind.text not in STORAGES or not isinstance(key, str | int) or not isinstance(count, int):
        raise ValueError("is not that of a tensor's storage")
    return kind.text, str(key), count


def storage_from(loader: Loader, kind: str, raw: bytes, count: int) -> np.ndarray:
    """A storage from its bytes; ValueError where they are not of the declared length."""
    dtype = np.dtype(STORAGES[kind])
    if len(raw) != count * dtype.itemsize:
        raise ValueError(f"declares {count} numbers for {len(raw)} bytes")
    loader.spend(len(raw))
    values = np.frombuffer(raw, dtype)
    # numpy has no bfloat16, which is the upper half of a float32.
    return (values.astype("<u4") << 16).view("<f4") if "BFloat16" in kind else values


def read_zip(archive: zipfile.ZipFile, file: str) -> Any:
    """The value in a zip checkpoint; `InputError` where a member does not hold what it declares."""
    if sum(info.file_size for info in archive.infolist()) > SIZE_LIMIT:
        raise InputError(
            f"{file}: the checkpoint must unpack to at most {SIZE_LIMIT / 2**30:g} GiB; "
            "save fewer frames into one file"
        )
    names = archive.namelist()
    main = [name for name in names if name.endswith("/data.pkl") or name == "data.pkl"]
    if len(main) != 1:
        raise InputError(
            f"{file}: expected one 'data.pkl' in the checkpoint, got {len(main)}; "
            "write it with torch.save"
        )
    root = main[0].removesuffix("data.pkl")
    if f"{root}byteorder" in names and archive.read(f"{root}byteorder") != b"little":
        raise InputError(f"{file}: expected a little-endian checkpoint; save it again on such a PC")

    arrays: dict[str, np.ndarray] = {}

    def stored(loader: Loader, call: Call) -> np.ndarray:
        kind, key, count = storage_id(call)
        if key not in arrays:  # many tensors may be parts of one storage
            arrays[key] = storage_from(loader, kind, archive.read(f"{root}data/{key}"), count)
        return arrays[key]

    loader = Loader(archive.read(main[0]), file, {**KNOWN, PERSISTENT: stored})
    return loader.value(loader.tree())


def is_stream(data: bytes) -> bool:
    """Whether bytes begin like the legacy format."""
    return data[:2] == b"\x80\x02" and MAGIC.to_bytes(10, "little") in data[:20]


def read_stream(data: bytes, file: str, known: Mapping[str, Rebuild] = KNOWN) -> Any:
    """Read the legacy format: pickles of magic, version, system, value and keys, then storages."""
    arrays: dict[str, np.ndarray] = {}

    def stored(loader: Loader, call: Call) -> np.ndarray:
        return arrays[storage_id(call)[1]]

    loader = Loader(data, file, {**known, PERSISTENT: stored})
    magic, _, _, value, keys = (loader.tree() for _ in range(5))
    if magic != MAGIC:
        raise loader.refuse("one that torch.save did not write")
    declared = {key: (kind, count) for kind, key, count in map(storage_id, loader.stored)}
    for key in map(str, keys):
        kind, count = declared[key]
        if (brought := int.from_bytes(loader.read(8), "little")) != count:
            raise loader.refuse(f"'{kind}' with {count} numbers and bytes of {brought}")
        raw = loader.read(count * np.dtype(STORAGES[kind]).itemsize)
        arrays[key] = storage_from(loader, kind, raw, count)
    return loader.value(value)
