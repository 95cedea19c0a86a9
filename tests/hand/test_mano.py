"""Reading MANO files, on imitations in the exact layout of the official ones."""

import builtins
import os
import pickle
import struct
import subprocess
import sys
from io import BytesIO
from types import ModuleType
from typing import ClassVar

import numpy as np
import pytest
import torch
from scipy.sparse import csc_matrix, csr_matrix
from smplx.body_models import MANO
from smplx.utils import Struct

from geneoh.errors import InputError, MissingAssetError
from geneoh.hand.embedded import read_arrays
from geneoh.hand.library import load_hand
from geneoh.hand.mano import (
    find_mano,
    load_mano,
    load_pose_space,
    translation_from_wrist,
)


def init_ch(self, x):
    """chumpy.ch.Ch: an array under the name x."""
    self.x = x
    self._dirty_vars = {"x"}
    self._itr = None


def init_select(self, a, idxs, preferred_shape):
    """chumpy.reordering.Select: entries of another chumpy object."""
    self.a, self.idxs, self.preferred_shape = a, idxs, preferred_shape
    self._dirty_vars = {"a"}


@pytest.fixture
def chumpy(monkeypatch):
    """Modules of chumpy's names for as long as a file is being written."""
    monkeypatch.setitem(sys.modules, "chumpy", ModuleType("chumpy"))
    for name, kind, init in (
        ("chumpy.ch", "Ch", init_ch),
        ("chumpy.reordering", "Select", init_select),
    ):
        module = ModuleType(name)
        setattr(module, kind, type(kind, (), {"__init__": init, "__module__": name}))
        monkeypatch.setitem(sys.modules, name, module)


class Python2Pickler(pickle._Pickler):
    """Writes bytes as the text that python 2 wrote, not by a detour over _codecs."""

    dispatch: ClassVar = dict(pickle._Pickler.dispatch)

    def save_bytes(self, value):
        self.write(b"T" + struct.pack("<i", len(value)) + value)
        self.memoize(value)

    dispatch[bytes] = save_bytes


def in_python2(value, protocol=2):
    """The pickle that python 2 with an old numpy and scipy would have written."""
    stream = BytesIO()
    Python2Pickler(stream, protocol=protocol, fix_imports=True).dump(value)
    return (
        stream.getvalue()
        .replace(b"numpy._core", b"numpy.core")
        .replace(b"scipy.sparse._csc", b"scipy.sparse.csc")
        .replace(b"scipy.sparse._csr", b"scipy.sparse.csr")
    )


def plain_arrays(side="right"):
    """Arrays that differ from the embedded hand's, so that nothing can be read from there."""
    random = np.random.default_rng(3)
    arrays = {name: array.astype(np.float64) for name, array in read_arrays().items()}
    arrays["v_template"] += 1e-3 * random.standard_normal(arrays["v_template"].shape)
    arrays["f"] = read_arrays()["f"].astype(np.uint32)
    arrays["kintree_table"] = read_arrays()["kintree_table"].astype(np.int64) % 2**32
    if side == "left":
        arrays["v_template"][:, 0] *= -1
        arrays["hands_mean"] = (arrays["hands_mean"].reshape(15, 3) * [1, -1, -1]).ravel()
        arrays["f"] = arrays["f"][:, ::-1].copy()
    return {name: a for name, a in arrays.items() if not name.startswith("pose_")}


def official(arrays):
    """The same arrays as the official file holds them."""
    ch, select = sys.modules["chumpy.ch"].Ch, sys.modules["chumpy.reordering"].Select
    dirs = arrays["shapedirs"]
    more = np.concatenate([dirs, np.ones((*dirs.shape[:2], 4))], axis=2)
    kept = np.arange(more.size).reshape(more.shape)[:, :, :10].ravel()
    return arrays | {
        "shapedirs": select(ch(more), kept, dirs.shape),
        "J_regressor": csc_matrix(arrays["J_regressor"]),
        "kintree_table": arrays["kintree_table"].astype(np.uint32),
        "J": np.zeros((16, 3)),
        "bs_style": "lbs",
        "bs_type": "lrotmin",
    }


def write(folder, side="right", arrays=None, data=None):
    path = folder / f"MANO_{side.upper()}.pkl"
    path.write_bytes(in_python2(official(arrays)) if data is None else data)
    return path


def assert_holds(model, arrays):
    """Every array is what was written, to float32."""
    read = {
        "v_template": model.template,
        "shapedirs": model.shape_dirs,
        "posedirs": model.pose_dirs,
        "J_regressor": model.joint_regressor,
        "weights": model.skin_weights,
        "f": model.faces,
        "hands_mean": model.pose_mean[1:].flatten(),
    }
    for name, tensor in read.items():
        np.testing.assert_array_equal(tensor.numpy(), arrays[name].astype(tensor.numpy().dtype))


@pytest.mark.parametrize("protocol", [0, 1, 2])
def test_official_layout_reads_back_exactly(tmp_path, chumpy, protocol):
    arrays = plain_arrays()
    if protocol < 2:  # as text the large arrays are slow to write and show nothing new
        arrays["posedirs"] = np.zeros_like(arrays["posedirs"])
    stored = official(arrays)
    data = in_python2(stored, protocol) if protocol == 2 else pickle.dumps(stored, protocol)
    write(tmp_path, data=data)
    model = load_hand("right", source="mano", mano_dir=tmp_path)
    assert (model.name, model.side) == ("mano", "right")
    assert_holds(model, arrays)


@pytest.mark.parametrize("protocol", [3, 4, 5])
def test_file_written_anew_by_python_3_reads_back_exactly(tmp_path, chumpy, protocol):
    arrays = plain_arrays()
    stored = official(arrays) | {"J_regressor": csr_matrix(arrays["J_regressor"])}
    write(tmp_path, data=pickle.dumps(stored, protocol))
    assert_holds(load_mano("right", tmp_path), arrays)


@pytest.mark.parametrize("save", [np.savez, np.savez_compressed])
def test_npz_with_the_same_fields_reads_back_exactly(tmp_path, save):
    arrays = plain_arrays()
    save(tmp_path / "MANO_RIGHT.npz", **arrays)
    assert_holds(load_mano("right", tmp_path), arrays)


def test_smplx_agrees_on_the_arrays_that_were_read(tmp_path, chumpy):
    arrays = plain_arrays()
    write(tmp_path, arrays=arrays)
    model = load_mano("right", tmp_path)
    theirs = MANO(
        "", data_struct=Struct(**arrays), is_rhand=True, use_pca=False, flat_hand_mean=True
    )
    generator = torch.Generator().manual_seed(0)
    betas, pose, transl = (torch.randn(4, *s, generator=generator) for s in ((10,), (16, 3), (3,)))
    out = theirs(
        betas=betas, global_orient=pose[:, 0], hand_pose=pose[:, 1:].flatten(1), transl=transl
    )
    wrist = transl + model.rest_wrist(betas)
    assert (model.shaped(betas).posed(pose, wrist).verts - out.vertices).abs().max() < 1e-5
    torch.testing.assert_close(translation_from_wrist(model, betas, wrist), transl)


def test_wrist_is_the_translation_plus_the_rest_wrist():
    model = load_hand("left")
    betas, transl = torch.randn(5, 10), torch.randn(5, 3)
    verts = model.template + torch.einsum("vcs,bs->bvc", model.shape_dirs, betas)
    expected = transl + torch.einsum("v,bvc->bc", model.joint_regressor[0], verts)
    torch.testing.assert_close(transl + model.rest_wrist(betas), expected)


def test_left_shape_directions_are_mirrored_unless_asked_otherwise(tmp_path, chumpy):
    right, left = plain_arrays(), plain_arrays("left")
    left["shapedirs"] = right["shapedirs"]  # the error of the official file
    write(tmp_path, "right", right)
    write(tmp_path, "left", left)
    betas = torch.randn(10, generator=torch.Generator().manual_seed(1))
    flip = torch.tensor([-1.0, 1.0, 1.0])
    mended = load_mano("left", tmp_path).shaped(betas)
    torch.testing.assert_close(
        mended.verts, load_mano("right", tmp_path).shaped(betas).verts * flip, atol=1e-6, rtol=0
    )
    as_is = load_mano("left", tmp_path, name="mano-as-shipped")
    np.testing.assert_array_equal(as_is.shape_dirs.numpy(), left["shapedirs"].astype(np.float32))
    assert (mended.model.name, as_is.name) == ("mano", "mano-as-shipped")
    assert load_hand("right", source="mano-as-shipped", mano_dir=tmp_path).name == "mano"


def test_left_file_that_was_mended_before_is_left_alone(tmp_path, chumpy):
    right, left = plain_arrays(), plain_arrays("left")
    left["shapedirs"] = right["shapedirs"] * np.array([-1.0, 1.0, 1.0])[:, None]
    write(tmp_path, "right", right)
    write(tmp_path, "left", left)
    assert_holds(load_mano("left", tmp_path), left)
    official_left = load_mano("left", tmp_path, name="mano-as-shipped")
    np.testing.assert_array_equal(
        official_left.shape_dirs.numpy(), right["shapedirs"].astype(np.float32)
    )


@pytest.mark.parametrize("is_mended", [True, False])
def test_left_file_without_the_right_one_is_told_by_how_it_grows(tmp_path, is_mended):
    left = plain_arrays("left")
    shipped, flip = left["shapedirs"], np.array([-1.0, 1.0, 1.0])[:, None]
    mended = shipped * flip
    left["shapedirs"] = mended if is_mended else shipped
    np.savez(tmp_path / "MANO_LEFT.npz", **left)
    for name, expected in (("mano", mended), ("mano-as-shipped", shipped)):
        found = load_mano("left", tmp_path, name=name).shape_dirs.numpy()
        np.testing.assert_array_equal(found, expected.astype(np.float32))


def test_folder_comes_from_the_environment(tmp_path, chumpy, monkeypatch):
    (tmp_path / "models").mkdir()
    path = write(tmp_path / "models", arrays=plain_arrays())
    monkeypatch.setenv("GENEOH_MANO_DIR", str(tmp_path))
    assert find_mano("right") == path
    assert load_hand("right", source="mano").name == "mano"


def test_missing_file_says_what_to_get_and_where_to_put_it(tmp_path, monkeypatch):
    with pytest.raises(MissingAssetError, match=r"MANO_LEFT\.pkl.*mano\.is\.tue\.mpg\.de") as error:
        load_hand("left", source="mano", mano_dir=tmp_path)
    assert str(tmp_path) in str(error.value)
    monkeypatch.delenv("GENEOH_MANO_DIR", raising=False)
    with pytest.raises(MissingAssetError, match="GENEOH_MANO_DIR"):
        load_hand("left", source="mano")


def test_missing_fields_are_named(tmp_path, chumpy):
    arrays = plain_arrays()
    stored = official(arrays)
    del stored["weights"], stored["posedirs"]
    write(tmp_path, data=in_python2(stored))
    with pytest.raises(InputError, match="posedirs, weights is not in it"):
        load_mano("right", tmp_path)


def wrong_fields():
    arrays = plain_arrays()
    tree = arrays["kintree_table"].copy()
    tree[0, 5] = 7
    faces = arrays["f"].copy()
    faces[0, 0] = 778
    return {
        "posedirs": arrays["posedirs"][:, :, :100],
        "J_regressor": arrays["J_regressor"].T.copy(),
        "weights": np.full((778, 16), np.nan),
        "v_template": np.float64(3.0),
        "shapedirs": arrays["shapedirs"][..., :4],
        "kintree_table": tree,
        "f": faces,
        "hands_mean": np.zeros(12),
    }


@pytest.mark.parametrize("name", sorted(wrong_fields()))
def test_field_of_another_shape_is_named(tmp_path, name):
    np.savez(tmp_path / "MANO_RIGHT.npz", **(plain_arrays() | {name: wrong_fields()[name]}))
    with pytest.raises(InputError, match=r"MANO_RIGHT\.npz"):
        load_mano("right", tmp_path)


def test_a_hand_without_faces_is_refused(tmp_path):
    np.savez(tmp_path / "MANO_RIGHT.npz", **(plain_arrays() | {"f": np.zeros((0, 3), int)}))
    with pytest.raises(InputError, match=r"\(F, 3\) faces, got 778 and \(0, 3\)"):
        load_mano("right", tmp_path)


@pytest.mark.parametrize(("side", "held"), [("left", "right"), ("right", "left")])
def test_the_hand_of_the_other_side_is_refused(tmp_path, side, held):
    np.savez(tmp_path / f"MANO_{side.upper()}.npz", **plain_arrays(held))
    with pytest.raises(InputError, match=f"expected the {side} hand, got the {held} one"):
        load_mano(side, tmp_path)


class Attack:
    """Runs a function of its choice when it is unpickled by the usual means."""

    def __init__(self, function, *args):
        self.function, self.args = function, args

    def __reduce__(self):
        return self.function, self.args


def attacks(canary):
    return {
        f"{os.system.__module__}.system": Attack(os.system, f"touch {canary}"),
        "eval": Attack(builtins.eval, f"open({str(canary)!r}, 'w').close()"),
        "Popen": Attack(subprocess.Popen, ["touch", str(canary)]),
        "getattr": Attack(builtins.getattr, np.ndarray, "tofile"),
        "numpy.fromfile": Attack(np.fromfile, str(canary)),
        "numpy.load": Attack(np.load, str(canary)),
    }


@pytest.mark.parametrize("protocol", [0, 2, 4])
@pytest.mark.parametrize("name", sorted(attacks("x")))
def test_hostile_pickle_is_refused_by_name_and_runs_nothing(tmp_path, name, protocol):
    canary = tmp_path / "canary"
    write(tmp_path, data=pickle.dumps({"v_template": attacks(canary)[name]}, protocol))
    with pytest.raises(InputError, match=name.replace(".", r"\.")):
        load_mano("right", tmp_path)
    assert not canary.exists()


def test_the_same_attack_works_on_the_ordinary_unpickler(tmp_path):
    canary = tmp_path / "canary"
    pickle.loads(pickle.dumps(attacks(canary)["eval"]))
    assert canary.exists()


@pytest.mark.parametrize("share", [0.0, 0.001, 0.3, 0.999])
def test_truncated_files_are_input_errors(tmp_path, chumpy, share):
    data = in_python2(official(plain_arrays()))
    write(tmp_path, data=data[: int(share * len(data))])
    with pytest.raises(InputError, match="download it again"):
        load_mano("right", tmp_path)


@pytest.mark.parametrize("share", [0.0, 0.5, 0.99])
def test_truncated_npz_is_an_input_error(tmp_path, share):
    path = tmp_path / "MANO_RIGHT.npz"
    np.savez(path, **plain_arrays())
    data = path.read_bytes()
    path.write_bytes(data[: int(share * len(data))])
    with pytest.raises(InputError, match=r"MANO_RIGHT\.npz"):
        load_mano("right", tmp_path)


def test_npz_with_objects_is_refused(tmp_path):
    arrays = plain_arrays() | {"J_regressor": np.array([{}], dtype=object)}
    np.savez(tmp_path / "MANO_RIGHT.npz", **arrays)
    with pytest.raises(InputError, match="'J_regressor' must hold finite numbers"):
        load_mano("right", tmp_path)


def test_numbers_that_no_hand_has_are_refused(tmp_path):
    arrays = plain_arrays()
    arrays["posedirs"] = np.full_like(arrays["posedirs"], 1e300, dtype=np.float64)
    np.savez(tmp_path / "MANO_RIGHT.npz", **arrays)
    with pytest.raises(InputError, match="'posedirs' must hold finite numbers"):
        load_mano("right", tmp_path)


@pytest.mark.parametrize(
    ("name", "factor"),
    [("v_template", 0.0), ("v_template", 1000.0), ("shapedirs", 1e4), ("posedirs", 1e4)],
)
def test_a_hand_of_another_size_is_refused(tmp_path, name, factor):
    arrays = plain_arrays()
    arrays[name] = (arrays[name] + 0.001 * (factor > 1)) * factor
    np.savez(tmp_path / "MANO_RIGHT.npz", **arrays)
    with pytest.raises(InputError, match=f"'{name}' must be in metres"):
        load_mano("right", tmp_path)


def test_pose_space_is_that_of_the_file(tmp_path, chumpy):
    arrays = plain_arrays() | {"hands_components": np.arange(2025.0).reshape(45, 45)}
    write(tmp_path, arrays=arrays)
    space = load_pose_space("right", tmp_path)
    np.testing.assert_array_equal(space.mean, arrays["hands_mean"].astype(np.float32))
    np.testing.assert_array_equal(space.components, arrays["hands_components"])
    write(tmp_path, arrays=plain_arrays() | {"hands_components": np.eye(44)})
    with pytest.raises(InputError, match=r"'hands_components' must be \(45, 45\)"):
        load_pose_space("right", tmp_path)


@pytest.mark.mano
@pytest.mark.skipif("GENEOH_MANO_DIR" not in os.environ, reason="GENEOH_MANO_DIR is not set")
@pytest.mark.parametrize("side", ["right", "left"])
def test_the_users_own_mano_file_is_a_closed_hand_towards_the_expected_side(side):
    model = load_mano(side)
    assert model.template.shape == (778, 3)
    tips = model.template[list(model.tip_verts[:4])]
    root = model.joint_regressor[0] @ model.template
    assert ((tips - root)[:, 0] * (-1 if side == "right" else 1) > 0.1).all()
