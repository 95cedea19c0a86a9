"""A contact sheet of made actions: six frames of one clip per verb, seen from one place.

python -m tools.action_sheet DATA OUT.png [--split val] [--clip N]
"""

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.choices import SIDES
from geneoh.evaluation.generation.measures import PosedActions, posed_actions
from geneoh.geometry.mesh import Mesh
from geneoh.geometry.oriented_points import signed_to_points
from geneoh.hand.library import load_hand
from geneoh.sequence.sequence import ObjectTrack
from geneoh.streamed import Streamed
from geneoh.synthesis.action_shards import read_actions
from geneoh.synthesis.actions.action import FPS, VERBS, Actions
from geneoh.viz.camera import Camera, axes_towards
from geneoh.viz.canvas import CAPTION_HEIGHT, FAINT, Canvas, png_bytes
from geneoh.viz.picture import Picture
from geneoh.viz.posed_track import PosedTrack
from geneoh.viz.scene import Scene, Version, with_parts_behind

FRAMES = 6  # of a clip, the first and the last among them
CELL = 230  # side of one picture, pixels
WORDS = 130  # width of the words before the pictures, pixels
ELEVATION = 0.45  # of the camera above the table, radians
SPACING, WIDTH, LINES = 0.05, 0.0015, 8
"""Lines on the table: spacing and half of their width, metres; number to either side."""
WITHIN = 0.03  # distance from the object beyond which it is not measured, metres
CORNERS = 6  # of the plate that is drawn at each point of a surface


def contact_sheet(actions: Actions, names: Sequence[str]) -> Picture:
    """A row of frames for each action, with its verb, its object and its hands before them."""
    row = CELL + CAPTION_HEIGHT
    canvas = Canvas(WORDS + CELL * FRAMES, row * len(actions.verb))
    for index in range(len(actions.verb)):
        clip = actions.take(slice(index, index + 1), "B")
        hands = [side for side, there in zip(SIDES, clip.hands[0], strict=True) if there]
        name = names[int(clip.name)].replace("_", " ")
        words = (VERBS[int(clip.verb)], name, " and ".join(hands), f"{int(clip.length)} frames")
        for line, text in enumerate(words):
            colour = {} if line == 0 else {"colour": FAINT}
            canvas.write(
                text[:20], 8, index * row + 20 + 22 * line, size=15 - 2 * (line > 0), **colour
            )
        paste_frames(canvas, action_scene(clip), fixed_camera(clip), int(clip.length), index * row)
    return canvas.picture()


def paste_frames(canvas: Canvas, scene: Scene, camera: Camera, length: int, top: int) -> None:
    """A row of pictures of the first `length` frames, evenly apart, behind the words."""
    for column in range(FRAMES):
        frame = round(column * (length - 1) / (FRAMES - 1))
        corner = (WORDS + CELL * column, top)
        canvas.paste_versions(scene, frame, camera, [corner], "penetration", CELL)


def action_scene(clip: Actions) -> Scene:
    """One action on a table with lines; its object is drawn as a plate at each of its points."""
    posed = posed_actions(clip)
    rotation, translation = clip.part_poses()
    parts = [clip.part[0] == part for part in range(2)]
    there = [index for index, part in enumerate(parts) if part.any()]
    meshes = (plates(clip.points[0, parts[n]], clip.normals[0, parts[n]]) for n in there)
    track = ObjectTrack(tuple(meshes), rotation[0][:, there], translation[0][:, there])
    hands = tuple(posed_track(clip, posed, side) for side in range(2) if clip.hands[0, side])
    return on_table(Scene("", (Version("", hands),), track, FPS, {}))


def on_table(scene: Scene) -> Scene:
    """The same scene with lines on the table."""
    lines = ObjectTrack.resting((table(),), scene.frames)
    return replace(scene, object=with_parts_behind(scene.object, lines))


def posed_track(clip: Actions, posed: PosedActions, side: int) -> PosedTrack:
    """One hand with its distance to the points of the object."""
    skin, joints, surface = posed.skin[0, side], posed.joints[0, side], posed.surface
    distance, _ = signed_to_points(skin, surface.points[0], surface.normals[0], within=WITHIN)
    distance = distance.clamp(max=WITHIN)
    there = torch.ones(len(skin), dtype=torch.bool)
    parameters = (clip.pose[0, side], clip.wrist[0, side], torch.zeros(10))
    model = load_hand(SIDES[side])
    return PosedTrack(SIDES[side], model, *parameters, skin, joints, there, FPS, lambda _: distance)


def plates(points: Float[Tensor, "P 3"], normals: Float[Tensor, "P 3"]) -> Mesh:
    """A surface of small plates, one at each point, as large as the points are apart."""
    if len(points) < 2:
        return Mesh(points, torch.zeros(0, 3, dtype=torch.long))
    nearest = torch.cdist(points, points).topk(min(5, len(points)), largest=False).values[:, -1]
    least = torch.nn.functional.one_hot(normals.abs().argmin(-1), 3).to(normals)
    aside = torch.nn.functional.normalize(torch.linalg.cross(normals, least), dim=-1)
    across = torch.linalg.cross(normals, aside)
    angle = 2 * torch.pi * torch.arange(CORNERS) / CORNERS
    rim = aside[:, None] * angle.cos()[:, None] + across[:, None] * angle.sin()[:, None]
    verts = points[:, None] + nearest[:, None, None] * rim
    fan = torch.tensor([[0, k, k + 1] for k in range(1, CORNERS - 1)])
    faces = fan + CORNERS * torch.arange(len(points))[:, None, None]
    return Mesh(verts.flatten(0, 1), faces.flatten(0, 1))


def table() -> Mesh:
    """Lines in both directions at z = 0."""
    reach = LINES * SPACING
    corners = torch.tensor([[-reach, -WIDTH], [reach, -WIDTH], [reach, WIDTH], [-reach, WIDTH]])
    aside = SPACING * torch.arange(-LINES, LINES + 1)[:, None, None] * torch.tensor([0.0, 1.0])
    along = corners + aside
    verts = torch.cat([along, along.flip(-1)]).flatten(0, 1)
    faces = torch.tensor([[0, 1, 2], [0, 2, 3]]) + 4 * torch.arange(2 * len(along))[:, None, None]
    return Mesh(torch.cat([verts, torch.zeros_like(verts[:, :1])], -1), faces.flatten(0, 1))


def fixed_camera(clip: Actions) -> Camera:
    """A camera on one action, with the object and hands in sight."""
    frames = slice(int(clip.length))
    posed = posed_actions(clip)
    seen = [posed.surface.points[0, frames].flatten(0, 1)]
    seen += [posed.joints[0, n, frames].flatten(0, 1) for n in range(2) if clip.hands[0, n]]
    return camera_on(torch.cat(seen), clip.translation[0, frames])


def camera_on(points: Float[Tensor, "N 3"], path: Float[Tensor, "T 3"]) -> Camera:
    """A camera that does not move, across the path of the object, with all points in sight."""
    seen, way = points.numpy(), (path - path[0]).numpy()
    along = way[np.linalg.norm(way[:, :2], axis=-1).argmax(), :2]
    level = np.array([along[1], -along[0]]) if np.linalg.norm(along) > 0.02 else np.array([0.4, -1])
    level = level / np.linalg.norm(level)
    back = np.array([*(np.cos(ELEVATION) * level), np.sin(ELEVATION)])
    target = (seen.min(0) + seen.max(0)) / 2
    radius = float(np.linalg.norm(seen - target, axis=-1).max())
    return Camera(axes_towards(back, np.eye(3)[2]), target, radius)


def one_per_verb(actions: Streamed[Actions], which: int) -> Actions:
    """The clip of this number of each verb, or its last one; verbs without any are left out."""
    verbs = actions.each(lambda shard: shard.verb)
    found = [torch.nonzero(verbs == verb)[:, 0] for verb in range(len(VERBS))]
    chosen = [int(each[min(which, len(each) - 1)]) for each in found if len(each)]
    return actions.take(torch.tensor(chosen))


def main() -> None:
    """Read the shards, draw the sheet, say what it shows."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", type=Path)
    parser.add_argument("output", type=Path)
    parser.add_argument("--split", default="train")
    parser.add_argument("--clip", type=int, default=0)
    args = parser.parse_args()
    actions, names = read_actions(args.data, args.split)
    chosen = one_per_verb(actions, args.clip)
    args.output.write_bytes(png_bytes(contact_sheet(chosen, names)))
    print(f"wrote {len(chosen.verb)} of {len(VERBS)} verbs to {args.output}")


if __name__ == "__main__":
    main()
