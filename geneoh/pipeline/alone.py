"""A hand without an object: what MotionDiff is shown, and what is measured of it.

MotionDiff sees every hand in a canonical frame, with the object's surface where there is one. Far
from any surface all that it reads of the object is zero, so that a hand alone is one more natural
case for it: the canonical frame stands still in the world, in the middle of the hand's own path.
"""

import math
from dataclasses import dataclass, fields

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from geneoh.baselines.filters import Filter, smooth
from geneoh.fitting.subject import Subject
from geneoh.fitting.terms import HandState
from geneoh.geometry.distance import MovingSurface
from geneoh.hand.model import ShapedHand
from geneoh.hand.skeleton import TIP_KEYPOINTS
from geneoh.metrics.contact import TOUCH
from geneoh.metrics.report import InteractionReport, measure_posed
from geneoh.metrics.smoothness import (
    acceleration,
    mean_over_frames,
    per_frame_squared,
    valid_differences,
)
from geneoh.objects.smoothing import noise_level
from geneoh.pipeline.context import StageContext
from geneoh.pipeline.touch import verts_of_fingers
from geneoh.representation.region import ContactRegion
from geneoh.sequence.keypoints import palm_axes

FAR = 1.0
"""Distance in metres at which nothing of a surface is seen: closeness decays over centimetres."""
QUIET, NOISY = 0.0015, 0.003
"""White noise of the fingertips per axis, metres: below the first the result stays as it is, above
the second it is smoothed. Recorded hands have 0.0012."""
SMOOTHING = Filter("gaussian", 1.0)
"""The filter that takes out what jitter the samples leave; its size is in frames."""
STILL, SHAKY = 0.0006, 0.0012
"""White noise that samples against an object leave in the fingertips, metres: above the second it
is smoothed. Those of hands that hold have up to 0.0004."""
SMOOTHING_FAST = Filter("savgol", 7.0)
"""The filter for them, which keeps the hand's own motion up to three times a second."""


@dataclass(frozen=True)
class HandAlone(StageContext):
    """The context of a hand without an object."""

    def region(self, joints: Float[Tensor, "S T 21 3"]) -> ContactRegion:
        """The canonical frame of each window, without contact points."""
        windows = self.windows(joints)
        none = windows[:, :, :0]
        axes = self.rotation[0, 0].expand(*windows.shape[:2], 3, 3)
        middle = windows.mean((1, 2))[:, None].expand(*windows.shape[:2], 3)
        return ContactRegion(none, none, axes, middle)

    def nearest_surface(
        self, joints: Float[Tensor, "T 21 3"]
    ) -> tuple[Float[Tensor, "T 21 3"], Float[Tensor, "T 21 3"]]:
        """A surface too far away to be seen."""
        up = joints.new_tensor([0.0, 0.0, 1.0]).expand_as(joints)
        return joints + FAR * up, -up


def hand_alone(subject: Subject, fps: float) -> HandAlone:
    """The context of a hand in a frame that stands still in the world.

    Its axes are those of the mean palm, so that a scene may lie in any way.
    """
    joints = subject.joints
    axes, middle = palm_axes(joints[None])[0], joints.mean((0, 1))
    return HandAlone(
        points=joints.new_zeros(0, 3),
        normals=joints.new_zeros(0, 3),
        part=torch.zeros(0, dtype=torch.long, device=joints.device),
        rotation=axes.expand(len(joints), 1, 3, 3),
        translation=middle.expand(len(joints), 1, 3),
        trust=subject.trust,
        fps=fps,
    )


def without_jitter(
    samples: Float[Tensor, "S T 21 3"], observed: Float[Tensor, "T 21 3"], fps: float
) -> Float[Tensor, "S T 21 3"]:
    """Samples of a hand alone, smoothed by as much as the observed hand is noisy.

    Each window of the networks has its own view of the noise, and no contact holds the hand: what
    jitter is left is taken out where the input has white noise, and quiet inputs keep their motion.
    """
    share = share_of_jitter(observed, QUIET, NOISY)
    return samples + share * (_smoothed(samples, SMOOTHING, fps) - samples)


def without_jitter_at(
    context: StageContext,
    samples: Float[Tensor, "S T 21 3"],
    observed: Float[Tensor, "T 21 3"],
) -> Float[Tensor, "S T 21 3"]:
    """Samples against an object, without the jitter that they share with the observed hand.

    MotionDiff has learned from hands that hold, and leaves half of the noise of one that moves fast
    over its object, such as on a table that it wipes. It is taken out as the object sees it, where
    a hand that holds rests, however fast both are.
    """
    turn, place = context.rotation[:, 0], context.translation[:, 0, None]
    local, given = (samples - place) @ turn, (observed - place) @ turn
    noisy = share_of_jitter(given, QUIET, NOISY)
    left = [share_of_jitter(each, STILL, SHAKY) for each in context.cut(local.mean(0), 0)]
    if not noisy or not any(left):
        return samples
    share = context.blend(samples.new_tensor(left)[:, None, None].expand(-1, context.size, 1))
    change = _smoothed(local, SMOOTHING_FAST, context.fps) - local
    return samples + noisy * share[0, :, None] * change @ turn.mT


def share_of_jitter(joints: Float[Tensor, "T 21 3"], quiet: float, noisy: float) -> float:
    """0 where the white noise of the fingertips is `quiet`, metres per axis, 1 where `noisy`."""
    if len(joints) < 5:
        return 0.0
    noise = noise_level(joints[:, list(TIP_KEYPOINTS)].cpu().double().numpy())
    return min(max((noise - quiet) / (noisy - quiet), 0.0), 1.0)


def _smoothed(
    samples: Float[Tensor, "S T 21 3"], by: Filter, fps: float
) -> Float[Tensor, "S T 21 3"]:
    return smooth(samples.movedim(1, 0), by, fps).movedim(0, 1)


def measure_hand(
    state: HandState,
    shaped: ShapedHand,
    joints: Float[Tensor, "T 21 3"],
    surface: MovingSurface | None,
    fps: float,
    valid: Bool[Tensor, " T"],
    *,
    within: float = TOUCH,
) -> tuple[InteractionReport, Float[Tensor, "T 5"] | None]:
    """The report of a hand and its object over the valid frames, and how far each finger's skin is
    off in all frames, metres.

    Distances are exact up to `within`. Without an object the report has NaN for all but frames and
    acceleration.
    """

    def verts_of(frames: slice) -> Float[Tensor, "N V 3"]:
        return shaped.verts_from_rotations(state.rotations[0, frames], state.wrist[0, frames]).verts

    if surface is not None:
        model = shaped.model
        return measure_posed(
            *(verts_of, joints, surface, fps, valid),
            faces=model.faces,
            groups=verts_of_fingers(model),
            within=within,
        )
    bends = per_frame_squared(acceleration(joints, fps), fps)
    nothing = {
        field.name: math.nan for field in fields(InteractionReport) if field.name != "frames"
    }
    mean = float(mean_over_frames(bends, valid_differences(valid, 2)))
    return InteractionReport(int(valid.sum()), **{**nothing, "acceleration_mm": mean}), None
