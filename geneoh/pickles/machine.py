"""Pickles taken apart, never run: a pickle is a program, and this reads it as a text.

`pickle.load` calls what the file names. Here every opcode only moves plain values about; a call
that the file asks for is written down as a `Call`, and a name that no decoder knows is refused as
soon as it is read. `decode.py` then turns the few known calls (numpy arrays, torch tensors, ...)
into values.

Source: the opcodes' documentation in CPython's pickletools, protocols 0 to 5.
"""

import codecs
import struct
from collections.abc import Callable, Container
from dataclasses import dataclass, field
from typing import Any

from geneoh.errors import InputError

STEP_LIMIT = 20_000_000
"""Opcodes of one pickle; the largest in use, a thousand frames of small tensors, takes 10^5."""

OBJECT_LIMIT = 6_000_000
"""Lists, tuples, dicts and calls of one pickle, and values that it keeps to recall: a gigabyte of
memory. Two minutes of OakInk2, the largest in use, take 2 million."""

DIGIT_LIMIT = 64
"""Characters of a number written as text; Python's own limit of 4300 takes time."""

ARRAY_WRAPPER = "joblib.numpy_pickle.NumpyArrayWrapper"
"""In a joblib dump the bytes of an array stand in the stream right after this object."""


@dataclass(eq=False)
class Name:
    """A class or function that the pickle names, `module.name`; it is not imported."""

    text: str


@dataclass(eq=False)
class Call:
    """A call that the pickle asks for, with the state it would set on the result."""

    name: str
    args: tuple[Any, ...]
    state: Any = None
    items: list[Any] = field(default_factory=list)
    """What is appended or set on the result afterwards; pairs where it is a mapping."""
    raw: Any = None
    """Bytes of a joblib array, or the calls of one that holds objects."""


@dataclass(eq=False)
class Pairs:
    """A dict before its keys are known to be fit for one."""

    items: list[Any] = field(default_factory=list)


@dataclass(eq=False)
class Stored:
    """Something kept outside of the pickle (a tensor's numbers), by its persistent id."""

    key: Any


COMPOUND = (list, tuple, Name, Call, Pairs, Stored)
"""What takes memory of its own."""

MARK = object()

RawReader = Callable[["Machine", Call], None]


class Machine:
    """Reads one pickle from `data` at `position`, which ends up behind it."""

    def __init__(
        self,
        data: bytes,
        file: str,
        known: Container[str],
        read_raw: RawReader | None = None,
        position: int = 0,
    ) -> None:
        self.data, self.file, self.known, self.read_raw = data, file, known, read_raw
        self.position = position
        self.stack: list[Any] = []
        self.memo: dict[int, Any] = {}
        self.objects = 0

    def refuse(self, what: str) -> InputError:
        """The error for a pickle that is not read; `what` follows "got"."""
        return InputError(
            f"{self.file}: expected a pickle of plain arrays, got {what}; pickles are never run, "
            "save the arrays with numpy.savez"
        )

    def run(self) -> Any:
        """The value that the pickle builds, its calls written down."""
        for _ in range(STEP_LIMIT):
            code = self.take(1)
            if code == b".":
                return self.pop()
            handler = HANDLERS.get(code)
            if handler is None:
                raise self.refuse(f"the opcode {code!r}, which plain arrays do not need")
            handler(self)
        raise self.refuse(f"more than {STEP_LIMIT} steps")

    def take(self, count: int) -> bytes:
        """The next bytes."""
        end = self.position + count
        if count < 0 or end > len(self.data):
            raise self.refuse(f"one that ends after {len(self.data)} bytes (truncated or damaged)")
        self.position, start = end, self.position
        return self.data[start:end]

    def number(self, form: str) -> int:
        """The next number in the given form of `struct`, little-endian."""
        return struct.unpack("<" + form, self.take(struct.calcsize("<" + form)))[0]

    def line(self) -> str:
        """The text up to the end of the line."""
        end = self.data.find(b"\n", self.position)
        if end < 0:
            raise self.refuse("one that ends within a line (truncated or damaged)")
        text = self.take(end - self.position).decode("latin1")
        self.position += 1
        return text

    def digits(self) -> str:
        """A number written as text."""
        text = self.line()
        if len(text) > DIGIT_LIMIT:
            raise self.refuse(f"a number of {len(text)} digits")
        return text

    def push(self, value: Any) -> None:
        """Put a new value on the stack."""
        if isinstance(value, COMPOUND):
            self.objects += 1
            if self.objects > OBJECT_LIMIT:
                raise self.refuse(f"one of more than {OBJECT_LIMIT} lists and calls")
        self.stack.append(value)

    def pop(self) -> Any:
        """Take the last value off the stack."""
        if not self.stack or self.stack[-1] is MARK:
            raise self.refuse("one that takes what was never put (damaged)")
        return self.stack.pop()

    def top(self) -> Any:
        """The last value of the stack."""
        self.stack.append(self.pop())
        return self.stack[-1]

    def pop_mark(self) -> list[Any]:
        """All values above the last mark."""
        values = []
        while self.stack and self.stack[-1] is not MARK:
            values.append(self.stack.pop())
        if not self.stack:
            raise self.refuse("one without its marks (damaged)")
        self.stack.pop()
        return values[::-1]

    def name(self, module: Any, name: Any) -> Name:
        """A name of the pickle, when it is one that decoding knows."""
        if not isinstance(module, str) or not isinstance(name, str):
            raise self.refuse("one that names something by what is no text")
        text = f"{module}.{name}"
        if text not in self.known:
            raise self.refuse(f"one that names {text[:80]!r}")
        return Name(text)

    def call(self, function: Any, args: Any) -> Call:
        """Write a call down."""
        if not isinstance(function, Name) or not isinstance(args, tuple):
            raise self.refuse("one that calls what is no function")
        if function.text.endswith("._reconstructor") or function.text.endswith(".__newobj__"):
            if not args or not isinstance(args[0], Name):
                raise self.refuse(f"'{function.text}' of no class")
            return Call(args[0].text, ())
        return Call(function.text, args)

    def extend(self, values: list[Any]) -> None:
        """Append values to the list, or pairs to the dict, that is last on the stack."""
        target = self.top()
        if isinstance(target, list):
            target.extend(values)
        elif isinstance(target, Pairs | Call):
            target.items.extend(values)
        else:
            raise self.refuse("one that adds to what is no list or dict")

    def pairs(self, values: list[Any]) -> list[Any]:
        """Alternating keys and values as pairs."""
        if len(values) % 2:
            raise self.refuse("a dict with a key but no value (damaged)")
        return list(zip(values[::2], values[1::2], strict=True))

    def recall(self, index: int) -> None:
        """Push what was remembered."""
        if index not in self.memo:
            raise self.refuse("one that recalls what it never kept (damaged)")
        self.stack.append(self.memo[index])

    def build(self) -> None:
        """Set the state of the last call."""
        state, target = self.pop(), self.top()
        if not isinstance(target, Call):
            raise self.refuse("one that sets the state of a plain value")
        target.state = state
        if target.name == ARRAY_WRAPPER and self.read_raw is not None:
            self.read_raw(self, target)


def put_global(m: Machine) -> None:
    """A name, written as two lines."""
    module = m.line()
    m.push(m.name(module, m.line()))


def put_stack_global(m: Machine) -> None:
    """A name, from two strings on the stack."""
    name, module = m.pop(), m.pop()
    m.push(m.name(module, name))


def put_instance(m: Machine) -> None:
    """A call of protocol 0: the class as two lines, its arguments above the mark."""
    module = m.line()
    m.push(m.call(m.name(module, m.line()), tuple(m.pop_mark())))


def put_object(m: Machine) -> None:
    """A call of protocol 1: class and arguments above the mark."""
    function, *args = m.pop_mark() or [None]
    m.push(m.call(function, tuple(args)))


def put_call(m: Machine) -> None:
    """A function called, or a class made, with a tuple of arguments."""
    args, function = m.pop(), m.pop()
    m.push(m.call(function, args))


def put_call_by_keyword(m: Machine) -> None:
    """A class made with arguments by keyword, of which plain arrays have none."""
    named, args, function = m.pop(), m.pop(), m.pop()
    if not isinstance(named, Pairs) or named.items:
        raise m.refuse("one that calls by keyword")
    m.push(m.call(function, args))


def put_integer_text(m: Machine) -> None:
    """A number as text; 00 and 01 are false and true."""
    text = m.digits()
    m.push({"00": False, "01": True}[text] if text in ("00", "01") else int(text))


def put_string_text(m: Machine) -> None:
    """A quoted string of Python 2."""
    text = m.line()
    if len(text) < 2 or text[0] != text[-1] or text[0] not in "'\"":
        raise m.refuse("a string without its quotes (damaged)")
    m.push(codecs.escape_decode(text[1:-1].encode("latin1"))[0].decode("latin1"))


def set_last(m: Machine) -> None:
    """One key and its value into the dict before them."""
    value, key = m.pop(), m.pop()
    m.extend([(key, value)])


def append_last(m: Machine) -> None:
    """One value to the list before it."""
    value = m.pop()
    m.extend([value])


def many(m: Machine) -> list[Any]:
    """Tuple of the last values, by the opcode just read."""
    count = m.data[m.position - 1] - 0x84
    return [m.pop() for _ in range(count)][::-1]


def remember(m: Machine, index: int) -> None:
    """Keep the last value under a number."""
    m.memo[index] = m.top()
    if len(m.memo) > OBJECT_LIMIT:
        raise m.refuse(f"one that keeps more than {OBJECT_LIMIT} values")


def utf8(raw: bytes) -> str:
    """A string of Python 3."""
    return raw.decode("utf-8", "surrogatepass")


HANDLERS: dict[bytes, Callable[[Machine], Any]] = {
    b"\x80": lambda m: m.take(1),  # protocol
    b"\x95": lambda m: m.take(8),  # frame: only a hint for buffering
    b"N": lambda m: m.push(None),
    b"\x88": lambda m: m.push(True),
    b"\x89": lambda m: m.push(False),
    b"I": put_integer_text,
    b"L": lambda m: m.push(int(m.digits().rstrip("L"))),
    b"F": lambda m: m.push(float(m.digits())),
    b"J": lambda m: m.push(m.number("i")),
    b"K": lambda m: m.push(m.number("B")),
    b"M": lambda m: m.push(m.number("H")),
    b"\x8a": lambda m: m.push(int.from_bytes(m.take(m.number("B")), "little", signed=True)),
    b"G": lambda m: m.push(struct.unpack(">d", m.take(8))[0]),
    b"S": put_string_text,
    b"V": lambda m: m.push(m.line().encode("latin1").decode("raw-unicode-escape")),
    b"T": lambda m: m.push(m.take(m.number("i")).decode("latin1")),
    b"U": lambda m: m.push(m.take(m.number("B")).decode("latin1")),
    b"X": lambda m: m.push(utf8(m.take(m.number("I")))),
    b"\x8c": lambda m: m.push(utf8(m.take(m.number("B")))),
    b"\x8d": lambda m: m.push(utf8(m.take(m.number("Q")))),
    b"B": lambda m: m.push(m.take(m.number("I"))),
    b"C": lambda m: m.push(m.take(m.number("B"))),
    b"\x8e": lambda m: m.push(m.take(m.number("Q"))),
    b"\x96": lambda m: m.push(m.take(m.number("Q"))),
    b"(": lambda m: m.push(MARK),
    b"0": lambda m: m.stack.pop() if m.stack else m.pop(),
    b"1": lambda m: m.pop_mark(),
    b"2": lambda m: m.push(m.top()),
    b")": lambda m: m.push(()),
    b"t": lambda m: m.push(tuple(m.pop_mark())),
    b"\x85": lambda m: m.push(tuple(many(m))),
    b"\x86": lambda m: m.push(tuple(many(m))),
    b"\x87": lambda m: m.push(tuple(many(m))),
    b"]": lambda m: m.push([]),
    b"l": lambda m: m.push(m.pop_mark()),
    b"\x8f": lambda m: m.push([]),  # sets are read as lists
    b"\x91": lambda m: m.push(m.pop_mark()),
    b"a": append_last,
    b"e": lambda m: m.extend(m.pop_mark()),
    b"\x90": lambda m: m.extend(m.pop_mark()),
    b"}": lambda m: m.push(Pairs()),
    b"d": lambda m: m.push(Pairs(m.pairs(m.pop_mark()))),
    b"s": set_last,
    b"u": lambda m: m.extend(m.pairs(m.pop_mark())),
    b"p": lambda m: remember(m, int(m.digits())),
    b"q": lambda m: remember(m, m.number("B")),
    b"r": lambda m: remember(m, m.number("I")),
    b"\x94": lambda m: remember(m, len(m.memo)),
    b"g": lambda m: m.recall(int(m.digits())),
    b"h": lambda m: m.recall(m.number("B")),
    b"j": lambda m: m.recall(m.number("I")),
    b"c": put_global,
    b"\x93": put_stack_global,
    b"R": put_call,
    b"\x81": put_call,
    b"\x92": put_call_by_keyword,
    b"i": put_instance,
    b"o": put_object,
    b"b": lambda m: m.build(),
    b"Q": lambda m: m.push(Stored(m.pop())),
}
"""Without extension codes and out-of-band buffers, and with persistent ids as values only."""
