"""The calls of a pickle turned into values: the few that arrays and tensors need, each rebuilt
here.

Nothing named in the file is called, not even numpy's own functions: arrays are made from their
bytes after the declared shape was held against them. Tensors, chumpy arrays and sparse matrices all
come out as numpy arrays.
"""

import math
import re
from collections.abc import Callable
from typing import Any

import numpy as np

from geneoh.errors import InputError
from geneoh.pickles.machine import ARRAY_WRAPPER, Call, Machine, Name, Pairs, Stored

DEPTH_LIMIT = 48
"""Lists within lists; data sets nest five deep."""

BYTES_LIMIT = 2**30
"""Of all arrays of one file; an hour of two hands takes less than half."""

Storages = dict[str, np.ndarray]
"""Numbers of torch tensors by the key of their storage."""

DTYPE = re.compile(r"[biufcSU?O]\d{0,4}")

STORAGES = {
    "torch.DoubleStorage": "<f8",
    "torch.FloatStorage": "<f4",
    "torch.HalfStorage": "<f2",
    "torch.LongStorage": "<i8",
    "torch.IntStorage": "<i4",
    "torch.ShortStorage": "<i2",
    "torch.CharStorage": "i1",
    "torch.ByteStorage": "u1",
    "torch.BoolStorage": "?",
    "torch.BFloat16Storage": "bfloat16",
}
"""Kinds of numbers by the class that a checkpoint names; numpy has no bfloat16 of its own."""


class Decoder:
    """Turns the tree of one file into values; a value that is used twice is built once."""

    def __init__(self, file: str, stored: Callable[["Decoder", Any], np.ndarray]) -> None:
        self.file, self.stored = file, stored
        self.done: dict[int, Any] = {}
        self.kept: list[Any] = []
        self.depth = 0
        self.bytes = 0

    def refuse(self, name: str, problem: str) -> InputError:
        """The error for a known call with arguments that cannot be."""
        return InputError(f"{self.file}: '{name}' {problem}; the pickle is damaged or hostile")

    def value(self, node: Any) -> Any:
        """A node of the tree as a plain value."""
        if isinstance(node, Name):
            raise self.refuse(node.text, "is kept as a value")
        if not isinstance(node, list | tuple | Pairs | Call | Stored):
            return node
        key = id(node)
        if key in self.done:
            if self.done[key] is ...:
                raise self.refuse("list", "holds itself")
            return self.done[key]
        self.depth += 1
        if self.depth > DEPTH_LIMIT:
            raise self.refuse("list", f"is nested deeper than {DEPTH_LIMIT}")
        self.done[key] = ...
        self.kept.append(node)  # an id is only good for as long as its object lives
        self.done[key] = self.built(node)
        self.depth -= 1
        return self.done[key]

    def built(self, node: Any) -> Any:
        """A list, tuple, dict, tensor storage or call as a value."""
        match node:
            case list():
                return [self.value(item) for item in node]
            case tuple():
                return tuple(self.value(item) for item in node)
            case Pairs():
                return self.mapping(node.items)
            case Stored():
                return self.stored(self, node.key)
            case _:
                return DECODERS[node.name](self, node)

    def mapping(self, items: list[Any]) -> dict[Any, Any]:
        """A dict, of which the keys must be plain."""
        result = {}
        for pair in items:
            if not isinstance(pair, tuple) or len(pair) != 2:
                raise self.refuse("dict", "holds what is no pair")
            key = self.value(pair[0])
            key = key.item() if isinstance(key, np.generic | np.ndarray) and key.size == 1 else key
            if not isinstance(key, str | bytes | int | float | None):
                raise self.refuse("dict", f"has a key of type {type(key).__name__}")
            result[key] = self.value(pair[1])
        return result

    def spend(self, name: str, count: int) -> None:
        """Count the bytes of an array before it is made."""
        self.bytes += count
        if self.bytes > BYTES_LIMIT:
            raise self.refuse(name, f"asks for more than {BYTES_LIMIT / 2**30:g} GiB in all")


def dtype_of(decoder: Decoder, node: Any) -> np.dtype:
    """The kind of numbers that `numpy.dtype` was called for."""
    name = "numpy.dtype"
    if not isinstance(node, Call) or node.name != name or not node.args:
        raise decoder.refuse(name, "is not where an array needs it")
    text = decoder.value(node.args[0])
    if not isinstance(text, str) or not DTYPE.fullmatch(text):
        shown = repr(text[:40]) if isinstance(text, str) else f"a {type(text).__name__}"
        raise decoder.refuse(name, f"is {shown}, not one of plain numbers or text")
    dtype = np.dtype(text)
    state = decoder.value(node.state)
    order = state[1] if isinstance(state, tuple) and len(state) > 1 else "|"
    if isinstance(state, tuple) and len(state) > 3 and state[3] is not None:
        raise decoder.refuse(name, "has named fields, which no layout uses")
    return dtype.newbyteorder(order) if order in ("<", ">") else dtype


def shape_of(decoder: Decoder, name: str, shape: Any) -> tuple[int, ...]:
    """A shape that can be one."""
    shape = (shape,) if isinstance(shape, int) else shape
    if not isinstance(shape, tuple) or len(shape) > 16:
        raise decoder.refuse(name, "has no shape")
    if not all(isinstance(n, int) and not isinstance(n, bool) and 0 <= n < 2**40 for n in shape):
        raise decoder.refuse(name, "has a shape that is none")
    return shape


def array_from(
    decoder: Decoder, name: str, shape: Any, dtype: np.dtype, raw: Any, *, fortran: bool
) -> np.ndarray:
    """An array from its bytes, or an array of objects from a list."""
    shape = shape_of(decoder, name, shape)
    count = math.prod(shape)
    if dtype.hasobject:
        values = decoder.value(raw)
        if not isinstance(values, list) or len(values) != count:
            raise decoder.refuse(name, f"declares shape {shape} for another number of objects")
        array = np.empty(count, dtype=object)
        for index, value in enumerate(values):
            array[index] = value
    else:
        raw = raw.encode("latin1") if isinstance(raw, str) else decoder.value(raw)
        size = len(raw) if isinstance(raw, bytes) else -1
        if dtype.itemsize == 0 or size != count * dtype.itemsize:
            raise decoder.refuse(name, f"declares shape {shape} of {dtype} for {size} bytes")
        decoder.spend(name, size)
        array = np.frombuffer(raw, dtype).copy()
    return array.reshape(shape, order="F" if fortran else "C")


def decode_array(decoder: Decoder, call: Call) -> np.ndarray:
    """`numpy.ndarray`: (version, shape, dtype, is_fortran, raw), the state of `_reconstruct`."""
    state = call.state
    if not isinstance(state, tuple) or len(state) != 5:
        raise decoder.refuse(call.name, "comes without an array's state")
    _, shape, dtype, fortran, raw = state
    kind = dtype_of(decoder, dtype)
    shape = decoder.value(shape)
    return array_from(decoder, call.name, shape, kind, raw, fortran=bool(fortran))


def decode_buffer(decoder: Decoder, call: Call) -> np.ndarray:
    """`_frombuffer` of protocol 5: (bytes, dtype, shape, order)."""
    if len(call.args) != 4:
        raise decoder.refuse(call.name, "needs four arguments")
    raw, dtype, shape, order = call.args
    kind = dtype_of(decoder, dtype)
    if kind.hasobject:
        raise decoder.refuse(call.name, "makes objects from bytes")
    shape = decoder.value(shape)
    return array_from(decoder, call.name, shape, kind, raw, fortran=order == "F")


def decode_scalar(decoder: Decoder, call: Call) -> Any:
    """One number of numpy: (dtype, raw)."""
    if len(call.args) != 2:
        raise decoder.refuse(call.name, "needs two arguments")
    kind = dtype_of(decoder, call.args[0])
    if kind.hasobject:
        raise decoder.refuse(call.name, "is an object")
    return array_from(decoder, call.name, (), kind, call.args[1], fortran=False)[()]


def decode_bytes(decoder: Decoder, call: Call) -> bytes:
    """Bytes as Python 3 writes them for Python 2: a string with its encoding, or none at all."""
    args = decoder.value(call.args)
    if not args:
        return b""
    if len(args) != 2 or not isinstance(args[0], str) or args[1] not in ("latin1", "latin-1"):
        raise decoder.refuse(call.name, "is used for other than latin1 bytes")
    return args[0].encode("latin1")


def decode_dict(decoder: Decoder, call: Call) -> dict[Any, Any]:
    """`OrderedDict`, empty or from a list of pairs, and what was set on it afterwards."""
    first: Any = call.args[0] if call.args else []
    if isinstance(first, Pairs):
        first = first.items
    if not isinstance(first, list):
        raise decoder.refuse(call.name, "is made from what is no list of pairs")
    return decoder.mapping([*(tuple(p) if isinstance(p, list) else p for p in first), *call.items])


def decode_chumpy(decoder: Decoder, call: Call) -> np.ndarray:
    """A chumpy array: its numbers, or the selection from another one."""
    state = decoder.value(call.state)
    values = state.get("x") if isinstance(state, dict) else None
    if values is None and isinstance(state, dict):
        source, chosen = state.get("a"), state.get("idxs")
        if isinstance(source, np.ndarray) and isinstance(chosen, np.ndarray):
            decoder.spend(call.name, chosen.size * source.itemsize)
            values = source.ravel()[chosen.astype(np.int64)]
            values = values.reshape(state.get("preferred_shape", values.shape))
    if not isinstance(values, np.ndarray) or values.dtype.hasobject:
        raise decoder.refuse(call.name, "holds no array of numbers")
    return values


def decode_set(decoder: Decoder, call: Call) -> list[Any]:
    """A set of Python 2, read as a list."""
    values = decoder.value(call.args[0]) if call.args else []
    if not isinstance(values, list):
        raise decoder.refuse(call.name, "is made from what is no list")
    return values


def decode_sparse(decoder: Decoder, call: Call) -> np.ndarray:
    """A compressed sparse matrix of scipy, made dense."""
    state = decoder.value(call.state)
    if not isinstance(state, dict) or not {"data", "indices", "indptr"} <= state.keys():
        raise decoder.refuse(call.name, "comes without a matrix's state")
    rows, columns = shape_of(decoder, call.name, state.get("_shape", state.get("shape")))
    parts = [state[key] for key in ("data", "indices", "indptr")]
    if not all(isinstance(part, np.ndarray) and part.dtype.kind in "biuf" for part in parts):
        raise decoder.refuse(call.name, "holds what is no array of numbers")
    data, indices, starts = parts
    by_row = "csr" in call.name
    major, minor = (rows, columns) if by_row else (columns, rows)
    counts = np.diff(starts)
    sound = data.ndim == indices.ndim == starts.ndim == 1 and len(starts) == major + 1
    if not sound or (counts < 0).any() or starts[0] != 0 or counts.sum() != len(data):
        raise decoder.refuse(call.name, "has pointers that do not fit")
    if len(indices) != len(data) or ((indices < 0) | (indices >= minor)).any():
        raise decoder.refuse(call.name, "has indices outside of the matrix")
    decoder.spend(call.name, rows * columns * data.dtype.itemsize)
    dense = np.zeros((major, minor), data.dtype)
    np.add.at(dense, (np.repeat(np.arange(major), counts), indices.astype(np.int64)), data)
    return dense if by_row else dense.T.copy()


def decode_joblib(decoder: Decoder, call: Call) -> np.ndarray:
    """An array of a joblib dump, whose bytes were found in the stream."""
    if not isinstance(call.state, Pairs):
        raise decoder.refuse(call.name, "comes without its description")
    if isinstance(call.raw, Call):
        return decoder.value(call.raw)
    found = wrapper_fields(decoder, call)
    shape, order = decoder.value(found["shape"]), decoder.value(found["order"])
    kind = dtype_of(decoder, found["dtype"])
    return array_from(decoder, call.name, shape, kind, call.raw, fortran=order == "F")


def wrapper_fields(decoder: Decoder, call: Call) -> dict[str, Any]:
    """What a joblib dump says about an array, not yet decoded."""
    found = {pair[0]: pair[1] for pair in call.state.items if isinstance(pair[0], str)}
    if not {"shape", "order", "dtype"} <= found.keys():
        raise decoder.refuse(call.name, "comes without shape, order and dtype")
    return found


def read_raw_array(machine: Machine, call: Call) -> None:
    """Take the bytes of a joblib array, which follow its description in the stream."""
    decoder = Decoder(machine.file, nothing_stored)
    if not isinstance(call.state, Pairs):
        raise decoder.refuse(call.name, "comes without its description")
    found = wrapper_fields(decoder, call)
    dtype = dtype_of(decoder, found["dtype"])
    if dtype.hasobject:
        inner = Machine(machine.data, machine.file, machine.known, None, machine.position)
        call.raw = inner.run()
        machine.position = inner.position
        return
    shape = shape_of(decoder, call.name, decoder.value(found["shape"]))
    if decoder.value(found.get("numpy_array_alignment_bytes")) is not None:
        machine.take(machine.take(1)[0])
    call.raw = machine.take(math.prod(shape) * dtype.itemsize)


def nothing_stored(decoder: Decoder, key: Any) -> np.ndarray:
    """A pickle that is no checkpoint must hold all of its numbers itself."""
    raise decoder.refuse("persistent id", "stands in a pickle that keeps nothing outside")


def decode_tensor(decoder: Decoder, call: Call) -> np.ndarray:
    """A torch tensor: (storage, offset, size, stride, ...)."""
    if len(call.args) < 4:
        raise decoder.refuse(call.name, "needs storage, offset, size and stride")
    storage, offset, size, stride = (decoder.value(part) for part in call.args[:4])
    size, stride = (shape_of(decoder, call.name, part) for part in (size, stride))
    if not isinstance(storage, np.ndarray) or not isinstance(offset, int) or offset < 0:
        raise decoder.refuse(call.name, "is given no storage")
    if len(size) != len(stride):
        raise decoder.refuse(call.name, "has sizes and strides of different numbers")
    count = math.prod(size)
    last = offset + sum((n - 1) * step for n, step in zip(size, stride, strict=True))
    if count and last >= len(storage):
        raise decoder.refuse(call.name, f"reads entry {last} of a storage of {len(storage)}")
    decoder.spend(call.name, count * storage.itemsize)
    if not count:
        return np.zeros(size, storage.dtype)
    steps = tuple(step * storage.itemsize for step in stride)
    return np.lib.stride_tricks.as_strided(storage[offset:], size, steps, writeable=False).copy()


def decode_parameter(decoder: Decoder, call: Call) -> np.ndarray:
    """A trained tensor: the tensor it wraps."""
    tensor = decoder.value(call.args[0]) if call.args else None
    if not isinstance(tensor, np.ndarray):
        raise decoder.refuse(call.name, "wraps no tensor")
    return tensor


def decode_size(decoder: Decoder, call: Call) -> tuple[int, ...]:
    """A tensor's shape kept as a value."""
    return shape_of(decoder, call.name, decoder.value(call.args[0]) if call.args else None)


def decode_storage(decoder: Decoder, call: Call) -> np.ndarray:
    """The numbers of a tensor that was pickled by itself: bytes that are a checkpoint in turn."""
    from geneoh.pickles.checkpoints import read_storage

    raw = decoder.value(call.args[0]) if call.args else None
    if not isinstance(raw, bytes):
        raise decoder.refuse(call.name, "is given no bytes")
    return read_storage(decoder, raw)


def storage_from(decoder: Decoder, kind: str, raw: bytes, count: int) -> np.ndarray:
    """Numbers of a tensor from their bytes, of which there must be as many as declared."""
    wide = STORAGES[kind] == "bfloat16"
    dtype = np.dtype("<u2" if wide else STORAGES[kind])
    if len(raw) != count * dtype.itemsize:
        raise decoder.refuse(kind, f"declares {count} numbers for {len(raw)} bytes")
    decoder.spend(kind, len(raw))
    values = np.frombuffer(raw, dtype)
    # bfloat16 is the upper half of a float32.
    return (values.astype("<u4") << 16).view("<f4") if wide else values


def is_no_call(decoder: Decoder, call: Call) -> Any:
    """A name that only stands as an argument was called."""
    raise decoder.refuse(call.name, "is called")


NUMPY = ("numpy.core", "numpy._core")
SPARSE = ("csc", "csr", "_csc", "_csr")
DECODERS: dict[str, Callable[[Decoder, Call], Any]] = {
    **{f"{core}.multiarray._reconstruct": decode_array for core in NUMPY},
    **{f"{core}.multiarray.scalar": decode_scalar for core in NUMPY},
    **{f"{core}.numeric._frombuffer": decode_buffer for core in NUMPY},
    **{f"scipy.sparse.{m}.{m.strip('_')}_matrix": decode_sparse for m in SPARSE},
    **{f"scipy.sparse.{m}.{m.strip('_')}_array": decode_sparse for m in SPARSE},
    **dict.fromkeys(("chumpy.ch.Ch", "chumpy.reordering.Select"), decode_chumpy),
    **dict.fromkeys(("numpy.ndarray", "numpy.dtype", *STORAGES), is_no_call),
    **dict.fromkeys(("builtins.object", "__builtin__.object"), is_no_call),
    **{f"{m}.{f}": is_no_call for m in ("copy_reg", "copyreg") for f in ("_reconstructor",)},
    **{f"{m}.{f}": is_no_call for m in ("copy_reg", "copyreg") for f in ("__newobj__",)},
    **dict.fromkeys(("builtins.bytes", "__builtin__.bytes", "_codecs.encode"), decode_bytes),
    **dict.fromkeys(("builtins.set", "__builtin__.set"), decode_set),
    "collections.OrderedDict": decode_dict,
    ARRAY_WRAPPER: decode_joblib,
    "torch._utils._rebuild_tensor": decode_tensor,
    "torch._utils._rebuild_tensor_v2": decode_tensor,
    "torch._utils._rebuild_parameter": decode_parameter,
    "torch.storage._load_from_bytes": decode_storage,
    "torch.Size": decode_size,
}
"""Every name that may stand in a pickle, and what is made of a call of it."""


def plain_name(decoder: Decoder, node: Any) -> str:
    """The text of a name that stands as an argument."""
    if not isinstance(node, Name):
        raise decoder.refuse("persistent id", "names no class of numbers")
    return node.text
