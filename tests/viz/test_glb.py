import json
import os
import struct
import subprocess
from pathlib import Path

import numpy as np
import pytest
import trimesh

from geneoh.errors import InputError
from geneoh.geometry.mesh import load_mesh
from geneoh.readers.meshes import mesh_beside
from geneoh.sequence.sequence import ObjectTrack, Sequence
from geneoh.viz.glb import glb_bytes, upright
from geneoh.viz.look import Look
from geneoh.viz.scene import make_scene

UP = Look().upward

TYPES = {5126: "<f4", 5125: "<u4"}
WIDTHS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}


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


def test_every_frame_played_back_is_that_frames_mesh(scene, glb):
    document, _ = chunks(glb)
    hand = scene.versions[1].hands[0]
    primitive = document["meshes"][0]["primitives"][0]
    rest = read(glb, primitive["attributes"]["POSITION"])
    steps = np.stack([read(glb, target["POSITION"]) for target in primitive["targets"]])
    animation = document["animations"][0]
    (weights,) = (
        read(glb, animation["samplers"][channel["sampler"]]["output"])
        for channel in animation["channels"]
        if channel["target"] == {"node": 0, "path": "weights"}
    )
    weights = weights.reshape(len(hand.verts), -1)
    played = rest + np.einsum("tk,kvc->tvc", weights, steps)
    np.testing.assert_allclose(played, hand.verts.numpy(), atol=1e-6)


def test_trimesh_reads_the_first_frame_where_it_is_in_the_world(scene, glb, tmp_path):
    (tmp_path / "clip.glb").write_bytes(glb)
    loaded = trimesh.load_scene(tmp_path / "clip.glb", process=False)
    back = np.eye(4)
    back[:3, :3] = upright(UP).T
    hand = scene.versions[1].hands[0]
    for name, verts in (
        ("right hand", hand.verts[0]),
        ("object 2", scene.object_verts(1, 0)),
    ):
        turn, geometry = loaded.graph[name]
        mesh = loaded.geometry[geometry].copy()
        mesh.apply_transform(back @ turn)
        np.testing.assert_allclose(mesh.vertices, verts.numpy(), atol=1e-4)


def test_a_hand_that_is_not_there_has_no_size(scene, glb):
    document, _ = chunks(glb)
    animation = document["animations"][0]
    (size,) = (
        read(glb, animation["samplers"][channel["sampler"]]["output"])
        for channel in animation["channels"]
        if channel["target"]["path"] == "scale"
    )
    assert size[:, 0].tolist() == scene.versions[1].hands[1].valid.float().tolist()


@pytest.mark.parametrize("up", np.eye(3).tolist() + (-np.eye(3)).tolist())
def test_up_becomes_y(up):
    turn = upright(np.array(up))
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


def test_three_js_plays_every_frame_where_it_is_in_the_world(scene, glb, node_modules, tmp_path):
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
    turn = upright(UP)
    hand = scene.versions[1].hands[0]
    for frame, played in enumerate(json.loads(run.stdout)):
        expected = {"right_hand": hand.verts[frame], "object_2": scene.object_verts(1, frame)}
        for name, verts in expected.items():
            np.testing.assert_allclose(played[name], verts.numpy() @ turn.T, atol=1e-4)


def test_a_glb_of_ours_is_no_mesh_of_an_object(scene, tmp_path):
    path = tmp_path / "clip.glb"
    path.write_bytes(glb_bytes(scene))
    with pytest.raises(InputError, match="got a scene with hands that geneoh wrote"):
        load_mesh(path)
    assert mesh_beside(tmp_path / "clip.npz") == ()
