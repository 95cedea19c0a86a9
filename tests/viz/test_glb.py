import json
import os
import struct
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from geneoh.errors import InputError
from geneoh.geometry.mesh_files import load_mesh
from geneoh.readers.meshes import mesh_beside
from geneoh.readers.npz.files import load
from geneoh.sequence.sequence import ObjectTrack, Sequence
from geneoh.viz.glb import glb_bytes, turn_to_y_up
from geneoh.viz.look import Look
from geneoh.viz.scene import make_scene

UP = Look().upward

TYPES = {5126: "<f4", 5125: "<u4", 5121: "u1"}
WIDTHS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}
EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture(scope="module")
def glb(scene):
    return glb_bytes(scene)


def chunks(glb: bytes) -> tuple[dict, bytes]:
    length = struct.unpack_from("<I", glb, 12)[0]
    return json.loads(glb[20 : 20 + length]), glb[28 + length :]


def read(glb: bytes, index: int) -> np.ndarray:
    document, binary = chunks(glb)
    accessor = document["accessors"][index]
    view = document["bufferViews"][accessor["bufferView"]]
    kind, width = np.dtype(TYPES[accessor["componentType"]]), WIDTHS[accessor["type"]]
    values = np.frombuffer(binary, kind, accessor["count"] * width, view["byteOffset"])
    return values.reshape(accessor["count"], width)


@pytest.fixture(scope="module")
def lively():
    """The recording's left hand and its mirror image, of which fingers move, and the GLB."""
    given = load(EXAMPLES / "taco_clean.npz", obj=EXAMPLES / "taco_object.obj")[:20]
    left = given.hands[0]
    scene = make_scene({"clip": replace(given, hands=(left, left.mirrored()))})
    return scene, glb_bytes(scene)


def animated(glb: bytes, name: str) -> dict[str, np.ndarray]:
    """What is animated of the node of a name, by its path."""
    document, _ = chunks(glb)
    animation = document["animations"][0]
    return {
        channel["target"]["path"]: read(glb, animation["samplers"][channel["sampler"]]["output"])
        for channel in animation["channels"]
        if document["nodes"][channel["target"]["node"]]["name"] == name
    }


def placed(turns: np.ndarray, places: np.ndarray) -> np.ndarray:
    """(T, 4, 4) of quaternions xyzw and places."""
    result = np.tile(np.eye(4), (len(turns), 1, 1))
    result[:, :3, :3] = Rotation.from_quat(turns).as_matrix()
    result[:, :3, 3] = places
    return result


def played(glb: bytes, side: str) -> np.ndarray:
    """(T, V, 3) the vertices of a hand, as the specification of glTF has it."""
    document, _ = chunks(glb)
    (node,) = [node for node in document["nodes"] if node["name"] == f"{side} hand"]
    skin = document["skins"][node["skin"]]
    (primitive,) = document["meshes"][node["mesh"]]["primitives"]
    rest, joints, weights = (
        read(glb, primitive["attributes"][name]) for name in ("POSITION", "JOINTS_0", "WEIGHTS_0")
    )
    shares = animated(glb, node["name"])["weights"].reshape(-1, len(primitive["targets"]))
    assert shares.min() >= 0
    assert shares.max() <= 1
    bulges = np.stack([read(glb, target["POSITION"]) for target in primitive["targets"]])
    rest = rest + np.einsum("tk,kvc->tvc", shares, bulges)
    back = read(glb, skin["inverseBindMatrices"]).reshape(-1, 4, 4).transpose(0, 2, 1)
    worlds: dict[int, np.ndarray] = {}
    for index in skin["joints"]:  # parents come first
        joint = document["nodes"][index]
        moves = animated(glb, joint["name"])
        places = moves.get("translation", joint["translation"])
        worlds[index] = worlds.get(index, np.eye(4)) @ placed(moves["rotation"], places)
        worlds |= {child: worlds[index] for child in joint.get("children", ())}
    turned = np.stack([worlds[index] @ back[k] for k, index in enumerate(skin["joints"])], 1)
    blend = np.einsum("vi,tvirc->tvrc", weights, turned[:, joints])
    whole = np.concatenate([rest, np.ones_like(rest[..., :1])], axis=-1)
    return np.einsum("tvrc,tvc->tvr", blend, whole)[..., :3]


@pytest.mark.parametrize("hand", [0, 1])
def test_every_frame_played_back_is_that_frames_mesh(lively, hand):
    scene, glb = lively
    track = scene.versions[0].hands[hand]
    np.testing.assert_allclose(played(glb, track.side), track.verts.numpy(), atol=2e-5)


def test_trimesh_reads_the_object_where_it_is_in_the_first_frame(scene, glb, tmp_path):
    (tmp_path / "clip.glb").write_bytes(glb)
    loaded = trimesh.load_scene(tmp_path / "clip.glb", process=False)
    back = np.eye(4)
    back[:3, :3] = turn_to_y_up(UP).T
    turn, geometry = loaded.graph["object 2"]
    mesh = loaded.geometry[geometry].copy()
    mesh.apply_transform(back @ turn)
    np.testing.assert_allclose(mesh.vertices, scene.object_verts(1, 0).numpy(), atol=1e-4)


def test_a_hand_that_is_not_there_has_no_size(scene, glb):
    size = animated(glb, "left_wrist")["scale"]
    assert size[:, 0].tolist() == scene.versions[1].hands[1].valid.float().tolist()


@pytest.mark.parametrize("up", np.eye(3).tolist() + (-np.eye(3)).tolist())
def test_up_becomes_y(up):
    turn = turn_to_y_up(np.array(up))
    np.testing.assert_allclose(turn @ np.array(up), [0, 1, 0], atol=1e-9)
    np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-9)
    assert np.linalg.det(turn) == pytest.approx(1)


def test_what_does_not_move_has_no_animation(track):
    alone = Sequence((track[:1],), ObjectTrack.resting((), 1), 30.0)
    still, _ = chunks(glb_bytes(make_scene({"one frame": alone})))
    assert "animations" not in still
    assert len(still["meshes"]) == 1


def test_the_khronos_validator_finds_no_error(glb, node_modules, tmp_path):
    (tmp_path / "clip.glb").write_bytes(glb)
    code = (
        "const v = require('gltf-validator'), fs = require('fs');"
        "v.validateBytes(new Uint8Array(fs.readFileSync(process.argv[1])))"
        ".then((r) => console.log(JSON.stringify(r.issues)));"
    )
    run = subprocess.run(
        ["node", "-e", code, tmp_path / "clip.glb"],
        env={**os.environ, "NODE_PATH": str(node_modules)},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert run.returncode == 0, run.stderr
    issues = json.loads(run.stdout)
    assert issues["numErrors"] == 0, issues["messages"]
    assert issues["numWarnings"] == 0, issues["messages"]


def test_three_js_plays_every_frame_where_it_is_in_the_world(lively, node_modules, tmp_path):
    scene, glb = lively
    if not (node_modules / "three").is_dir():
        pytest.skip("GENEOH_NODE_MODULES holds no three; `npm install three` there")
    (tmp_path / "clip.glb").write_bytes(glb)
    script = Path(__file__).with_name("play_glb.mjs")
    times = [str(frame / scene.fps) for frame in range(scene.frames)]
    run = subprocess.run(
        ["node", script, node_modules, tmp_path / "clip.glb", *times],
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert run.returncode == 0, run.stderr
    turn = turn_to_y_up(UP)
    hand = scene.versions[0].hands[0]
    for frame, shown in enumerate(json.loads(run.stdout)):
        expected = {"left_hand": hand.verts[frame], "object": scene.object_verts(0, frame)}
        for name, verts in expected.items():
            np.testing.assert_allclose(shown[name], verts.numpy() @ turn.T, atol=1e-4)


def test_a_glb_of_ours_is_no_mesh_of_an_object(scene, tmp_path):
    path = tmp_path / "clip.glb"
    path.write_bytes(glb_bytes(scene))
    with pytest.raises(InputError, match="got a scene with hands that geneoh wrote"):
        load_mesh(path)
    assert mesh_beside(tmp_path / "clip.npz") == ()
