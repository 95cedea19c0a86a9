"""Filmstrips and measures of what `geneoh generate` makes of eight sentences, on unseen meshes.

python -m tools.prompt_sheet OUT.png [--seed 0] [--refine geneoh] [--weights FOLDER] [--objects DIR]

The sentences and meshes were chosen before any of them was looked at; the meshes are those that the
networks never learned from.
"""

import argparse
import time
from pathlib import Path
from textwrap import wrap

import numpy as np
import torch
from jaxtyping import Float
from PIL import Image
from torch import Tensor

from geneoh.generators.text2hoi.generate import GenerateOptions, generate
from geneoh.geometry.mesh_files import load_mesh
from geneoh.metrics.realism import SurfacePoints, moved_alone
from geneoh.viz.canvas import CAPTION_HEIGHT, FAINT, Canvas
from geneoh.viz.scene import Scene, make_scene
from tools.action_sheet import CELL, FRAMES, WORDS, camera_on, on_table, paste_frames

PROMPTS = (
    ("lift the mug with the left hand", "ycb_025_mug"),
    ("pour from the bottle with the right hand", "ycb_022_windex_bottle"),
    ("carry the banana with the right hand", "ycb_011_banana"),
    ("shake the toy train with the left hand", "gso_toy_train"),
    ("inspect the dinosaur with both hands", "gso_dinosaur_figure"),
    ("rotate the bowl with both hands", "ycb_024_bowl"),
    ("press the mouse with the right hand", "gso_black_razer_mouse"),
    ("pass the flashlight from the right hand to the left hand", "gso_red_and_white_flashlight"),
)
"""Sentences with the meshes in examples/objects that they are for."""
LINES = "sentence | seconds | frames | depth, mm | deepest, mm | moved alone, % | at rest, mm/frame"


def points_of(scene: Scene, step: int) -> Float[Tensor, "T P 3"]:
    """Every `step`-th vertex of the object's first mesh in the world."""
    motion = scene.object
    verts = motion.meshes[0].verts[::step]
    return verts @ motion.rotation[:, 0].mT + motion.translation[:, 0, None]


def measured(scene: Scene, seconds: float) -> str:
    """The measures of an interaction as a line of a table, in the order of `LINES`.

    It was made in `seconds` from sentence and mesh in memory. Depth is that of the deepest vertex,
    as a mean over frames and hands; "moved alone" is the share of the object's moving frames in
    which no keypoint is within 2 cm of it; "at rest" is the largest speed of wrists and object in
    the first and the last frame.
    """
    hands, frames = scene.hands, scene.frames
    depth = torch.stack([hand.measures.depth.clamp(min=0) for hand in hands])
    points = points_of(scene, max(1, len(scene.object.meshes[0].verts) // 2048))
    surface = SurfacePoints(points[None], torch.zeros_like(points)[None], torch.tensor([frames]))
    joints = torch.cat([hand.joints for hand in hands], 1)[None]
    alone = float(moved_alone(joints, surface).nan_to_num())
    paths = [hand.joints[:, 0] for hand in hands] + [scene.object.translation[:, 0]]
    speeds = [path[[1, -1]] - path[[0, -2]] for path in paths]
    rest = float(torch.stack(speeds).norm(dim=-1).max())
    cells = (
        scene.title,
        f"{seconds:.1f}",
        f"{frames}",
        f"{1000 * float(depth.mean()):.1f}",
        f"{1000 * float(depth.max()):.1f}",
        f"{100 * alone:.0f}",
        f"{1000 * rest:.1f}",
    )
    return " | ".join(cells)


def prompt_sheet(scenes: list[Scene]) -> np.ndarray:
    """A row of frames for each sentence, with the sentence in front of them."""
    height = CELL + CAPTION_HEIGHT
    canvas = Canvas(WORDS + CELL * FRAMES, height * len(scenes))
    for index, scene in enumerate(scenes):
        lines = wrap(scene.title, 16, break_long_words=False)
        for line, words in enumerate(lines):
            canvas.write(words, 8, index * height + 20 + 20 * line, size=14)
        seconds = f"{scene.frames / scene.fps:.1f} s"
        canvas.write(seconds, 8, index * height + 26 + 20 * len(lines), size=13, colour=FAINT)
        points = [points_of(scene, 4), *(hand.joints for hand in scene.hands)]
        seen = torch.cat([each.flatten(0, 1) for each in points])
        camera = camera_on(seen, scene.object.translation[:, 0])
        paste_frames(canvas, on_table(scene), camera, scene.frames, index * height)
    return canvas.picture()


def main() -> None:
    """Make the clips, print their measures, draw the sheet."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("output", type=Path)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--refine", default="geneoh")
    parser.add_argument("--weights", type=Path)
    parser.add_argument("--objects", type=Path, default=Path("examples/objects"))
    args = parser.parse_args()
    options = GenerateOptions(seed=args.seed, refine=args.refine, weights=args.weights)
    scenes = []
    print(LINES)
    for sentence, name in PROMPTS:
        mesh = load_mesh(args.objects / f"{name}.ply")
        began = time.monotonic()
        made = generate(sentence, mesh, options)
        seconds = time.monotonic() - began
        scenes.append(make_scene({sentence: made.sequence}))
        print(measured(scenes[-1], seconds), flush=True)
    # 128 colours take a third of the bytes
    Image.fromarray(prompt_sheet(scenes)).quantize(128).save(args.output, optimize=True)


if __name__ == "__main__":
    main()
