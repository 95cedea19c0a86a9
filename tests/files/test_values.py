"""Pickles are taken apart and never run: what arrays need comes back, anything else is refused."""

import builtins
import gzip
import os
import pickle
import struct
import sys
import types
import warnings
import zipfile
from collections import OrderedDict

import numpy as np
import pytest
import scipy.sparse
import torch
from trees.writers import dump_joblib

from geneoh.errors import InputError
from geneoh.files import checkpoints, pickles
from geneoh.files import values as files
from geneoh.files.values import read_values

STRIDED = torch.arange(12.0).reshape(3, 4)[:, 1:3]


def values() -> dict:
    return {
        "floats": np.linspace(0, 1, 6, dtype="f4").reshape(2, 3),
        "fortran": np.asfortranarray(np.arange(6.0).reshape(2, 3)),
        "number": np.float64(2.5),
        "list": [1, 2.5, None, True, "text", b"bytes", (1, -2)],
        "tensor": STRIDED,
        "half": torch.tensor([0.5, 2.0]).half(),
        "wide": torch.tensor([0.5, 2.0]).bfloat16(),
        "ordered": OrderedDict(a=torch.tensor([True, False])),
        "objects": np.array({"x": np.arange(3)}, dtype=object),
        "sparse": scipy.sparse.csc_matrix(np.diag([1.0, 2.0])),
        "large": 2**70,
        "none": np.zeros((0, 3)),
        3: np.array(["ab", "c"]),
    }


def assert_read(path) -> None:
    read = read_values(path)
    for name, value in values().items():
        got = read[name]
        if isinstance(value, torch.Tensor):
            value = value.float().numpy() if value.dtype == torch.bfloat16 else value.numpy()
        if scipy.sparse.issparse(value):
            value = value.toarray()
        if name == "ordered":
            value, got = value["a"].numpy(), got["a"]
        if name == "objects":
            value, got = value.item()["x"], got.item()["x"]
        np.testing.assert_array_equal(np.asarray(got, object), np.asarray(value, object))


@pytest.mark.parametrize("protocol", range(6))
def test_every_protocol_gives_the_values_back(tmp_path, protocol):
    (tmp_path / "a.pkl").write_bytes(pickle.dumps(values(), protocol=protocol))
    assert_read(tmp_path / "a.pkl")


@pytest.mark.parametrize("zipped", [True, False])
def test_both_forms_of_checkpoint_give_the_values_back(tmp_path, zipped):
    torch.save(values(), tmp_path / "a.pt", _use_new_zipfile_serialization=zipped)
    assert_read(tmp_path / "a.pt")


def test_arrays_of_joblib_are_read_from_behind_their_descriptions(tmp_path):
    arrays = [np.arange(6.0).reshape(2, 3), np.arange(4, dtype="i2")]
    dump_joblib(tmp_path / "a.pkl", {"list": arrays, "name": "mug"})
    read = read_values(tmp_path / "a.pkl")
    assert read["name"] == "mug"
    for array, got in zip(arrays, read["list"], strict=True):
        np.testing.assert_array_equal(got, array, strict=True)


def test_a_value_used_twice_is_one_value(tmp_path):
    array = np.arange(3)
    (tmp_path / "a.pkl").write_bytes(pickle.dumps([array, array]))
    first, second = read_values(tmp_path / "a.pkl")
    assert first is second


class Ch:
    """Stands in for a chumpy array while a file is written."""

    def __init__(self, x):
        self.x, self._dirty_vars = x, {"x"}


class Select(Ch):
    """Entries of another chumpy object."""

    def __init__(self, a, idxs, preferred_shape):
        self.a, self.idxs, self.preferred_shape, self._dirty_vars = a, idxs, preferred_shape, set()


@pytest.mark.parametrize("protocol", range(6))
def test_what_mano_files_hold_comes_as_arrays(tmp_path, protocol, monkeypatch):
    monkeypatch.setitem(sys.modules, "chumpy", types.ModuleType("chumpy"))
    for kind, name in ((Ch, "chumpy.ch"), (Select, "chumpy.reordering")):
        monkeypatch.setattr(kind, "__module__", name)
        monkeypatch.setitem(sys.modules, name, module := types.ModuleType(name))
        setattr(module, kind.__name__, kind)
    inner = np.arange(12.0).reshape(3, 4)
    held = {
        "big": np.arange(5, dtype=">i4"),
        "chumpy": Ch(inner),
        "selected": Select(Ch(inner), np.array([11, 0, 5, 2]), (2, 2)),
        "rows": scipy.sparse.csr_matrix(inner),
        "columns": scipy.sparse.csc_matrix(inner),
    }
    (tmp_path / "a.pkl").write_bytes(pickle.dumps(held, protocol=protocol))
    read = read_values(tmp_path / "a.pkl")
    np.testing.assert_array_equal(read["big"], np.arange(5))
    np.testing.assert_array_equal(read["selected"], [[11, 0], [5, 2]])
    for name in ("chumpy", "rows", "columns"):
        np.testing.assert_array_equal(read[name], inner)


@pytest.mark.parametrize("zipped", [True, False])
def test_tensors_of_a_gpu_come_like_all_others(tmp_path, zipped, monkeypatch):
    monkeypatch.setattr(torch.serialization, "location_tag", lambda storage: "cuda:0")
    value = {"hand_pose": torch.arange(4.0)}
    torch.save(value, tmp_path / "a.pt", _use_new_zipfile_serialization=zipped)
    (tmp_path / "a.pkl").write_bytes(pickle.dumps(value))
    for name in ("a.pt", "a.pkl"):
        assert b"cuda:0" in (tmp_path / name).read_bytes()
        np.testing.assert_array_equal(read_values(tmp_path / name)["hand_pose"], range(4))


CANARY = "canary"


class Calls:
    """Pickled, it asks for a call."""

    def __init__(self, function, *args):
        self.function, self.args = function, args

    def __reduce__(self):
        return self.function, self.args


def touch() -> Calls:
    return Calls(os.system, f"touch {CANARY}")


def raw(*parts: bytes) -> bytes:
    return b"\x80\x04" + b"".join(parts) + b"."


def rebuilt(size, stride, offset=0) -> bytes:
    """A tensor with any size and stride over a storage of two numbers."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # torch pickles tensors by what it calls deprecated
        function, (stored,) = torch.zeros(2).storage().__reduce__()
    storage = Calls(function, stored)
    rebuild = torch._utils._rebuild_tensor_v2
    return pickle.dumps(Calls(rebuild, storage, offset, size, stride, False, OrderedDict()))


def array_of(shape, dtype="f8", body=b"") -> bytes:
    """A numpy array whose declared shape is not that of its bytes."""
    state = (1, shape, np.dtype(dtype), False, body)
    rebuild = np.arange(2).__reduce__()[0]
    start = pickle.dumps(Calls(rebuild, np.ndarray, (0,), b"b"), protocol=2)[:-1]
    return start + pickle.dumps(state, protocol=2)[2:-1] + b"b."


def doubled(depth: int) -> list:
    """A list that holds the next one twice, and so on: 2**depth numbers from few bytes."""
    value: list = [1]
    for _ in range(depth):
        value = [value, value]
    return value


def nested_key(depth: int, end: bytes) -> bytes:
    """Tuples that each hold the one before twice, as a key: 2**depth steps to hash."""
    pairs = b"".join(b"h" + bytes([i]) + b"h" + bytes([i]) + b"\x86\x94" for i in range(depth))
    return raw(b"K\x01\x85\x94", pairs, end)


def many_calls(made: bytes, call: bytes, count: int = 20) -> bytes:
    """A list of many calls with one and the same large argument, which is kept under 0."""
    return raw(made, b"\x940](", call * count, b"e")


def colliding() -> dict[int, int]:
    """Keys of which all have the same hash."""
    return {(2**61 - 1) * (2**20 + n): n for n in range(1000)}


def sparse_of(shape) -> bytes:
    """A sparse matrix of any declared shape."""
    matrix = scipy.sparse.csc_matrix(np.eye(3))
    matrix.__dict__["_shape"] = shape
    return pickle.dumps(matrix)


HOSTILE = {
    "os.system": (pickle.dumps(touch()), "system"),
    "os.system in a list": (pickle.dumps([1, [touch()]]), "system"),
    "os.system, protocol 0": (pickle.dumps(touch(), protocol=0), "system"),
    "builtins.eval": (
        pickle.dumps(Calls(builtins.eval, f"open('{CANARY}', 'w')")),
        "builtins.eval",
    ),
    "builtins.exec": (
        pickle.dumps(Calls(builtins.exec, f"open('{CANARY}', 'w')"), protocol=2),
        "__builtin__.exec",
    ),
    "builtins.getattr": (pickle.dumps(Calls(getattr, 1, "real")), "builtins.getattr"),
    "builtins.__import__": (pickle.dumps(Calls(__import__, "os")), "builtins.__import__"),
    "numpy.load": (raw(b"cnumpy\nload\n(X\x01\x00\x00\x00atR"), "numpy.load"),
    "numpy chain": (raw(b"cnumpy.f2py\ncompile\n(X\x01\x00\x00\x00atR"), "numpy.f2py.compile"),
    "numpy by dots": (
        raw(b"\x8c\x05numpy\x8c\x0clib.os.popen\x93)R"),
        "numpy.lib.os.popen",
    ),
    "numpy.fromfile": (raw(b"cnumpy\nfromfile\n)R"), "numpy.fromfile"),
    "numpy memmap": (raw(b"cnumpy\nmemmap\n)\x81"), "numpy.memmap"),
    "torch.load": (raw(b"ctorch.serialization\nload\n)R"), "torch.serialization.load"),
    "torch.hub": (raw(b"ctorch.hub\nload\n)R"), "torch.hub.load"),
    "torch type": (
        raw(b"ctorch._tensor\n_rebuild_from_type_v2\n)R"),
        "torch._tensor._rebuild_from_type_v2",
    ),
    "torch stride": (rebuilt((2, 2**20), (2**30, 1)), "_rebuild_tensor_v2"),
    "torch expanded": (rebuilt((2**35,), (0,)), "_rebuild_tensor_v2"),
    "torch negative": (rebuilt((2,), (1,), -5), "_rebuild_tensor_v2"),
    "storage bytes": (
        raw(b"ctorch.storage\n_load_from_bytes\nC\x03abc\x85R"),
        "pickle",
    ),
    "subprocess": (raw(b"csubprocess\nPopen\n)R"), "subprocess.Popen"),
    "codecs": (raw(b"c_codecs\ndecode\n)R"), "_codecs.decode"),
    "instance": (raw(b"(ios\nsystem\n"), "os.system"),
    "pandas": (raw(b"cpandas.io.pickle\nread_pickle\n)R"), "pandas.io.pickle.read_pickle"),
    "joblib": (raw(b"cjoblib.memory\nMemory\n)R"), "joblib.memory.Memory"),
    "huge array": (array_of((2**39,)), "numpy.core.multiarray|numpy._core.multiarray"),
    "array of other size": (array_of((3,), body=bytes(8)), "_reconstruct"),
    "array without items": (array_of((2**30,), "S0"), "numpy"),
    "deep nesting": (raw(b"]" * 5000, b"a" * 4999), "nested deeper"),
    "itself": (raw(b"]\x94h\x00a"), "holds itself"),
    "huge string": (raw(b"\x8e" + struct.pack("<Q", 2**60)), "truncated"),
    "extension": (raw(b"\x82\x01"), "opcode"),
    "long digits": (b"I" + b"9" * 100_000 + b"\n.", "digits"),
    "unhashable key": (raw(b"}](K\x01u."), "pickle"),
    "chumpy function": (raw(b"cchumpy.ch\nloads\n)R"), "chumpy.ch.loads"),
    "scipy.sparse.load_npz": (raw(b"cscipy.sparse\nload_npz\n)R"), "scipy.sparse.load_npz"),
    "sparse of absurd shape": (sparse_of((10**9, 3)), "csc_matrix|GiB"),
    "attribute path": (raw(b"cnumpy.core.multiarray\n_reconstruct.__call__\n)R"), "__call__"),
    "dots in the name": (raw(b"cnumpy\ncore.multiarray._reconstruct\n)R"), "_reconstruct"),
    "copyreg.__reduce_ex__": (raw(b"ccopyreg\n__reduce_ex__\n)R"), "copyreg.__reduce_ex__"),
    "persistent id as text": (b"Pname\n.", "a file of arrays"),
    "text": (b"# a mesh\nv 0 0 0\n", "a file of arrays (npz, npy, pickle, checkpoint or joblib)"),
    "persistent id": (raw(b"K\x01Q"), "keeps nothing outside"),
    "memo index": (raw(b"Nr\xff\xff\xff\xffj\xff\xff\xff\xfe"), "damaged"),
    "huge byte array": (raw(b"\x96" + struct.pack("<Q", 2**40)), "truncated"),
    "call of a plain value": (raw(b"K\x01)R"), "calls what is no function"),
    "state of a plain value": (raw(b"]}b"), "sets the state of a plain value"),
    "state of a name": (raw(b"cnumpy\nndarray\n}b"), "sets the state of a plain value"),
    "instance of a value": (raw(b"ccopyreg\n_reconstructor\nK\x01\x85R"), "no function"),
    "instance of itself": (raw(b"ccopyreg\n_reconstructor\n\x94h\x00\x85R"), "damaged"),
    "class as a value": (raw(b"cnumpy\nndarray\n"), "kept as a value"),
    "class that is called": (raw(b"cnumpy\nndarray\n)R"), "is called"),
    "key of tuples": (nested_key(40, b"}h\x28Ns"), "key that is a tuple"),
    "key of tuples by mark": (nested_key(40, b"(h\x28Nd"), "key that is a tuple"),
    "set of tuples": (nested_key(60, b"\x8f(h\x3c\x90"), "nested deeper"),
    "frozen set of tuples": (nested_key(60, b"(h\x3c\x91"), "nested deeper"),
    "keys of one hash": (pickle.dumps(colliding()), "too long"),
    "name of lists": (raw(pickle.dumps(doubled(40))[2:-1], b"\x8c\x01a\x93"), "requires str"),
    "shape of lists": (array_of((doubled(40),)), "a shape that is none"),
}


@pytest.mark.parametrize("name", HOSTILE)
def test_a_hostile_pickle_is_refused_by_name(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    data, word = HOSTILE[name]
    (tmp_path / "a.pkl").write_bytes(data)
    with pytest.raises(InputError) as refusal:
        read_values(tmp_path / "a.pkl")
    assert any(part in str(refusal.value) for part in word.split("|"))
    assert "\n" not in str(refusal.value)
    assert [path.name for path in tmp_path.iterdir()] == ["a.pkl"]


def test_many_small_values_are_refused_before_they_fill_the_memory(tmp_path, monkeypatch):
    monkeypatch.setattr(pickles, "OBJECT_LIMIT", 1000)
    for name, body in (("lists", b"]" * 1001 + b"0" * 1000), ("kept", b"N" + b"\x94" * 1001)):
        (tmp_path / name).write_bytes(raw(body))
        with pytest.raises(InputError, match="more than 1000"):
            read_values(tmp_path / name)


MULTIPLIED = {
    "dicts": (
        b"](" + b"K\x01K\x01\x86" * 1000 + b"e",
        b"ccollections\nOrderedDict\nh\x00\x85R",
    ),
    "texts": (
        b"X" + struct.pack("<I", 2**17) + b"a" * 2**17,
        b"c_codecs\nencode\nh\x00\x8c\x06latin1\x86R",
    ),
    "arrays of objects": (
        b"](" + b"N" * 2**14 + b"e",
        b"cnumpy.core.multiarray\n_reconstruct\n)R(K\x01M\x00\x40\x85"
        b"cnumpy\ndtype\n\x8c\x01O\x85R\x89h\x00tb",
    ),
}


@pytest.mark.parametrize("kind", MULTIPLIED)
def test_one_large_argument_of_many_calls_cannot_fill_the_memory(kind, tmp_path, monkeypatch):
    (tmp_path / "a.pkl").write_bytes(many_calls(*MULTIPLIED[kind]))
    assert len(read_values(tmp_path / "a.pkl")) == 20
    monkeypatch.setattr(pickles, "SIZE_LIMIT", 2**20)
    with pytest.raises(InputError, match="asks for more than"):
        read_values(tmp_path / "a.pkl")


def test_a_call_does_not_copy_its_arguments():
    wide = b"(" + b"N" * 1000 + b"t"
    data = many_calls(wide, b"ccollections\nOrderedDict\nh\x00R", 3)
    first, second, third = pickles.Loader(data, "a", {"collections.OrderedDict": print}).tree()
    assert first.args is second.args is third.args
    assert len(first.args) == 1000


def test_a_pickle_of_too_many_steps_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(pickles, "STEP_LIMIT", 1000)
    (tmp_path / "a.pkl").write_bytes(raw(b"N" * 1001, b"0" * 1000))
    with pytest.raises(InputError, match="more than 1000 steps"):
        read_values(tmp_path / "a.pkl")


@pytest.mark.parametrize("zipped", [True, False])
def test_many_parts_of_one_storage_are_read_once(tmp_path, zipped):
    whole = torch.zeros(2**21)
    parts = [whole[n : n + 2] for n in range(200)]
    torch.save(parts, tmp_path / "a.pt", _use_new_zipfile_serialization=zipped)
    read = read_values(tmp_path / "a.pt")
    assert [part.shape for part in read] == [(2,)] * 200


@pytest.mark.parametrize("kind", ["npz", "gzip", "checkpoint"])
def test_what_unpacks_to_too_much_is_refused(tmp_path, monkeypatch, kind):
    monkeypatch.setenv("GENEOH_MAX_BYTES", str(2**20))
    for module in (files, checkpoints):
        monkeypatch.setattr(module, "SIZE_LIMIT", 2**20)
    path, zeros = tmp_path / "a.bin", np.zeros(2**21, np.uint8)
    if kind == "npz":
        with path.open("wb") as file:
            np.savez_compressed(file, a=zeros)
    elif kind == "gzip":
        path.write_bytes(gzip.compress(pickle.dumps(zeros)))
    else:
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr("a/data.pkl", pickle.dumps(1))
            archive.writestr("a/data/0", zeros.tobytes())
    assert path.stat().st_size < 2**20
    with pytest.raises(InputError, match=r"(unpack to|must take) at most"):
        read_values(path)


def test_a_file_of_too_many_bytes_is_refused_unread(tmp_path):
    with (tmp_path / "a.pkl").open("wb") as file:
        file.truncate(2**30 + 1)
    with pytest.raises(InputError, match="at most 1024 MiB"):
        read_values(tmp_path / "a.pkl")


@pytest.mark.parametrize("write", ["checkpoint", "stream", "npy", "npz"])
def test_a_hostile_pickle_is_refused_inside_of_other_files(write, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "a.bin"
    if write in ("checkpoint", "stream"):
        zipped = write == "checkpoint"
        torch.save({"a": touch()}, path, _use_new_zipfile_serialization=zipped)
    else:
        held = np.array({"a": touch()}, dtype=object)
        with path.open("wb") as file:
            np.save(file, held) if write == "npy" else np.savez(file, a=held)
    with pytest.raises(InputError, match="system"):
        read_values(path)
    assert not (tmp_path / CANARY).exists()
