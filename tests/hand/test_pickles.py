import pickle
import struct

import numpy as np
import pytest
from scipy.sparse import csc_matrix

from geneoh.hand.pickles import RefusedPickleError, read_pickle, unfold


def read(value, protocol=2):
    return {k: unfold(v) for k, v in read_pickle(pickle.dumps(value, protocol)).items()}


@pytest.mark.parametrize("protocol", range(6))
@pytest.mark.parametrize(
    "array",
    [
        np.arange(24, dtype=np.float32).reshape(2, 3, 4),
        np.asfortranarray(np.arange(6.0).reshape(2, 3)),
        np.arange(5, dtype=">i4"),
        np.array([True, False]),
        np.zeros((0, 3)),
        np.float64(2.5),
    ],
    ids=["float32", "fortran", "big endian", "bool", "empty", "scalar"],
)
def test_arrays_read_back_as_numpy_reads_them(array, protocol):
    found = read({"x": array}, protocol)["x"]
    np.testing.assert_array_equal(found, array)
    assert found.shape == array.shape


def test_plain_numbers_and_lists_are_arrays():
    np.testing.assert_array_equal(read({"x": [[1, 2], [3, 4]]})["x"], [[1, 2], [3, 4]])


@pytest.mark.parametrize("value", ["text", None, {"a": 1}, np.array([None]), np.array(["a"])])
def test_what_is_no_array_of_numbers_says_so(value):
    folded = read_pickle(pickle.dumps({"x": value}))["x"]
    if isinstance(value, np.ndarray) and value.dtype.kind == "U":
        assert unfold(folded).dtype.kind == "U"
    else:
        with pytest.raises(ValueError, match="not"):
            unfold(folded)


@pytest.mark.parametrize("data", [b"", b"{}", b"\x80\x02", b"\x80\x02N.", pickle.dumps([1])])
def test_what_is_no_dictionary_is_a_value_error(data):
    with pytest.raises(ValueError, match=r"\w"):
        read_pickle(data)


def test_array_that_claims_more_than_it_holds_is_refused_without_memory():
    honest = pickle.dumps({"x": np.zeros(3, dtype=np.uint8)}, 2)
    # (version 1, shape (3,), ...): the 3 becomes two thousand million.
    needle = b"K\x01K\x03\x85"
    assert needle in honest
    bomb = honest.replace(needle, b"K\x01J" + struct.pack("<i", 2_000_000_000) + b"\x85")
    with pytest.raises(ValueError, match="do not fill"):
        unfold(read_pickle(bomb)["x"])


def test_huge_memo_index_is_refused():
    bomb = b"\x80\x02}r" + struct.pack("<I", 2**31) + b"."
    with pytest.raises(RefusedPickleError, match="far more objects"):
        read_pickle(bomb)


@pytest.mark.parametrize(
    "data",
    [b"\x80\x02\x82\x01.", b"(ios\nsystem\n.", b"Pname\n.", b"\x80\x02}U\x01xQs."],
    ids=["extension", "instance", "persistent id", "binary persistent id"],
)
def test_operations_no_mano_file_needs_are_refused(data):
    with pytest.raises(RefusedPickleError, match="operation"):
        read_pickle(data)


@pytest.mark.parametrize("name", ["chumpy.ch\nloads.x", "numpy\nload", "scipy.sparse\nload_npz"])
def test_names_beside_the_known_ones_are_refused(name):
    with pytest.raises(RefusedPickleError, match=name.split("\n")[0]):
        read_pickle(b"c" + name.encode() + b"\n.")


def test_reader_cannot_be_changed_by_what_it_reads():
    # BUILD with a slot state sets attributes of whatever lies below it, here of a reader's class.
    change = b"\x80\x02}U\x01xccopy_reg\n_reconstructor\nN}U\x05stateU\x01ys\x86bs."
    with pytest.raises(RefusedPickleError, match="reader itself"):
        read_pickle(change)
    np.testing.assert_array_equal(read({"x": np.arange(3)})["x"], np.arange(3))


def test_expressions_that_contain_themselves_end():
    # A chumpy object whose x is itself.
    loop = b"\x80\x02}U\x01xcchumpy.ch\nCh\n)\x81q\x01}U\x01xh\x01sbs."
    with pytest.raises(ValueError, match="too deep"):
        unfold(read_pickle(loop)["x"])


def test_sparse_matrix_of_absurd_shape_is_refused():
    honest = csc_matrix(np.eye(3))
    state = honest.__dict__ | {"_shape": (10**9, 10**9)}
    honest.__dict__.update(state)
    folded = read_pickle(pickle.dumps({"x": honest}, 2))["x"]
    with pytest.raises(ValueError, match="shape"):
        unfold(folded)
