"""A contact sheet of bodies that gesture: one clip of each gesture, with both hands from near."""

from collections.abc import Iterator
from pathlib import Path

import torch

from geneoh.progress import OnStep, steps
from geneoh.readers.bodies.base import BodyRecording
from geneoh.sequence.body_hands import hand_tracks
from geneoh.sequence.sequence import ObjectTrack, Sequence
from geneoh.synthesis.actions import FPS
from geneoh.synthesis.gestures.clips import NAMES, Gestures
from geneoh.synthesis.gestures.shards import DEFAULTS, gesture_shard
from geneoh.synthesis.shards import find_shards
from geneoh.viz.camera import Camera, cameras
from geneoh.viz.canvas import FAINT, Canvas
from geneoh.viz.look import Look
from geneoh.viz.picture import Picture, draw
from geneoh.viz.scene import Scene, make_scene
from geneoh.viz.sheet import contact_sheet, one_of_each

COLUMNS = 9
CELL = 180  # side of the picture of a body, pixels; those of hands have half of it
GAP, TEXT_HEIGHT = 12, 40  # between two clips, and of the two lines below each, pixels
NEAR_RADIUS = 0.13  # of a picture of one hand, metres
LONGEST = 32  # letters of a sentence that are shown


def one_of_each_gesture(folder: Path) -> list[Gestures]:
    """The first clip of everything that hands do in a folder of shards, in the order of `NAMES`."""
    found: dict[int, Gestures] = {}
    for path in [*find_shards(folder, "val", DEFAULTS), *find_shards(folder, "train", DEFAULTS)]:
        shard = gesture_shard(path)
        for clip, number in enumerate(shard.gesture.amax(1).tolist()):
            if number not in found:
                found[number] = shard.take(slice(clip, clip + 1), "B")
        if len(found) == len(NAMES):
            break
    return [found[number] for number in sorted(found)]


def sheet_of(kind: str, folder: Path, on_step: OnStep | None = None) -> Picture:
    """The contact sheet of a folder of shards of bodies, or of interactions."""
    if kind == "bodies":
        return gesture_sheet(one_of_each_gesture(folder), on_step=on_step)
    return contact_sheet(one_of_each(folder), on_step=on_step)


def gesture_scene(clip: Gestures) -> Scene:
    """A clip in its middle frame."""
    at = torch.tensor([int(clip.length) // 2])
    motion, skeleton = clip.motion.take(0 * at, "B"), clip.skeleton
    still = motion[at]
    body, one = still.map(lambda value: value[0]), skeleton.map(lambda value: value[0])
    title = str(clip.joined[0, 0])
    recording = BodyRecording(body, one, torch.zeros(3), FPS, title)
    hands = Sequence(hand_tracks(one, body), ObjectTrack.resting((), 1), FPS, title)
    return make_scene({"clip": hands}, body=recording)


def hands_from_near(scene: Scene, frame: int, camera: Camera, side: int) -> Iterator[Picture]:
    """A square picture of each hand, `side` pixels wide; the right hand comes first."""
    for hand in reversed(scene.versions[0].hands):
        near = Camera(camera.axes, hand.joints[frame].mean(0).numpy(), NEAR_RADIUS)
        yield from draw(scene, frame, near, side, "plain")


def gesture_sheet(clips: list[Gestures], *, on_step: OnStep | None = None) -> Picture:
    """One body per clip, its right and its left hand beside it, and what is said of them below."""
    columns = min(COLUMNS, len(clips))
    rows = -(-len(clips) // columns)
    width, height = CELL + CELL // 2 + GAP, CELL + TEXT_HEIGHT
    canvas = Canvas(width * columns - GAP, height * rows)
    for index, clip in enumerate(steps(clips, on_step)):
        scene = gesture_scene(clip)
        left, top = index % columns * width, index // columns * height
        camera = cameras(scene, Look(up=scene.up).upward)[0]
        (picture,) = draw(scene, 0, camera, CELL, "plain")
        canvas.paste(picture, left, top)
        for place, near in enumerate(hands_from_near(scene, 0, camera, CELL // 2)):
            canvas.paste(near, left + CELL, top + place * (CELL // 2))
        names = {NAMES[number] for number in clip.gesture[0].tolist()} - {NAMES[0]}
        canvas.write(" + ".join(sorted(names)) or NAMES[0], left + 4, top + CELL + 2)
        said = str(clip.joined[0, -1])
        canvas.write(said[:LONGEST], left + 4, top + CELL + 19, size=11, colour=FAINT)
    return canvas.picture()
