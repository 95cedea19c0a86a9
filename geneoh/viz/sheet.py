"""A contact sheet of synthetic interactions: one of each object family, in the grasp."""

from pathlib import Path

import torch

from geneoh.geometry.rotations import axis_angle_to_matrix, matrix_to_axis_angle
from geneoh.metrics.report import measure_frames
from geneoh.progress import OnStep, steps
from geneoh.sequence.sequence import ObjectTrack
from geneoh.synthesis.objects import FAMILIES
from geneoh.synthesis.replay import NoFirstGraspsError, Replay, replay_shard
from geneoh.synthesis.shards import find_shards
from geneoh.synthesis.solids import PARTS
from geneoh.synthesis.surface import mesh_of, spacing_for_looks
from geneoh.viz.camera import cameras
from geneoh.viz.canvas import FAINT, SCALE_HEIGHT, Canvas
from geneoh.viz.look import DEFAULT_LOOK
from geneoh.viz.picture import Picture, draw
from geneoh.viz.scene import PosedTrack, Scene, Version

COLUMNS = 8
SCANNED = 32  # most scanned objects on the sheet, spread over their names
SHEET_CELL = 200  # side of one picture, pixels
SHEET_GAP = 10  # between two pictures, pixels
TEXT_HEIGHT = 40  # height of the two lines below a picture, pixels


def one_of_each(folder: Path) -> list[Replay]:
    """The first clip of every family in a folder of shards, then of some scanned objects, by name.

    Shards are read until no family is missing. Held-out families are in the validation shards only,
    so one of these comes first. A shard whose first grasps all failed, as a few may, is left out.

    Raises:
        NoFirstGraspsError: there is no other shard.
    """
    found: dict[str, Replay] = {}
    missed: NoFirstGraspsError | None = None
    for path in [*find_shards(folder, "val")[:1], *find_shards(folder, "train")]:
        try:
            shard = replay_shard(path)
        except NoFirstGraspsError as error:
            missed = missed or error
            continue
        for clip, family in enumerate(shard.made_from.families):
            if family not in found:
                found[family] = shard.chosen(torch.tensor([clip]))
        if found.keys() >= FAMILIES.keys():
            break
    if missed is not None and not found:
        raise missed
    scanned = sorted(found.keys() - FAMILIES.keys())
    scanned = scanned[:: -(-len(scanned) // SCANNED)] if scanned else []
    return [found[name] for name in (*FAMILIES, *scanned) if name in found]


def grasp_scene(clip: Replay) -> Scene:
    """One clip in the object's frame, at the frame in which the object is held."""
    frames = clip.held_frames()[:, None]
    skin, at = clip.skin(frames), int(frames)
    distance = clip.distance(skin.verts, frames)[0]
    clips, solid = clip.clips, clip.made_from.solids
    model = clip.made_from.hands.model
    turn = clips.rotation[0, at, 0].T
    pose = clips.pose[0, at].clone()
    pose[0] = matrix_to_axis_angle(turn @ axis_angle_to_matrix(pose[0]))
    joints, verts, fps = skin.joints[0], skin.verts[0], 30.0
    betas = model.template.new_zeros(model.shape_dirs.shape[-1])
    measures = measure_frames(distance, verts, joints, fps, torch.ones(1, dtype=torch.bool))
    measured = {"verts": verts, "joints": joints, "distance": distance, "measures": measures}
    hand = PosedTrack("right", model, pose[None], joints[:, 0], betas, **measured)
    parts = [solid.only(part) for part in range(PARTS if bool(solid.jointed) else 1)]
    meshes = tuple(mesh_of(part, spacing_for_looks(part)) for part in parts)
    (turned,), (moved,) = clip.joint_pose(frames)
    rotation = torch.stack([torch.eye(3)[None], turned], dim=1)
    translation = torch.stack([torch.zeros(1, 3), moved], dim=1)
    still = ObjectTrack(meshes, rotation[:, : len(parts)], translation[:, : len(parts)])
    family = clip.made_from.families[0]
    return Scene(family, (Version(family, (hand,)),), still, fps, {})


def contact_sheet(
    clips: list[Replay], *, cell: int = SHEET_CELL, on_step: OnStep | None = None
) -> Picture:
    """One picture per clip with its family, penetration and touching fingertips below."""
    columns = min(COLUMNS, len(clips))
    rows = -(-len(clips) // columns)
    width, height = cell + SHEET_GAP, cell + TEXT_HEIGHT
    canvas = Canvas(width * columns - SHEET_GAP, height * rows + SCALE_HEIGHT)
    for index, clip in enumerate(steps(clips, on_step)):
        scene = grasp_scene(clip)
        measures = scene.versions[0].measures
        left, top = index % columns * width, index // columns * height
        (picture,) = draw(scene, 0, cameras(scene, DEFAULT_LOOK.upward)[0], cell)
        canvas.paste(picture, left, top)
        title = Path(scene.title).stem.replace("_", " ")
        canvas.write(title, left + 8, top + cell + 2)
        depth = measures.means()["penetration_max_mm"]
        words = f"{depth:.1f} mm deep, {int(measures.fingers)} tips"
        canvas.write(words, left + 8, top + cell + 19, colour=FAINT)
    canvas.draw_scale("penetration", height * rows + 12)
    return canvas.picture()
