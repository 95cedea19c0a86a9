"""A version for other programs: a mesh file per frame, or hand parameters under the smplx names."""

from pathlib import Path

import numpy as np
import trimesh

from geneoh.errors import InputError
from geneoh.files.atomic import in_one_step
from geneoh.files.npz import Arrays, write_archive
from geneoh.progress import OnStep, steps
from geneoh.viz.scene import PosedTrack, Scene


def write_meshes(scene: Scene, path: Path, on_step: OnStep | None) -> None:
    """Write the last version as a folder of meshes: SIDE_0000.ply and object_0000.ply per frame.

    The folder is the path without its ending, the meshes have that ending. World frame, metres.
    Vertices keep their order, so that frames correspond; a hand has no file in frames without it.
    The folder appears whole or not at all.

    Raises:
        InputError: the folder is there already, or cannot be made.
    """
    folder = path.with_suffix("")
    if folder.exists():
        raise InputError(f"{folder}: expected a new folder, got one that is there; remove it")
    with in_one_step(folder, folder=True, parents=True) as beside:
        for frame in steps(range(scene.frames), on_step):
            for name, mesh in _meshes(scene, frame).items():
                mesh.export(beside / f"{name}_{frame:04d}{path.suffix.lower()}")


def _meshes(scene: Scene, frame: int) -> dict[str, trimesh.Trimesh]:
    """The hands and the object's parts in a frame, by the name of their files."""
    surfaces = {
        hand.side: (hand.verts[frame], hand.model.faces)
        for hand in scene.versions[-1].hands
        if bool(hand.valid[frame])
    } | {
        scene.part_name(part).replace(" ", ""): (scene.object_verts(part, frame), mesh.faces)
        for part, mesh in enumerate(scene.object.meshes)
    }
    return {
        name: trimesh.Trimesh(verts.numpy(), faces.numpy(), process=False)
        for name, (verts, faces) in surfaces.items()
    }


def smplx_arrays(scene: Scene, hand: PosedTrack) -> Arrays:
    """One hand under the names of the smplx package, with the object's motion.

    `global_orient` (T, 3), `hand_pose` (T, 45), `betas` and `transl` (T, 3) go into an smplx MANO
    layer made with `use_pca=False, flat_hand_mean=True`. `transl` is the wrist minus the wrist of
    the model at rest. The betas belong to `hand_model`; the pose holds for any model.
    """
    model = hand.model
    wrist_at_rest = model.joint_regressor[0] @ (model.template + model.shape_dirs @ hand.betas)
    return {
        "side": np.array(hand.side),
        "hand_model": np.array(model.name),
        "fps": np.array(scene.fps),
        "flat_hand_mean": np.array(True),
        "global_orient": hand.pose[:, 0].numpy(),
        "hand_pose": hand.pose[:, 1:].flatten(1).numpy(),
        "betas": hand.betas.numpy(),
        "transl": (hand.wrist - wrist_at_rest).numpy(),
        "joints": hand.joints.numpy(),
        "valid": hand.valid.numpy(),
        "object_rotation": scene.object.rotation.numpy(),
        "object_translation": scene.object.translation.numpy(),
    }


def write_smplx(scene: Scene, path: Path) -> None:
    """Write the parameters of the one hand of the last version.

    Raises:
        InputError: there are two hands, which the smplx names cannot tell apart.
    """
    hands = scene.versions[-1].hands
    if len(hands) != 1:
        raise InputError(f"{path}: the smplx names hold one hand, got {len(hands)}; pass --side")
    write_archive(path, smplx_arrays(scene, hands[0]))
