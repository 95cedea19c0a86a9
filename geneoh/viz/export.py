"""A take for other programs: one mesh file per frame, or hand parameters under the smplx names."""

import os
import secrets
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Literal

import numpy as np
import trimesh
from jaxtyping import Float
from torch import Tensor

from geneoh.errors import InputError
from geneoh.files.atomic import unwritable
from geneoh.files.npz import Arrays, write_archive
from geneoh.viz.scene import Scene, SeenHand, Take

MeshFormat = Literal["obj", "ply"]


def write_meshes(
    scene: Scene,
    take: Take,
    folder: Path,
    kind: MeshFormat,
    *,
    on_frame: Callable[[int, int], None] | None = None,
) -> None:
    """Write a folder of meshes in the world, metres: SIDE_0000.ply and object_0000.ply per frame.

    Vertices keep their order, so that frames correspond; a hand that is not there has no file. The
    folder appears whole or not at all.

    Raises:
        InputError: the folder is there already, or cannot be made.
    """
    if folder.exists():
        raise InputError(f"{folder}: expected a new folder, got one that is there; remove it")
    beside = folder.with_name(f".{folder.name}.{secrets.token_hex(4)}.tmp")
    try:
        beside.mkdir(parents=True)
        for frame in range(scene.frames):
            for name, verts, faces in _surfaces(scene, take, frame):
                mesh = trimesh.Trimesh(verts, faces, process=False)
                mesh.export(beside / f"{name}_{frame:04d}.{kind}")
            if on_frame is not None:
                on_frame(frame + 1, scene.frames)
        os.replace(beside, folder)
    except OSError as error:
        raise unwritable(folder, error) from None
    finally:
        shutil.rmtree(beside, ignore_errors=True)


def _surfaces(
    scene: Scene, take: Take, frame: int
) -> list[tuple[str, Float[np.ndarray, "V 3"], np.ndarray]]:
    """Name, vertices and faces of everything that is there in a frame."""
    found = [
        (f"{hand.side}", hand.verts[frame].numpy(), hand.model.faces.numpy())
        for hand in take.hands
        if bool(hand.valid[frame])
    ]
    many = len(scene.object.meshes) > 1
    for part, mesh in enumerate(scene.object.meshes):
        name = f"object{part + 1}" if many else "object"
        found.append((name, scene.object_verts(part, frame).numpy(), mesh.faces.numpy()))
    return found


def smplx_arrays(scene: Scene, hand: SeenHand) -> Arrays:
    """One hand under the names of the smplx package, with the object's motion.

    `global_orient` (T, 3), `hand_pose` (T, 45) and `betas` go into an smplx MANO layer made with
    `use_pca=False, flat_hand_mean=True`, `transl` (T, 3) too: it is the wrist less where the model
    itself puts it. The betas belong to `hand_model`; the pose means the same to any.
    """
    model = hand.model
    rest = model.template + model.shape_dirs @ hand.betas
    offset: Float[Tensor, " 3"] = model.joint_regressor[0] @ rest
    return {
        "side": np.array(hand.side),
        "hand_model": np.array(model.name),
        "fps": np.array(scene.fps),
        "flat_hand_mean": np.array(True),
        "global_orient": hand.pose[:, 0].numpy(),
        "hand_pose": hand.pose[:, 1:].flatten(1).numpy(),
        "betas": hand.betas.numpy(),
        "transl": (hand.wrist - offset).numpy(),
        "joints": hand.joints.numpy(),
        "valid": hand.valid.numpy(),
        "object_rotation": scene.object.rotation.numpy(),
        "object_translation": scene.object.translation.numpy(),
    }


def write_smplx(scene: Scene, take: Take, path: Path) -> None:
    """Write the parameters of a take's one hand.

    Raises:
        InputError: there are two hands, which the smplx names cannot tell apart.
    """
    if len(take.hands) != 1:
        raise InputError(
            f"{path}: the smplx names hold one hand, got {len(take.hands)}; pass --side"
        )
    write_archive(path, smplx_arrays(scene, take.hands[0]))
