"""Filmstrips of hands that `geneoh generate --body` makes for three bodies it has not seen.

python -m tools.body_sheet OUT.png [--seed 0] [--weights FOLDER]

Gestures and sentences were chosen before any of them was looked at; the variants of the gestures
and the proportions of the bodies are those that the networks never learned from.
"""

import argparse
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from PIL import Image

from geneoh.body.motion import BodyMotion
from geneoh.body.skeleton import Skeleton
from geneoh.generators.both2hands.on_body import BodyOptions, BodyWithHands, generate_on_body
from geneoh.readers.bodies.base import BodyRecording
from geneoh.synthesis.gestures.clips import NAMES
from geneoh.synthesis.gestures.shards import GestureConfig
from geneoh.synthesis.gestures.synthesis import gesturing
from geneoh.synthesis.gestures.variation import VARIANTS
from geneoh.viz.camera import cameras
from geneoh.viz.canvas import FAINT, Canvas
from geneoh.viz.look import Look
from geneoh.viz.picture import draw, hands_from_near
from geneoh.viz.scene import Scene, make_scene

CHOSEN = (
    ("rest", "wave", "the right hand waves, the left hand rests"),
    ("clap", "clap", "both hands clap"),
    ("type", "type", "both hands type on a keyboard"),
)
"""Gestures of the left and the right hand of a body, and the sentence that describes them."""
FRAMES, CELL, CLOSE, WORDS = 5, 260, 130, 30


def body_of(left: str, right: str, seed: int) -> BodyRecording:
    """A held-out body whose hands make held-out variants of gestures."""
    config, generator = GestureConfig(), torch.Generator().manual_seed(seed)
    variants = [(right, n) for n in range(VARIANTS - config.held_out, VARIANTS)]
    together = 1.0 if left == right else 0.0
    shares = replace(config.body.shares, together=together, mirrored=0.0, idle=0.0, both=0.0)
    setting, person = replace(config.body, shares=shares), config.bodies("val")[seed]
    wanted = [NAMES.index(left), NAMES.index(right)]
    while True:  # until each hand makes the wanted gesture
        clips = gesturing(variants, [person], config.frames, setting, generator=generator)
        if clips.gesture[0].tolist() == wanted:
            break
    length, motion = int(clips.length[0]), clips.motion
    return BodyRecording(
        BodyMotion(motion.root[0, :length], motion.rotations[0, :length]),
        Skeleton(clips.offsets[0]),
        torch.zeros(3),
        30.0,
        right,
    )


def row_of(canvas: Canvas, top: int, scene: Scene, made: BodyWithHands, seconds: float) -> None:
    """A sentence, frames of the body, and its hands from near below each."""
    words = f"{seconds:.1f} s for {scene.frames} frames"
    canvas.write(made.sentence, 12, top + 6, size=16)
    canvas.write(words, CELL * FRAMES - 190, top + 8, colour=FAINT)
    seen = cameras(scene, Look(up=scene.up).upward)
    for column in range(FRAMES):
        frame = int((column + 0.5) * scene.frames / FRAMES)
        (picture,) = draw(scene, frame, seen[frame], CELL, "plain")
        canvas.paste(picture, column * CELL, top + WORDS)
        hands = hands_from_near(scene, scene.versions[0], frame, seen[frame], CLOSE, "plain")
        for place, near in enumerate(hands):
            canvas.paste(near, column * CELL + place * CLOSE, top + WORDS + CELL)


def main() -> None:
    """Make the hands, draw them, and print how long each took."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--weights", type=Path)
    args = parser.parse_args()
    height = WORDS + CELL + CLOSE
    canvas = Canvas(CELL * FRAMES, height * len(CHOSEN))
    for index, (left, right, sentence) in enumerate(CHOSEN):
        body = body_of(left, right, args.seed + index)
        start = time.perf_counter()
        made = generate_on_body(sentence, body, BodyOptions(weights=args.weights, seed=args.seed))
        seconds = time.perf_counter() - start
        scene = make_scene({sentence: made.sequence}, body=made.body)
        row_of(canvas, index * height, scene, made, seconds)
        print(f"{sentence}: {body.frames} frames in {seconds:.1f} s")
    Image.fromarray(np.ascontiguousarray(canvas.picture())).save(args.out, optimize=True)


if __name__ == "__main__":
    main()
