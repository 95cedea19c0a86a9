"""A contact sheet of synthetic interactions: one of each object family, in the grasp."""

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import torch
from PIL import Image, ImageDraw

from geneoh.geometry.rotations import axis_angle_to_matrix, matrix_to_axis_angle
from geneoh.hand.model import HandModel
from geneoh.hand.skeleton import TIP_KEYPOINTS
from geneoh.metrics.contact import penetration_depth, tips_in_contact
from geneoh.sequence.sequence import HandTrack, ObjectTrack
from geneoh.synthesis.objects import FAMILIES
from geneoh.synthesis.replay import Replay, replay_shard
from geneoh.synthesis.shards import find_shards
from geneoh.synthesis.solids import PARTS
from geneoh.synthesis.surface import mesh_of, spacing_for_looks
from geneoh.viz.camera import cameras
from geneoh.viz.colours import SCALES
from geneoh.viz.picture import Picture, draw
from geneoh.viz.scene import Scene, SeenHand, Take
from geneoh.viz.strip import FAINT, GAP, INK, PAPER, UP, draw_scale, font

COLUMNS = 8
CELL = 200
"""Side of one picture, pixels."""
WORDS, FOOT = 40, 40
"""Heights of the two lines below a picture, and of the scale below all, pixels."""


def one_of_each(folder: Path, hand: HandModel) -> list[Replay]:
    """The first clip of every family that a folder of shards holds, in the order of the families.

    Shards are looked at until no family is missing; those that are held out are in the first.
    """
    found: dict[str, Replay] = {}
    for path in [*find_shards(folder, "val")[:1], *find_shards(folder, "train")]:
        shard = replay_shard(path, hand)
        for clip, family in enumerate(shard.made_from.families):
            if family not in found:
                found[family] = shard.chosen(torch.tensor([clip]))
        if len(found) == len(FAMILIES):
            break
    return [found[family] for family in FAMILIES if family in found]


def grasp_scene(clip: Replay) -> Scene:
    """One clip in the object's frame at the frame in which it is held, measured on the skin."""
    frames = clip.held_frames()[:, None]
    skin, at = clip.skin(frames), int(frames)
    distance = clip.distance(skin.verts, frames)[0]
    clips, solid = clip.clips, clip.made_from.solids
    model = clip.made_from.hands.model
    turn = clips.rotation[0, at, 0].T
    pose = clips.pose[0, at].clone()
    pose[0] = matrix_to_axis_angle(turn @ axis_angle_to_matrix(pose[0]))
    joints, verts = skin.joints[0], skin.verts[0]
    track = HandTrack("right", torch.ones(1, dtype=torch.bool), joints=joints)
    hand = SeenHand(
        side="right",
        model=model,
        track=track,
        pose=pose[None],
        wrist=joints[:, 0],
        betas=model.template.new_zeros(model.shape_dirs.shape[-1]),
        verts=verts,
        joints=joints,
        distance=distance,
        depth=penetration_depth(distance),
        fingers=tips_in_contact(distance, verts, joints[:, list(TIP_KEYPOINTS)]).sum(-1).float(),
        acceleration=joints.new_full((1,), torch.nan),
    )
    parts = [solid.only(part) for part in range(PARTS if bool(solid.jointed) else 1)]
    meshes = tuple(mesh_of(part, spacing_for_looks(part)) for part in parts)
    joint = clip.joint_pose(frames)
    rotation = torch.stack([torch.eye(3)[None], joint[0][0]], dim=1)
    translation = torch.stack([torch.zeros(1, 3), joint[1][0]], dim=1)
    still = ObjectTrack(meshes, rotation[:, : len(parts)], translation[:, : len(parts)])
    return Scene((Take(clip.made_from.families[0], (hand,)),), still, 30.0, {})


def contact_sheet(
    clips: list[Replay],
    *,
    cell: int = CELL,
    on_picture: Callable[[int, int], None] | None = None,
) -> Picture:
    """One picture per clip with its family, penetration and touching fingertips below.

    Args:
        clips: one interaction each.
        cell: side of one picture in pixels.
        on_picture: called with the pictures done and in all.
    """
    columns = min(COLUMNS, len(clips))
    rows = -(-len(clips) // columns)
    size = ((cell + GAP) * columns - GAP, (cell + WORDS) * rows + FOOT)
    sheet = Image.new("RGB", size, PAPER)
    pen = ImageDraw.Draw(sheet)
    for index, clip in enumerate(clips):
        scene = grasp_scene(clip)
        take = scene.takes[0]
        camera = cameras(scene, UP)[0]
        left, top = index % columns * (cell + GAP), index // columns * (cell + WORDS)
        (picture,) = draw(scene, [take], 0, camera, (cell, cell))
        sheet.paste(Image.fromarray(picture), (left, top))
        for line, (words, ink) in enumerate(captions(take)):
            pen.text((left + 8, top + cell + 2 + 17 * line), words, ink, font(13))
        if on_picture is not None:
            on_picture(index + 1, len(clips))
    draw_scale(sheet, SCALES["penetration"], (12, size[1] - FOOT + 12))
    return np.asarray(sheet)


def captions(take: Take) -> Iterator[tuple[str, tuple[int, int, int]]]:
    """The family; how deep the hand is in the object, and how many fingertips touch it."""
    hand = take.hands[0]
    yield take.title.replace("_", " "), INK
    yield f"{1000 * float(hand.depth):.1f} mm deep, {int(hand.fingers)} tips", FAINT
