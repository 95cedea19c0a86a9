"""A tiny interaction to look at: a hand that sinks into a cube, two frames of another, a mesh."""

import os
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
import torch
import trimesh

from geneoh.geometry.mesh import Mesh
from geneoh.hand.library import load_hand
from geneoh.sequence.sequence import HandTrack, ObjectTrack, Sequence
from geneoh.viz import camera
from geneoh.viz.scene import make_scene

FRAMES = 6


def cube(side: float) -> Mesh:
    box = trimesh.creation.box((side, side, side)).subdivide()
    return Mesh(torch.from_numpy(box.vertices).float(), torch.from_numpy(box.faces).long())


def right_hand(lift: float) -> HandTrack:
    """A relaxed hand that moves by 1 mm a frame, `lift` metres above the cube's middle."""
    model = load_hand("right")
    pose = model.pose_mean.expand(FRAMES, 16, 3).clone()
    wrist = torch.tensor([0.08, lift, 0.0]).expand(FRAMES, 3).clone()
    wrist[:, 0] += 0.001 * torch.arange(FRAMES)
    return HandTrack(
        side="right",
        valid=torch.ones(FRAMES, dtype=torch.bool),
        pose=pose,
        wrist=wrist,
        betas=torch.zeros(10),
        hand_model="embedded",
        joint_spread=torch.full((FRAMES, 21), 0.004),
    )


def interaction(lift: float, source: str, parts: int = 1) -> Sequence:
    turn = torch.eye(3).expand(FRAMES, parts, 3, 3).clone()
    place = torch.zeros(FRAMES, parts, 3)
    place[:, :, 0] = 0.001 * torch.arange(FRAMES)[:, None]
    place[:, 1:, 2] = 0.1
    right = right_hand(lift)
    left = replace(right.mirrored(), valid=torch.arange(FRAMES) > 0)
    meshes = (cube(0.06),) * parts
    return Sequence((right, left), ObjectTrack(meshes, turn, place), 30.0, source)


@pytest.fixture
def few_directions(monkeypatch):
    """The camera tries few directions, where a test is not about what the picture shows."""
    monkeypatch.setattr(camera, "TURNS", 2)


@pytest.fixture
def track():
    """The right hand of the scene's first version, as it came."""
    return right_hand(0.0)


@pytest.fixture(scope="session")
def sequences():
    """An interaction of two hands and an object of two parts, before and after."""
    return interaction(0.0, "noisy", 2), interaction(0.06, "clean", 2)


@pytest.fixture(scope="session")
def scene(sequences):
    """Two hands, one object of two parts, before and after, three samples of the right hand."""
    before, after = sequences
    scene = make_scene({"noisy": before, "clean": after})
    joints = scene.versions[1].hands[0].joints
    drawn = torch.stack([joints, joints + 0.01, joints - 0.01])
    return replace(scene, samples={"right": drawn})


@pytest.fixture(scope="session")
def node_modules():
    """A folder of node packages that the browser and GLB tests use, or a skip that says why.

    GENEOH_NODE_MODULES names it: `npm install gltf-validator playwright-core three` makes one.
    """
    if shutil.which("node") is None:
        pytest.skip("node is not installed")
    folder = os.environ.get("GENEOH_NODE_MODULES")
    if folder is None or not Path(folder).is_dir():
        pytest.skip("GENEOH_NODE_MODULES names no folder of node packages; .ci/run makes one")
    return Path(folder)
