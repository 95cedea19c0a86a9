"""Arrays out of a pickle that is never run: what a MANO file holds, and nothing else.

MANO's official files are python-2 pickles of chumpy and scipy objects. Unpickling is running a
program that the file's author wrote; here every name such a program may use stands for an inert
class of ours, any other name is refused, and the arrays are put together afterwards from the plain
bytes that were left in those objects.
"""

import pickle
import pickletools
import re
from io import BytesIO
from math import prod
from typing import Any

import numpy as np

MOST_BYTES = 256 * 2**20
"""A MANO file has 4 MB; anything of this size is something else."""
MOST_OPCODES = 2_000_000
MOST_DEPTH = 8
"""How deep chumpy expressions may nest."""
MOST_ENTRIES = 2**25
"""Entries of an array that a file describes without holding them (a sparse matrix)."""
REFUSED_OPCODES = frozenset(
    ("EXT1", "EXT2", "EXT4", "PERSID", "BINPERSID", "INST", "OBJ", "NEXT_BUFFER")
)
DTYPE = re.compile(r"[<>=|]?([fiub]\d{1,2}|[SU]\d{1,4})")


class RefusedPickleError(Exception):
    """The pickle asks for something that a MANO file never needs; the text names it."""


class _Sealed(type):
    """Classes that a pickle cannot change: BUILD may set attributes of whatever it is given."""

    def __setattr__(cls, name: str, value: object) -> None:
        raise RefusedPickleError(f"a change of {name!r} in the reader itself")


class _Inert(metaclass=_Sealed):
    """Keeps what it was made from and does nothing."""

    args: tuple[Any, ...] = ()
    state: Any = None

    def __new__(cls, *args: Any) -> "_Inert":
        made = super().__new__(cls)
        made.args = args
        return made

    def __setstate__(self, state: Any) -> None:
        self.state = state


class _Array(_Inert):
    """numpy.ndarray: state is (version, shape, dtype, Fortran order, bytes)."""


class _Buffer(_Inert):
    """numpy's own protocol-5 form: args are (bytes, dtype, shape, order)."""


class _Dtype(_Inert):
    """numpy.dtype: args start with its name, state holds the byte order."""


class _Scalar(_Inert):
    """A single number: args are (dtype, bytes)."""


class _Sparse(_Inert):
    """A compressed scipy.sparse matrix: state holds data, indices, indptr and shape."""

    rows = True


class _SparseColumns(_Sparse):
    rows = False


class _Chumpy(_Inert):
    """Any chumpy object."""


class _Select(_Chumpy):
    """chumpy.reordering.Select: entries of another object."""


class _Rebuild(metaclass=_Sealed):
    """copy_reg._reconstructor(cls, object, None), how protocols 0 and 1 make an object."""

    def __new__(cls, kind: Any, *_: Any) -> Any:
        if not (isinstance(kind, type) and issubclass(kind, _Inert)):
            raise RefusedPickleError("an object of no known kind")
        return kind()


class _Encode(bytes, metaclass=_Sealed):
    """_codecs.encode(text, 'latin1') and bytes(): how python 3 stores bytes for python 2."""

    def __new__(cls, text: str = "", _encoding: str = "latin1") -> "_Encode":
        return super().__new__(cls, text.encode("latin1"))


NUMPY = {
    "multiarray": {"_reconstruct": _Array, "scalar": _Scalar},
    "numeric": {"_frombuffer": _Buffer},
}
KNOWN: dict[tuple[str, str], Any] = {
    ("numpy", "ndarray"): _Array,
    ("numpy", "dtype"): _Dtype,
    ("copy_reg", "_reconstructor"): _Rebuild,
    ("copyreg", "_reconstructor"): _Rebuild,
    ("__builtin__", "object"): _Inert,
    ("builtins", "object"): _Inert,
    ("__builtin__", "set"): frozenset,
    ("builtins", "set"): frozenset,
    ("__builtin__", "bytes"): _Encode,
    ("builtins", "bytes"): _Encode,
    ("_codecs", "encode"): _Encode,
} | {
    (f"numpy.{core}.{module}", name): kind
    for core in ("core", "_core")
    for module, names in NUMPY.items()
    for name, kind in names.items()
}


class _Reader(pickle.Unpickler):
    """Knows the names above, scipy's compressed matrices and chumpy's classes."""

    def find_class(self, module: str, name: str) -> Any:
        top = module.split(".")[0]
        if top == "chumpy" and name.isidentifier():
            return _Select if name == "Select" else _Chumpy
        if module == "scipy.sparse" or module.startswith("scipy.sparse."):
            if name in ("csc_matrix", "csc_array"):
                return _SparseColumns
            if name in ("csr_matrix", "csr_array"):
                return _Sparse
        if (module, name) not in KNOWN:
            raise RefusedPickleError(f"{module}.{name}")
        return KNOWN[module, name]


def read_pickle(data: bytes) -> dict[str, Any]:
    """The dictionary a MANO pickle holds, its arrays still folded up; see `unfold`.

    Raises:
        RefusedPickleError: it uses a name or an operation that a MANO file never needs.
        ValueError: it is broken, or no pickle at all.
    """
    try:
        _inspect(data)
        found = _Reader(BytesIO(data), encoding="latin1").load()
    except RefusedPickleError:
        raise
    # A broken pickle fails in any of a dozen ways, none of them this program's fault.
    except Exception as error:
        raise ValueError(f"{type(error).__name__}: {error}") from error
    if not isinstance(found, dict):
        raise ValueError(f"it holds a {type(found).__name__}, not a dictionary")
    return found


def _inspect(data: bytes) -> None:
    """Walk through the opcodes, running none, and refuse those that no MANO file has."""
    for count, (opcode, arg, _) in enumerate(pickletools.genops(data)):
        if opcode.name in REFUSED_OPCODES:
            raise RefusedPickleError(f"the operation {opcode.name}")
        # The memo is a table as long as its highest index: a huge one would fill the memory.
        if count > MOST_OPCODES or (opcode.name.endswith("PUT") and int(arg or 0) > MOST_OPCODES):
            raise RefusedPickleError("far more objects than a hand model has")


def unfold(value: Any, depth: int = 0) -> np.ndarray:
    """The array that an object from `read_pickle` stands for.

    Raises:
        ValueError: it is no array, or one that cannot be put together.
    """
    if depth > MOST_DEPTH:
        raise ValueError("its expression is nested too deep")
    match value:
        case _Array(state=(_, shape, dtype, fortran, raw)):
            return _from_bytes(raw, dtype, shape, "F" if fortran else "C")
        case _Buffer(args=(raw, dtype, shape, order)):
            return _from_bytes(raw, dtype, shape, order)
        case _Scalar(args=(dtype, raw)):
            return _from_bytes(raw, dtype, (), "C")
        case _Sparse(state=dict() as state):
            return _dense(state, value.rows)
        case _Select(state=dict() as state):
            source = unfold(state.get("a"), depth + 1).ravel()
            chosen = source[unfold(state.get("idxs"), depth + 1)]
            return chosen.reshape(state.get("preferred_shape", chosen.shape))
        case _Chumpy(state={"x": inner}):
            return unfold(inner, depth + 1)
        case int() | float() | list() | tuple():
            return np.asarray(value, dtype=np.float64)
    raise ValueError(f"it is a {type(value).__name__.strip('_')}, not an array of numbers")


def _from_bytes(raw: Any, dtype: Any, shape: Any, order: str) -> np.ndarray:
    """An array from its bytes, which python 2 left as text."""
    if isinstance(raw, str):
        raw = raw.encode("latin1")
    kind = _plain_dtype(dtype)
    if not isinstance(raw, (bytes, bytearray)) or len(raw) != prod(shape) * kind.itemsize:
        raise ValueError("its bytes do not fill its shape")
    return np.frombuffer(raw, kind).reshape(shape, order="F" if order == "F" else "C")


def _plain_dtype(value: Any) -> np.dtype:
    """A number or text type from the pickled description of one."""
    name = value.args[0] if isinstance(value, _Dtype) and value.args else None
    if not isinstance(name, str) or not DTYPE.fullmatch(name):
        raise ValueError(f"its entries are of type {name!r}, not numbers")
    order = value.state[1] if isinstance(value.state, tuple) and len(value.state) > 1 else "="
    return np.dtype(name).newbyteorder(order if order in ("<", ">", "=", "|") else "=")


def _dense(state: dict[str, Any], rows: bool) -> np.ndarray:
    """A compressed sparse matrix written out."""
    shape = state.get("_shape", state.get("shape"))
    if not isinstance(shape, tuple) or len(shape) != 2 or not 0 < prod(shape) <= MOST_ENTRIES:
        raise ValueError(f"its shape {shape!r} is not a matrix's")
    data, indices, starts = (unfold(state.get(key)) for key in ("data", "indices", "indptr"))
    lines, across = shape if rows else shape[::-1]
    counts = np.diff(starts)
    if (
        len(counts) != lines
        or counts.min() < 0
        or counts.sum() != len(data)
        or len(data) != len(indices)
    ):
        raise ValueError("its sparse rows do not fit its shape")
    if len(indices) and not 0 <= indices.min() <= indices.max() < across:
        raise ValueError("its sparse entries lie outside its shape")
    dense = np.zeros((lines, across))
    np.add.at(dense, (np.repeat(np.arange(lines), counts), indices), data)
    return dense if rows else dense.T
