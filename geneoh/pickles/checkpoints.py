"""What torch.save writes, in its two forms: a zip with one member per storage, and the older
stream.

The older stream is also what a tensor inside of an ordinary pickle holds. Tensors that were saved
from a GPU come back like all others, as numpy arrays.
"""

import zipfile
from typing import Any

import numpy as np

from geneoh.errors import InputError
from geneoh.pickles.decode import BYTES_LIMIT, DECODERS, STORAGES, Decoder, plain_name, storage_from
from geneoh.pickles.machine import Machine, Stored

MAGIC = 0x1950A86A20F9469CFC6C
"""First value of the older stream."""

NUMBER_LIMIT = 2**28
"""Numbers of one storage."""


def decode_zip(archive: zipfile.ZipFile, file: str) -> Any:
    """The value in a zip checkpoint.

    Raises:
        InputError: a member is missing or does not hold what is declared.
    """
    if sum(info.file_size for info in archive.infolist()) > BYTES_LIMIT:
        raise InputError(
            f"{file}: the checkpoint must unpack to at most {BYTES_LIMIT / 2**30:g} GiB; "
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

    def stored(decoder: Decoder, key: Any) -> np.ndarray:
        kind, name, count = storage_id(decoder, key)
        if (member := f"{root}data/{name}") not in names:
            raise decoder.refuse(kind, f"is kept in {name[:40]!r}, which is not in the file")
        return storage_from(decoder, kind, archive.read(member), count)

    tree = Machine(archive.read(main[0]), file, DECODERS).run()
    return Decoder(file, stored).value(tree)


def storage_id(decoder: Decoder, key: Any) -> tuple[str, str, int]:
    """Kind, name and length of a storage, from ("storage", kind, name, location, length, ...)."""
    if not isinstance(key, tuple) or len(key) < 5 or key[0] != "storage":
        raise decoder.refuse("persistent id", "is not that of a tensor's storage")
    kind, name, count = plain_name(decoder, key[1]), key[2], key[4]
    if not isinstance(name, str | int) or not isinstance(count, int) or count < 0:
        raise decoder.refuse(kind, "has no name or no length")
    if kind not in STORAGES:
        raise decoder.refuse(kind, "is no class of numbers")
    return kind, str(name), count


def is_stream(data: bytes) -> bool:
    """Whether bytes start as the older form does."""
    return data[:2] == b"\x80\x02" and MAGIC.to_bytes(10, "little") in data[:20]


def decode_stream(data: bytes, file: str) -> Any:
    """The value in the older form: five pickles (magic, version, system, value, names), then
    bytes."""
    return read_stream(Decoder(file, no_storage), data)


def read_storage(decoder: Decoder, data: bytes) -> np.ndarray:
    """The numbers of one tensor's storage, in the older form."""
    decoder.spend("torch.storage._load_from_bytes", len(data))
    storage = read_stream(Decoder(decoder.file, no_storage), data)
    if not isinstance(storage, np.ndarray):
        raise decoder.refuse("torch.storage._load_from_bytes", "holds no storage")
    decoder.spend("torch.storage._load_from_bytes", storage.nbytes)
    return storage


def read_stream(decoder: Decoder, data: bytes) -> Any:
    """As `decode_stream`; the storages come after the value that needs them."""
    machine = Machine(data, decoder.file, DECODERS)
    values = []
    for _ in range(5):
        values.append(machine.run())
        machine.stack, machine.memo = [], {}
    names = values[4]
    if values[0] != MAGIC or not isinstance(names, list):
        raise decoder.refuse("torch.save", "did not write this")
    kinds = {name: (kind, count) for kind, name, count in ids_in(decoder, values[3])}
    arrays = {}
    for name in map(str, names):
        if name not in kinds:
            raise decoder.refuse("storage", f"{name[:40]!r} belongs to no tensor")
        kind, declared = kinds[name]
        count = machine.number("q")
        if not 0 <= count <= NUMBER_LIMIT or count != declared:
            raise decoder.refuse(kind, f"declares {declared} numbers and brings {count}")
        raw = machine.take(count * item_size(kind))
        arrays[name] = storage_from(decoder, kind, raw, count)
    decoder.stored = lambda d, key: arrays[storage_id(d, key)[1]]
    return decoder.value(values[3])


def item_size(kind: str) -> int:
    """Bytes of one number of a storage."""
    return 2 if STORAGES[kind] == "bfloat16" else np.dtype(STORAGES[kind]).itemsize


def ids_in(decoder: Decoder, tree: Any) -> list[tuple[str, str, int]]:
    """The storages that a tree of calls speaks of."""
    found, seen, waiting = [], set(), [tree]
    while waiting:
        node = waiting.pop()
        if id(node) in seen:
            continue
        seen.add(id(node))
        if isinstance(node, Stored):
            found.append(storage_id(decoder, node.key))
        elif isinstance(node, list | tuple):
            waiting.extend(node)
        elif hasattr(node, "items") and not isinstance(node, dict):
            waiting.extend([node.items, getattr(node, "args", ()), getattr(node, "state", None)])
    return found


def no_storage(decoder: Decoder, key: Any) -> np.ndarray:
    """Before the storages of a stream are read, none can be had."""
    raise decoder.refuse("persistent id", "stands before its storage")
