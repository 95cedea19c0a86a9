"""The bodies that BOTH2Hands makes hands for, and a denoising step of both networks on them."""

from dataclasses import dataclass

from jaxtyping import Float
from torch import Tensor

from geneoh.body.motion import BodyMotion, PosedBody, pose
from geneoh.body.skeleton import Skeleton
from geneoh.bundle import Bundle
from geneoh.generators.both2hands.denoiser import BodyHands, EncodedBody, TextHands
from geneoh.generators.both2hands.features import (
    HandsFrame,
    body_features,
    hand_features,
    with_fingers,
)


@dataclass(frozen=True)
class PlacedBodies(Bundle):
    """B windows of bodies, placed as the networks see them."""

    skeleton: Skeleton
    motion: BodyMotion
    posed: PosedBody

    @staticmethod
    def of(skeleton: Skeleton, motion: BodyMotion) -> "PlacedBodies":
        """The joints of bodies after `features.placed`, each body with its own skeleton."""
        return PlacedBodies(skeleton, motion, pose(skeleton, motion))

    @property
    def body(self) -> Float[Tensor, "B T 198"]:
        """Features of the bodies."""
        return body_features(self.posed)

    def projected(
        self, local: Float[Tensor, "B T 270"], frame: HandsFrame
    ) -> Float[Tensor, "B T 270"]:
        """Features of hands in their wrists' frames, put onto the bodies (paper, equation 8).

        Forward kinematics of body and fingers starts at the root's position in the world, which the
        paper's code leaves out.
        """
        motion = with_fingers(self.motion, self.posed, local, "wrist")
        return hand_features(pose(self.skeleton, motion), frame)


def hands_of_text(
    body: BodyHands, text: TextHands, answer: Float[Tensor, "B T 270"], scene: PlacedBodies
) -> Float[Tensor, "B T 270"]:
    """A prediction of the text network put onto the bodies, normalised as in the body's network."""
    local = text.scale.denormalise(answer)
    return body.scale.normalise(scene.projected(local, body.config.frame))


def both_answers(
    body: BodyHands,
    text: TextHands,
    noisy: tuple[Float[Tensor, "B T 270"], Float[Tensor, "B T 270"]],
    level: Float[Tensor, " B"],
    conditions: tuple[EncodedBody, EncodedBody],
    scene: PlacedBodies,
) -> tuple[Float[Tensor, "B T 270"], Float[Tensor, "B T 270"]]:
    """Clean hands predicted by both networks, both normalised as in the body's network.

    `noisy` are the noisy hands for the body's and for the text network, equal if both networks
    share one reverse process.
    """
    of_body = body.denoised(noisy[0], level, conditions[0])
    of_text = text.denoised(noisy[1], level, conditions[1])
    return of_body, hands_of_text(body, text, of_text, scene)
