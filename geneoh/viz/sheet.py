"""Contact sheets of made data: a grasp of each object family, or a body in each gesture."""

from pathlib import Path

import torch

from geneoh.geometry.rotations import axis_angle_to_matrix, matrix_to_axis_angle
from geneoh.progress import OnStep, steps
from geneoh.readers.bodies.base import BodyRecording
from geneoh.sequence.body_hands import hand_tracks
from geneoh.sequence.sequence import ObjectTrack, Sequence
from geneoh.synthesis.actions.action import FPS
from geneoh.synthesis.gestures import shards as gesture_shards
from geneoh.synthesis.gestures.clips import NAMES, Gestures
from geneoh.synthesis.replay import NoFirstGraspsError, Replay, replay_shard
from geneoh.synthesis.shapes.families import FAMILIES
from geneoh.synthesis.shapes.solids import PARTS
from geneoh.synthesis.shapes.surface import mesh_of_solid, spacing_for_looks
from geneoh.synthesis.shards import find_shards
from geneoh.viz.camera import cameras
from geneoh.viz.canvas import FAINT, SCALE_HEIGHT, Canvas
from geneoh.viz.look import DEFAULT_LOOK, Look
from geneoh.viz.picture import Picture, draw, hands_from_near
from geneoh.viz.posed_track import PosedTrack
from geneoh.viz.scene import Scene, Version, make_scene

SHEET_COLUMNS = 8
SCANNED = 32  # most scanned objects on the sheet, spread over their names
SHEET_CELL = 200  # side of one picture, pixels
SHEET_GAP = 10  # between two pictures, pixels
TEXT_HEIGHT = 40  # height of the two lines below a picture, pixels
BODY_COLUMNS, BODY_CELL, BODY_GAP = 9, 180, 12  # for bodies; hands have half the side
SENTENCE_LENGTH = 32  # letters of a sentence that are shown


def sheet_of(kind: str, folder: Path, on_step: OnStep | None) -> Picture:
    """The contact sheet of a folder of shards of bodies, or of interactions."""
    if kind == "bodies":
        return gesture_sheet(one_of_each_gesture(folder), on_step=on_step)
    return contact_sheet(one_of_each(folder), on_step=on_step)


def places(count: int, columns: int, width: int, height: int) -> list[tuple[int, int]]:
    """Upper left corners of cells in rows of `columns`, pixels."""
    return [(index % columns * width, index // columns * height) for index in range(count)]


def one_of_each(folder: Path) -> list[Replay]:
    """The first clip of every family in a folder of shards, then of some scanned objects, by name.

    Shards are read until no family is missing. Held-out families are in the validation shards only,
    so one of these comes first. A shard whose first grasps all failed, as a few may, is left out.

    Raises:
        NoFirstGraspsError: no other shard is left.
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
                found[family] = shard.take([clip], "B")
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
    measured = (verts, joints, torch.ones(1, dtype=torch.bool), fps, lambda _: distance)
    hand = PosedTrack("right", model, pose[None], joints[:, 0], betas, *measured)
    parts = [solid.only(part) for part in range(PARTS if bool(solid.jointed) else 1)]
    meshes = tuple(mesh_of_solid(part, spacing_for_looks(part)) for part in parts)
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
    width, height = cell + SHEET_GAP, cell + TEXT_HEIGHT
    corners = places(len(clips), SHEET_COLUMNS, width, height)
    bottom = corners[-1][1] + height
    canvas = Canvas(width * min(SHEET_COLUMNS, len(clips)) - SHEET_GAP, bottom + SCALE_HEIGHT)
    for clip, (left, top) in zip(steps(clips, on_step), corners, strict=True):
        scene = grasp_scene(clip)
        measures = scene.versions[0].measures
        (picture,) = draw(scene, 0, cameras(scene, DEFAULT_LOOK.upward)[0], cell)
        canvas.paste(picture, left, top)
        title = Path(scene.title).stem.replace("_", " ")
        canvas.write(title, left + 8, top + cell + 2)
        depth = measures.means()["penetration_max_mm"]
        words = f"{depth:.1f} mm deep, {int(measures.fingers)} tips"
        canvas.write(words, left + 8, top + cell + 19, colour=FAINT)
    canvas.draw_scale("penetration", bottom + 12)
    return canvas.picture()


def one_of_each_gesture(folder: Path) -> list[Gestures]:
    """The first clip of each gesture in a folder of shards, in the order of `NAMES`."""
    found: dict[int, Gestures] = {}
    kind = gesture_shards.DEFAULTS
    for path in [*find_shards(folder, "val", kind), *find_shards(folder, "train", kind)]:
        shard = gesture_shards.gesture_shard(path)
        for clip, number in enumerate(shard.gesture.amax(1).tolist()):
            if number not in found:
                found[number] = shard.take(slice(clip, clip + 1), "B")
        if len(found) == len(NAMES):
            break
    return [found[number] for number in sorted(found)]


def gesture_scene(clip: Gestures) -> Scene:
    """The middle frame of a clip as a scene."""
    at = torch.tensor([int(clip.length) // 2])
    motion, skeleton = clip.motion.take(0 * at, "B"), clip.skeleton
    still = motion[at]
    body, one = still.map(lambda value: value[0]), skeleton.map(lambda value: value[0])
    title = str(clip.joined[0, 0])
    recording = BodyRecording(body, one, torch.zeros(3), FPS, title)
    hands = Sequence(hand_tracks(one, body), ObjectTrack.resting((), 1), FPS, title)
    return make_scene({"clip": hands}, body=recording)


def gesture_sheet(clips: list[Gestures], *, on_step: OnStep | None = None) -> Picture:
    """One body per clip, close-ups of its hands beside it, and gesture and sentence below."""
    width, height = BODY_CELL + BODY_CELL // 2 + BODY_GAP, BODY_CELL + TEXT_HEIGHT
    corners = places(len(clips), BODY_COLUMNS, width, height)
    across = width * min(BODY_COLUMNS, len(clips)) - BODY_GAP
    canvas = Canvas(across, corners[-1][1] + height)
    for clip, (left, top) in zip(steps(clips, on_step), corners, strict=True):
        scene = gesture_scene(clip)
        camera = cameras(scene, Look(up=scene.up).upward)[0]
        (picture,) = draw(scene, 0, camera, BODY_CELL, "plain")
        canvas.paste(picture, left, top)
        hands = hands_from_near(scene, scene.versions[0], 0, camera, BODY_CELL // 2, "plain")
        for place, near in enumerate(hands):
            canvas.paste(near, left + BODY_CELL, top + place * (BODY_CELL // 2))
        names = {NAMES[number] for number in clip.gesture[0].tolist()} - {NAMES[0]}
        canvas.write(" + ".join(sorted(names)) or NAMES[0], left + 4, top + BODY_CELL + 2)
        sentence = str(clip.joined[0, -1])
        canvas.write(
            sentence[:SENTENCE_LENGTH], left + 4, top + BODY_CELL + 19, size=11, colour=FAINT
        )
    return canvas.picture()
