"""Bodies that move, and tiny networks of BOTH2Hands, for tests."""

import torch

from geneoh.body.motion import BodyMotion
from geneoh.body.skeleton import embedded_skeleton
from geneoh.generators.both2hands.library import Both2HandsNetworks
from geneoh.generators.both2hands.networks import (
    BlendConfig,
    Blender,
    BodyHands,
    HandsConfig,
    TextHands,
    TextHandsConfig,
)
from geneoh.generators.text import SentenceConfig
from geneoh.geometry.rotations import axis_angle_to_matrix

SKELETON = embedded_skeleton()
SMALL = {"width": 16, "depth": 2, "heads": 2, "head_width": 8}
WORDS = SentenceConfig(pieces=40, piece_width=8, width=16, heads=2, longest=8)


def made_motion(bodies: int = 2, frames: int = 20, seed: int = 0) -> BodyMotion:
    """Bodies whose joints turn smoothly about random axes while they walk away."""
    generator = torch.Generator().manual_seed(seed)
    time = torch.linspace(0, 1, frames)[:, None, None]
    axes = torch.randn(bodies, 1, 52, 3, generator=generator)
    phase = torch.rand(bodies, 1, 52, 1, generator=generator)
    vectors = 0.4 * axes * (6 * (time + phase)).sin()
    root = torch.stack([3 * time[:, 0, 0], 0.9 + 0 * time[:, 0, 0], 2 * time[:, 0, 0]], dim=-1)
    return BodyMotion(root.expand(bodies, -1, -1) + 5.0, axis_angle_to_matrix(vectors))


def speech(sentences) -> torch.Tensor:
    """A number for each of the first words, by its letters."""
    rows = [[2 + sum(map(ord, word)) % 38 for word in each.split()[:8]] for each in sentences]
    longest = max(map(len, rows))
    return torch.tensor([row + [0] * (longest - len(row)) for row in rows])


def tiny_networks(form: str = "ours", seed: int = 0) -> Both2HandsNetworks:
    """Random networks of either form."""
    torch.manual_seed(seed)
    paper = form == "paper"
    size = SMALL | {"form": form} | ({"frames_per_token": 1} if paper else {})
    frame = {"frame": "world", "scaling": "range"} if paper else {}
    body = BodyHands(HandsConfig(**size, **frame))
    text = TextHands(TextHandsConfig(**size, words=WORDS))
    blend = Blender(BlendConfig(**size))
    torch.nn.init.normal_(blend.leave.weight, std=0.05)
    parts = (each.eval().requires_grad_(False) for each in (body, text, blend))
    return Both2HandsNetworks(*(next(parts), next(parts), speech, next(parts)))
