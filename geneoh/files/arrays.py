"""Arrays in pickles of numpy, scipy, chumpy and joblib, rebuilt from checked bytes.

A file's calls are never run, not even those of numpy's own functions: an array is made here, after
its declared shape was compared with its bytes. Chumpy arrays and sparse matrices become numpy
arrays.
"""

import math
import re
from typing import Any

import numpy as np

from geneoh.files.pickles import ARRAY_WRAPPER, DICT, PERSISTENT, PLAIN, Call, Loader, Rebuild

ITEM_BYTES = 100
"""Least memory of an item of a dict, bytes."""

DTYPE = re.compile(r"[biufcSU?O]\d{0,4}")


def shape_of(shape: Any) -> tuple[int, ...]:
    """A declared shape as a tuple; ValueError where it is not a possible one."""
    shape = (shape,) if isinstance(shape, int) else shape
    if not isinstance(shape, tuple) or len(shape) > 16:
        raise ValueError("has no shape")
    if not all(isinstance(n, int) and not isinstance(n, bool) and 0 <= n < 2**40 for n in shape):
        raise ValueError("has a shape that is none")
    return shape


def array_from(
    loader: Loader, shape: Any, dtype: Any, raw: Any, *, fortran: bool = False
) -> np.ndarray:
    """An array from its bytes, or an array of objects from a list."""
    shape = shape_of(shape)
    count = math.prod(shape)
    if not isinstance(dtype, np.dtype):
        raise ValueError("comes without a numpy.dtype")
    if dtype.hasobject:
        if not isinstance(raw, list) or len(raw) != count:
            raise ValueError(f"declares shape {shape} for another number of objects")
        loader.spend(8 * count)
        array = np.empty(count, dtype=object)
        for index, value in enumerate(raw):
            array[index] = value
    else:
        raw = raw.encode("latin1") if isinstance(raw, str) else raw  # bytes of Python 2
        size = len(raw) if isinstance(raw, bytes) else -1
        if dtype.itemsize == 0 or size != count * dtype.itemsize:
            raise ValueError(f"declares shape {shape} of {dtype} for {size} bytes")
        loader.spend(size)
        array = np.frombuffer(raw, dtype).copy()
    return array.reshape(shape, order="F" if fortran else "C")


def rebuild_dtype(loader: Loader, call: Call) -> np.dtype:
    """A dtype: arguments (text, ...), and state (version, byte order, None, None, ...)."""
    text, *_ = loader.value(call.args)
    if not isinstance(text, str) or not DTYPE.fullmatch(text):
        raise ValueError(f"is {str(text)[:40]!r}, not one of plain numbers or text")
    _, order, _, fields, *_ = loader.value(call.state) or (None,) * 4
    if fields is not None:
        raise ValueError("has named fields, which no layout uses")
    dtype = np.dtype(text)
    return dtype.newbyteorder(order) if order in ("<", ">") else dtype


def rebuild_array(loader: Loader, call: Call) -> np.ndarray:
    """An array from its state: (version, shape, dtype, whether in Fortran order, bytes)."""
    _version, shape, dtype, fortran, raw = loader.value(call.state)
    return array_from(loader, shape, dtype, raw, fortran=bool(fortran))


def rebuild_buffer(loader: Loader, call: Call) -> np.ndarray:
    """An array of pickle protocol 5: (bytes, dtype, shape, order)."""
    raw, dtype, shape, order = loader.value(call.args)
    return array_from(loader, shape, dtype, raw, fortran=order == "F")


def rebuild_scalar(loader: Loader, call: Call) -> Any:
    """One number of numpy."""
    dtype, raw = loader.value(call.args)
    return array_from(loader, (), dtype, raw)[()]


def rebuild_joblib(loader: Loader, call: Call) -> np.ndarray:
    """An array of a joblib dump; its bytes follow next in the file."""
    state = {name: node for name, node in call.state.items if isinstance(name, str)}
    shape, dtype, order = (loader.value(state[name]) for name in ("shape", "dtype", "order"))
    if dtype.hasobject:
        return loader.value(loader.tree())
    if loader.value(state.get("numpy_array_alignment_bytes")) is not None:
        loader.read(loader.read(1)[0])
    raw = loader.read(math.prod(shape_of(shape)) * dtype.itemsize)
    return array_from(loader, shape, dtype, raw, fortran=order == "F")


def rebuild_chumpy(loader: Loader, call: Call) -> np.ndarray:
    """A chumpy array: its numbers, or a selection from another array."""
    state = loader.value(call.state)
    if "x" not in state:
        source, chosen = state["a"], state["idxs"]
        loader.spend(chosen.size * source.itemsize)
        values = source.ravel()[chosen.astype(np.int64)]
        return values.reshape(state.get("preferred_shape", values.shape))
    if not isinstance(state["x"], np.ndarray):
        raise ValueError("holds no array")
    return state["x"]


def rebuild_sparse(loader: Loader, call: Call) -> np.ndarray:
    """A compressed sparse matrix of scipy, made dense."""
    from scipy.sparse import csc_matrix, csr_matrix

    state = loader.value(call.state)
    rows, columns = shape_of(state.get("_shape", state.get("shape")))
    data, indices, starts = (state[key] for key in ("data", "indices", "indptr"))
    if data.dtype.kind not in "biuf" or not {indices.dtype.kind, starts.dtype.kind} <= set("iu"):
        raise ValueError("holds what is no array of numbers")
    loader.spend(rows * columns * data.dtype.itemsize)
    kind = csr_matrix if "csr" in call.name else csc_matrix
    matrix = kind((data, indices, starts), shape=(rows, columns))
    matrix.check_format(full_check=True)
    return matrix.toarray()


def rebuild_bytes(loader: Loader, call: Call) -> bytes:
    """Bytes that Python 3 pickled for Python 2: a string and its encoding; without both, empty."""
    text, encoding = loader.value(call.args) or ("", "latin1")
    if encoding not in ("latin1", "latin-1"):
        raise ValueError("is used for other than latin1 bytes")
    loader.spend(len(text))
    return text.encode("latin1")


def rebuild_dict(loader: Loader, call: Call) -> dict[Any, Any]:
    """A dict from its items; an `OrderedDict` also from the pairs that are its argument.

    Integer keys of more than 64 bits are refused: n of them with equal hashes take n**2 steps.
    """
    (first,) = call.args or ([],)
    first = first.items if isinstance(first, Call) else first
    loader.spend(ITEM_BYTES * (len(first) + len(call.items)))
    result = {}
    for name, item in [*first, *call.items]:
        key = loader.value(name)
        key = key.item() if isinstance(key, np.generic | np.ndarray) and key.size == 1 else key
        if type(key) not in PLAIN or (isinstance(key, int) and key.bit_length() > 64):
            raise ValueError(f"has a key that is a {type(key).__name__} or too long")
        result[key] = loader.value(item)
    return result


def first_argument(loader: Loader, call: Call) -> Any:
    """The first argument: the items of a set, the tensor of a parameter; without any, []."""
    return loader.value(call.args[0]) if call.args else []


def refuse_call(loader: Loader, call: Call) -> Any:
    """Refuse the call of a name that is allowed as an argument only."""
    raise ValueError("is called")


def refuse_stored(loader: Loader, call: Call) -> Any:
    """Refuse a value stored outside of the pickle, which only checkpoints may have."""
    raise ValueError("stands in a pickle that keeps nothing outside")


CORES = ("numpy.core", "numpy._core")
SPARSE = [
    f"scipy.sparse.{module}.{module.strip('_')}_{kind}"
    for module in ("csc", "csr", "_csc", "_csr")
    for kind in ("matrix", "array")
]
ARRAYS: dict[str, Rebuild] = {
    **{f"{core}.multiarray._reconstruct": rebuild_array for core in CORES},
    **{f"{core}.multiarray.scalar": rebuild_scalar for core in CORES},
    **{f"{core}.numeric._frombuffer": rebuild_buffer for core in CORES},
    **dict.fromkeys(SPARSE, rebuild_sparse),
    **dict.fromkeys(("chumpy.ch.Ch", "chumpy.reordering.Select"), rebuild_chumpy),
    **dict.fromkeys(("builtins.bytes", "__builtin__.bytes", "_codecs.encode"), rebuild_bytes),
    **dict.fromkeys(("builtins.set", "__builtin__.set"), first_argument),
    **dict.fromkeys(("builtins.object", "__builtin__.object", "numpy.ndarray"), refuse_call),
    **dict.fromkeys((DICT, "collections.OrderedDict"), rebuild_dict),
    "numpy.dtype": rebuild_dtype,
    ARRAY_WRAPPER: rebuild_joblib,
    PERSISTENT: refuse_stored,
}
"""Names that a pickle may contain, and the function that builds the value of each."""
