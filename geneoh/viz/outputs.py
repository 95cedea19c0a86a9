"""Write a scene in each output format; check the paths and formats first.

Formats for other programs are a mesh file per frame, and parameters under the smplx names.
"""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import torch

from geneoh.body.motion import turned_body
from geneoh.choices import Colouring
from geneoh.errors import InputError
from geneoh.files.atomic import in_one_step, write_whole
from geneoh.files.npz import Arrays, write_archive
from geneoh.files.outputs import check_ending, check_outputs, refuse_folder
from geneoh.hand.mano import translation_from_wrist
from geneoh.interrupts import interrupts_wait
from geneoh.progress import OnStep, steps
from geneoh.readers.bodies.bvh import bvh_text
from geneoh.readers.bodies.smpl import body_fields
from geneoh.readers.npz.files import motion_arrays
from geneoh.viz.canvas import filmstrip, png_bytes, refuse_frames
from geneoh.viz.glb import glb_bytes, turn_to_y_up
from geneoh.viz.look import DEFAULT_LOOK, Look
from geneoh.viz.page import page_html
from geneoh.viz.posed_track import PosedTrack
from geneoh.viz.scene import Scene
from geneoh.viz.video import ffmpeg_path, write_film

with interrupts_wait():
    import trimesh

MESHES = (".obj", ".ply")  # endings of the formats that make a folder
FILMS = (".mp4", ".gif")
ENDINGS = (".html", ".png", *FILMS, ".glb", ".bvh", ".npz", *MESHES)
"""Endings of all formats; `geneoh.files.outputs` has the mark that shows that a file is ours."""


USED_BY = {
    "frames": ((".png",), "a filmstrip, NAME.png"),
    "cell": ((".png",), "a filmstrip, NAME.png"),
    "up": ((".html", ".png", *FILMS, ".glb"), "a page, a picture, a film or NAME.glb"),
    "colouring": ((".png", *FILMS), "a picture or a film, NAME.png, .mp4 or .gif"),
}
"""The formats that show each field of `Look`, and the same in words."""


def lacking(name: str, paths: Iterable[Path]) -> str:
    """The formats that a field of `Look` needs, in words; empty if one of the paths has one."""
    endings, words = USED_BY[name]
    return "" if any(path.suffix.lower() in endings for path in paths) else words


def check_scene_outputs(
    paths: Iterable[Path], *, inputs: Iterable[Path | None], **others: Any
) -> None:
    """Refuse files that a scene cannot be written to; see `check_outputs`."""
    files, folders = [], []
    for path in paths:
        check_ending(path, ENDINGS)
        if path.suffix.lower() in MESHES:
            folders.append(path.with_suffix(""))
        else:
            files.append(path)
    check_outputs(files, folders=folders, inputs=inputs, **others)


def refuse_formats(scene: Scene, paths: Iterable[Path], look: Look) -> None:
    """Refuse the first format that a scene cannot be written in, before any other is written.

    `InputError`, and for films without ffmpeg `MissingAssetError`.
    """
    for path in paths:
        ending, hands = path.suffix.lower(), scene.versions[-1].hands
        if ending == ".npz" and scene.body is None and len(hands) != 1:
            raise InputError(
                f"{path}: the smplx names hold one hand, got {len(hands)}; pass --side, or in "
                "Python replace(sequence, hands=sequence.hand(SIDE))"
            )
        if ending in (".npz", ".bvh") and scene.body is not None and len(hands) < 2:
            got = " and ".join(hand.side for hand in hands)
            raise InputError(
                f"{path}: holds a body with both hands, got the {got} one; leave --side out"
            )
        if ending == ".bvh" and scene.body is None:
            raise InputError(
                f"{path}: a BVH holds a body, got hands alone; view what `geneoh generate --body` "
                "wrote"
            )
        if ending == ".png":
            refuse_frames(scene, look.frames)
        if ending in (".png", *FILMS):
            refuse_colouring(scene, look.colouring)
        if ending in FILMS:
            ffmpeg_path()


def refuse_colouring(scene: Scene, colouring: Colouring) -> None:
    """`InputError` for the colouring "contact" or "spread" in a scene without the data for it."""
    needs = {
        "contact": ("an object", "pass --obj MESH"),
        "spread": ("the expected error of keypoints", "clean with --samples 2 or more"),
    }
    if colouring in needs and not scene.shows(colouring):
        what, remedy = needs[colouring]
        raise InputError(
            f"{scene.title}: the colour {colouring} needs {what}, got none; {remedy}, or choose "
            "another colour"
        )


def write(
    scene: Scene, path: Path, look: Look = DEFAULT_LOOK, *, on_step: OnStep | None = None
) -> Path:
    """Write a scene in the format that the ending of the path names; returns the path written.

    `.html` is a page, `.png` a filmstrip, `.mp4` and `.gif` a film of all versions. `.glb`, `.npz`
    (smplx names), `.bvh` (a body), `.obj` and `.ply` hold the last version; the mesh formats make a
    folder of one file per frame, named without the ending.
    """
    check_ending(path, ENDINGS)
    refuse_formats(scene, [path], look)
    match path.suffix.lower():
        case ".html":
            write_whole(path, page_html(scene, look))
        case ".png":
            write_whole(path, png_bytes(filmstrip(scene, look, on_step)))
        case ".glb":
            write_whole(path, glb_bytes(scene, look))
        case ".npz":
            if scene.body is not None:
                write_archive(path, body_fields(scene.body))
            else:
                write_archive(path, smplx_arrays(scene, scene.versions[-1].hands[0]))
        case ".bvh":
            body = scene.body
            assert body is not None, "a BVH of hands alone was refused"
            turn = torch.from_numpy(turn_to_y_up(Look(up=body.up).upward)).to(body.motion.root)
            motion = turned_body(body.file_motion, turn)
            write_whole(path, bvh_text(body.skeleton, motion, scene.fps))
        case ".obj" | ".ply":
            return write_meshes(scene, path, on_step)
        case ".mp4" | ".gif":
            write_film(scene, path, look, on_step)
    return path


def write_meshes(scene: Scene, path: Path, on_step: OnStep | None) -> Path:
    """Write the last version as a folder of meshes: SIDE_0000.ply and object_0000.ply per frame.

    World frame, metres. Vertices keep their order, so that frames correspond; a hand has no file in
    frames without it. Returns the folder, which appears whole or not at all.
    """
    folder = path.with_suffix("")
    refuse_folder(folder)
    with in_one_step(folder, folder=True, parents=True) as beside:
        for frame in steps(range(scene.frames), on_step):
            surfaces = [
                (hand.side, hand.verts[frame], hand.model.faces)
                for hand in scene.versions[-1].hands
                if bool(hand.valid[frame])
            ]
            for part in scene.parts:
                mesh = scene.object.meshes[part]
                name = scene.part_name(part).replace(" ", "")
                surfaces.append((name, scene.object_verts(part, frame), mesh.faces))
            for name, verts, faces in surfaces:
                shape = trimesh.Trimesh(verts.numpy(), faces.numpy(), process=False)
                shape.export(beside / f"{name}_{frame:04d}{path.suffix.lower()}")
    return folder


def smplx_arrays(scene: Scene, hand: PosedTrack) -> Arrays:
    """One hand under the names of the smplx package, with the motion of its object.

    `global_orient` (T, 3), `hand_pose` (T, 45), `betas` and `transl` (T, 3) go into an smplx MANO
    layer made with `use_pca=False, flat_hand_mean=True`. `transl` is the wrist position minus the
    wrist of the shaped rest hand. The betas belong to `hand_model`; the pose fits any model.
    """
    model = hand.model
    return {
        "side": np.array(hand.side),
        "hand_model": np.array(model.name),
        "fps": np.array(scene.fps),
        "flat_hand_mean": np.array(True),
        "global_orient": hand.pose[:, 0].numpy(),
        "hand_pose": hand.pose[:, 1:].flatten(1).numpy(),
        "betas": hand.betas.numpy(),
        "transl": translation_from_wrist(model, hand.betas, hand.wrist).numpy(),
        "joints": hand.joints.numpy(),
        "valid": hand.valid.numpy(),
        **motion_arrays(scene.object),
    }
