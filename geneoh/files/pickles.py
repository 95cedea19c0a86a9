"""Read pickles without running them: an allow-list of names is rebuilt, all others are refused.

A pickle is a program that calls functions by name. Here Python's own unpickler only records each
call (`Call`), and `Loader.value` then builds the value of each call with an allowed name. Nothing
that a file names is imported.

The unpickler is the one in Python, not the one in C: that allocates sizes which a file declares (a
memo index, a length) and hashes keys that take 2**n steps, before it could be stopped.
"""

import pickle
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from io import SEEK_CUR, BytesIO
from typing import Any

from geneoh.errors import InputError
from geneoh.files.reading import DAMAGE, SIZE_LIMIT, reason

STEP_LIMIT = 20_000_000
"""Most opcodes of a pickle; two minutes of OakInk2, the largest in use, take about 6 million."""

OBJECT_LIMIT = 8_000_000
"""Most lists, tuples, dicts, calls and memo entries of one file: a gigabyte of memory. Two minutes
of OakInk2, the largest in use, take about 4 million."""

DEPTH_LIMIT = 48
"""Deepest nesting of lists; data sets nest five deep."""

PLAIN = {str, int, float, bytes, bool, type(None)}

INSTANCES = {f"{m}.{f}" for m in ("copy_reg", "copyreg") for f in ("_reconstructor", "__newobj__")}
"""Functions that make an instance of the class that is their first argument."""

DICT, PERSISTENT = "dict", "persistent id"
"""Our names for a dict with unchecked keys, and for a value stored outside the pickle. No file can
name them, because all names in a file have a dot."""

ARRAY_WRAPPER = "joblib.numpy_pickle.NumpyArrayWrapper"
"""In a joblib dump the bytes of an array stand in the file right after this object."""


@dataclass(frozen=True, eq=False)
class Name:
    """A class or function that a pickle names, `module.name`; it is not imported."""

    text: str


@dataclass(eq=False)
class Call:
    """A recorded call of a pickle, with the state and the items that it sets on the result."""

    name: str
    args: tuple[Any, ...] | list[Any]
    state: Any = None
    items: list[tuple[Any, Any]] = field(default_factory=list)

    def __setitem__(self, key: Any, value: Any) -> None:
        self.items.append((key, value))


Rebuild = Callable[["Loader", Call], Any]
"""Builds the value of a call; wrong arguments raise ValueError or another error of `DAMAGE`."""


class Loader:
    """Reads the pickles of one file; a value that is used twice is built once."""

    def __init__(self, data: bytes, file: str, known: Mapping[str, Rebuild]) -> None:
        self.stream, self.file, self.known = BytesIO(data), file, known
        self.objects = self.depth = self.bytes = 0
        self.stored: list[Call] = []
        self.done: dict[int, tuple[Any, Any]] = {}

    def refuse(self, what: str) -> InputError:
        """The error for a pickle that is not read; `what` follows "got"."""
        return InputError(
            f"{self.file}: expected a pickle of plain arrays, got {what}; pickles are never run, "
            "save the arrays with numpy.savez"
        )

    def spend(self, count: int) -> None:
        """Count the bytes of an array before it is made."""
        self.bytes += count
        if self.bytes > SIZE_LIMIT:
            raise ValueError(f"asks for more than {SIZE_LIMIT / 2**30:g} GiB in all")

    def read(self, count: int) -> bytes:
        """The next `count` bytes of the file; `InputError` where it ends before."""
        data = self.stream.read(count)
        if len(data) != count:
            raise self.truncated()
        return data

    def truncated(self) -> InputError:
        """The error for a file that ends too early."""
        size = self.stream.getbuffer().nbytes
        return self.refuse(f"one that ends after {size} bytes (truncated or damaged)")

    def tree(self) -> Any:
        """The content of the pickle at the current position, with its calls recorded, not run."""
        try:
            return Unpickler(self).load()
        except InputError:
            raise
        except DAMAGE as error:
            raise self.refuse(f"a damaged one ({reason(error)})") from None

    def value(self, node: Any) -> Any:
        """A plain value from a tree of calls."""
        if type(node) in PLAIN:
            return node
        name = node.text if isinstance(node, Name) else getattr(node, "name", "list")
        try:
            if isinstance(node, Name):
                raise ValueError("is kept as a value")
            if id(node) not in self.done:
                self.done[id(node)] = node, ...  # holds the node, so that its id stays unique
                self.done[id(node)] = node, self.built(node)
            if (value := self.done[id(node)][1]) is ...:
                raise ValueError("holds itself")
            return value
        except InputError:
            raise
        except DAMAGE as error:
            raise InputError(
                f"{self.file}: '{name}' {reason(error)}; the pickle is damaged or hostile"
            ) from None

    def built(self, node: Any) -> Any:
        """A list, a tuple or a call as a value."""
        self.depth += 1
        if self.depth > DEPTH_LIMIT:
            raise ValueError(f"is nested deeper than {DEPTH_LIMIT}")
        if isinstance(node, Call):
            value = self.known[node.name](self, node)
        else:
            items = [item if type(item) in PLAIN else self.value(item) for item in node]
            value = tuple(items) if isinstance(node, tuple) else items
        self.depth -= 1
        return value


PythonUnpickler: Any = pickle._Unpickler  # joblib builds on it too


class Unpickler(PythonUnpickler):
    """Python's unpickler, which records calls instead of running them, and counts what it makes."""

    def __init__(self, loader: Loader) -> None:
        super().__init__(loader.stream, encoding="latin1")
        self.loader = loader

    def load(self) -> Any:
        """The content: the loop of the base class with a step limit, and without frame buffers."""
        self.read, self.readline = self.loader.stream.read, self.loader.stream.readline
        self.metastack, self.stack = [], []
        self.append = self.stack.append
        for _ in range(STEP_LIMIT):
            code = self.read(1)
            if code == pickle.STOP:
                return self.stack.pop()
            if not code:
                raise self.loader.truncated()
            self.dispatch[code[0]](self)
        raise self.loader.refuse(f"one of more than {STEP_LIMIT} steps")

    def find_class(self, module: str, name: str) -> Name:
        """A name on the allow-list; all others are refused."""
        text = f"{module}.{name}"
        if "." in name or not (text in self.loader.known or text in INSTANCES):
            raise self.loader.refuse(f"one that names {text[:80]!r}")
        return Name(text)

    def persistent_load(self, pid: Any) -> Call:
        """A recorded reference to a value stored outside of the pickle."""
        self.loader.stored.append(stored := Call(PERSISTENT, (pid,)))
        return stored

    def _instantiate(self, kind: Any, args: Any) -> None:
        """Record a call; for a function of `INSTANCES`, the call of the class that it makes."""
        if not isinstance(kind, Name) or not isinstance(args, tuple | list):
            raise TypeError("calls what is no function")
        if kind.text in INSTANCES:
            self._instantiate(args[0], ())
        else:
            self.append(Call(kind.text, args))

    def load_reduce(self) -> None:
        """Record the call of a function or class with a tuple of arguments."""
        args = self.stack.pop()
        self._instantiate(self.stack.pop(), args)

    def load_build(self) -> None:
        """Set the state of a call; the array that joblib writes behind it is read at once."""
        state, target = self.stack.pop(), self.stack[-1]
        if not isinstance(target, Call):
            raise TypeError("sets the state of a plain value")
        target.state = state
        if target.name == ARRAY_WRAPPER:
            self.loader.value(target)

    def load_empty_dict(self) -> None:
        """Record a dict as a call, so that no key is hashed yet."""
        self.append(Call(DICT, ()))

    def load_dict(self) -> None:
        """As `load_empty_dict`, with the items above the mark."""
        items = self.pop_mark()
        pairs = list(zip(items[::2], items[1::2], strict=True))
        self.append(Call(DICT, (), items=pairs))

    def load_frame(self) -> None:
        """A frame is only a hint for buffering."""
        self.loader.read(8)

    def refuse_opcode(self) -> None:
        """Refuse an opcode that plain arrays do not need."""
        self.loader.stream.seek(-1, SEEK_CUR)
        first = self.loader.stream.tell() == 0
        code = self.loader.read(1)
        if first:
            raise InputError(
                f"{self.loader.file}: expected a file of arrays (npz, npy, pickle, checkpoint or "
                f"joblib), got one that begins with {code!r}; check the path"
            )
        raise self.loader.refuse(f"the opcode {code!r}, which plain arrays do not need")


Load = Callable[[Unpickler], None]
BASE: dict[int, Load] = PythonUnpickler.dispatch
REFUSED = b"P\x82\x83\x84\x8b\x92\x97\x98"
"""Opcodes that plain arrays do not need: persistent ids as text, registered extensions, integers of
any size, calls by keyword, and buffers outside of the file."""

READ_AS = dict(zip(b"\x8f\x90\x91\x96", b"]el\x8e", strict=True))
"""Sets are read as lists, which need no hash, and byte arrays as bytes."""

COUNTED = b")t\x85\x86\x87]l}d\x8f\x91c\x93R\x81ioQpqr\x94"
"""Opcodes that allocate memory: for containers, names, calls and memo entries."""


def _counted(load: Load) -> Load:
    """The same opcode, counted and refused beyond `OBJECT_LIMIT`."""

    def load_counted(self: Unpickler) -> None:
        self.loader.objects += 1
        if self.loader.objects > OBJECT_LIMIT:
            raise self.loader.refuse(f"one of more than {OBJECT_LIMIT} lists, calls and the like")
        load(self)

    return load_counted


Unpickler.dispatch = {
    **dict.fromkeys(range(256), Unpickler.refuse_opcode),
    **{code: load for code, load in BASE.items() if code not in REFUSED},
    **{code: BASE[twin] for code, twin in READ_AS.items()},
    pickle.REDUCE[0]: Unpickler.load_reduce,
    pickle.NEWOBJ[0]: Unpickler.load_reduce,
    pickle.BUILD[0]: Unpickler.load_build,
    pickle.EMPTY_DICT[0]: Unpickler.load_empty_dict,
    pickle.DICT[0]: Unpickler.load_dict,
    pickle.FRAME[0]: Unpickler.load_frame,
}
Unpickler.dispatch |= {code: _counted(Unpickler.dispatch[code]) for code in COUNTED}
