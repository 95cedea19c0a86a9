"""Hand parameters from landmarks in a camera's picture.

Monocular trackers such as MediaPipe give the places of keypoints in the picture, and the hand's
shape relative to its own centre, with bones that change from frame to frame. A hand of fixed bones
that has this shape and is seen at these places lies at one distance from the camera.
"""

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from geneoh.bundle import concatenated
from geneoh.fitting.fit import OVERLAP, RIGID, minimise, start_from_keypoints
from geneoh.fitting.terms import (
    UNKNOWNS,
    Equations,
    HandState,
    MovingKeypoints,
    moving_keypoints,
    normal_equations,
    pose_term,
)
from geneoh.geometry.rotations import shortest_turn
from geneoh.hand.model import ShapedHand
from geneoh.sequence.gaps import observed_around
from geneoh.sequence.windows import blocks, widened

PICTURE_STD = 0.006
"""Standard deviation of a keypoint across its ray through the picture, metres at the hand."""
SHAPE_STD = 0.03
"""Standard deviation of a keypoint's place relative to the hand's centre, metres."""
PRIOR, LIMIT = 0.3, 20.0
"""Weights of the pose prior and of overshooting a joint limit, 1/rad; see `pose_term`."""
TURN_STD, BEND_STD = 0.1, 0.12
"""Standard deviation of the change of the wrist's and of a finger joint's rotation from frame to
frame, radians."""
STEP_STD = 0.02
"""Standard deviation of the change of the wrist's position from frame to frame, metres."""
UNSEEN = 0.01
"""Weight of the interpolated keypoints of a frame without a hand, in units of those of others: none
at all would leave the equations of the first and the last frames without a unique solution."""
DEPTH_LIMITS = (0.05, 20.0)
"""Limits of the hand's distance from the camera at the start, metres."""
ROUNDS, STEPS = 6, 6
"""Rounds, of which each weights the keypoints anew by their residuals, and steps of each."""


def hand_before_camera(
    image: Float[Tensor, "T 21 2"],
    shape: Float[Tensor, "T 21 3"],
    seen: Bool[Tensor, " T"],
    shaped: ShapedHand,
) -> HandState:
    """One sample of a hand's parameters in the frame of the camera that saw it.

    Args:
        image: keypoints on the plane one metre before the camera (x right, y down, z forward).
        shape: keypoints relative to any point, in metres and along the same axes for a hand in the
            middle of the picture; their size does not count.
        seen: frames with a hand, at least one; the others are interpolated.
        shaped: the hand, whose size gives the distance from the camera.
    """
    around = observed_around(seen)
    # in float64, because frames of wild keypoints have hardly any weight
    image, shape = around.points(image).double(), around.points(shape).double()
    shaped = shaped.map(lambda value: value.double() if value.is_floating_point() else value)
    size = palm_size(shaped.rest_keypoints()) / palm_size(shape).clamp(min=1e-6)
    shape = shape @ turns_to_rays(image).mT * size[:, None, None]
    found = []
    for block in blocks(len(seen)):
        wide, inner = widened(block, OVERLAP, len(seen))
        found.append(_fit_frames(image[wide], shape[wide], seen[wide], shaped)[inner])
    return concatenated(found).map(torch.Tensor.float)


def _fit_frames(
    image: Float[Tensor, "T 21 2"],
    shape: Float[Tensor, "T 21 3"],
    seen: Bool[Tensor, " T"],
    shaped: ShapedHand,
) -> HandState:
    """`hand_before_camera` on all frames at once; `shape` is as large as the hand, and turned."""
    state = start_before_camera(image, shape, shaped)
    trust = torch.where(seen, 1.0, UNSEEN).to(image)[None, :, None]
    coupling = image.new_full((UNKNOWNS,), 1 / BEND_STD)
    coupling[:3], coupling[48:] = 1 / TURN_STD, 1 / STEP_STD
    damping = image.new_full((1, 1), 1e-2)
    for _ in range(ROUNDS):
        now = state.joints(shaped)
        per_metre = now[..., 2] / PICTURE_STD
        off = (now[..., :2] / now[..., 2:] - image) * per_metre[..., None]
        bent = (centred(now) - centred(shape)) / SHAPE_STD
        placed = trust * robust_weight(off) * per_metre
        formed = trust * robust_weight(bent) / SHAPE_STD

        def equations(at: HandState, placed: Tensor = placed, formed: Tensor = formed) -> Equations:
            keypoints = moving_keypoints(at, shaped)
            found = picture_term(keypoints, image, placed) + shape_term(keypoints, shape, formed)
            return found + pose_term(at, shaped.model, PRIOR, LIMIT)

        state, damping = minimise(state, equations, coupling, damping, steps=STEPS)
    return state


def start_before_camera(
    image: Float[Tensor, "T 21 2"], shape: Float[Tensor, "T 21 3"], shaped: ShapedHand
) -> HandState:
    """A relaxed hand with the palm of `shape`, as large as in the picture."""
    start = start_from_keypoints(shape[None], shaped)
    points = start.joints(shaped)[0]
    depth = depth_by_size(image, points).clamp(*DEPTH_LIMITS)[:, None]
    middle = torch.cat([image.mean(1), torch.ones_like(depth)], -1) * depth
    return HandState(start.rotations, start.wrist + (middle - points.mean(1))[None])


def depth_by_size(
    image: Float[Tensor, "T 21 2"], points: Float[Tensor, "T 21 3"]
) -> Float[Tensor, " T"]:
    """Depth in metres at which points look as large as in the picture."""
    real, seen = centred(points)[..., :2], centred(image)
    return (real.square().sum((-1, -2)) / seen.square().sum((-1, -2)).clamp(min=1e-12)).sqrt()


def palm_size(points: Float[Tensor, "*B 21 3"]) -> Float[Tensor, " *B"]:
    """Root mean square distance of the palm's keypoints from their mean, metres."""
    return centred(points[..., RIGID, :]).square().sum(-1).mean(-1).sqrt()


def turns_to_rays(image: Float[Tensor, "T 21 2"]) -> Float[Tensor, "T 3 3"]:
    """Rotations from the middle of the picture to the hand: shapes are estimated from a part of the
    picture that is cut out around it, as if it was in the middle."""
    ray = torch.cat([image.mean(1), torch.ones_like(image[:, 0, :1])], -1)
    return shortest_turn(ray.new_tensor([0.0, 0.0, 1.0]), ray)


def centred(points: Float[Tensor, "*B P D"]) -> Float[Tensor, "*B P D"]:
    """Points relative to their mean."""
    return points - points.mean(-2, keepdim=True)


def robust_weight(residual: Float[Tensor, "*B D"]) -> Float[Tensor, " *B"]:
    """Square root of the weight of residuals with heavy tails (Cauchy's)."""
    return (1 + residual.square().sum(-1)).rsqrt()


def picture_term(
    keypoints: MovingKeypoints, image: Float[Tensor, "T 21 2"], weight: Float[Tensor, "S T 21"]
) -> Equations:
    """Distance of keypoints from their places on the plane one metre before the camera, metres,
    times `weight`, 1/m."""
    depth = keypoints.points[..., 2:]
    place = keypoints.points[..., :2] / depth
    slope = keypoints.slope[..., :2, :] - place[..., None] * keypoints.slope[..., 2:, :]
    residual = (place - image) * weight[..., None]
    jacobian = slope * (weight / depth[..., 0])[..., None, None]
    return normal_equations(residual.flatten(-2), jacobian.flatten(-3, -2))


def shape_term(
    keypoints: MovingKeypoints, shape: Float[Tensor, "T 21 3"], weight: Float[Tensor, "S T 21"]
) -> Equations:
    """Distance of keypoints, relative to their mean, from those of a shape, metres, times `weight`,
    1/m."""
    residual = (centred(keypoints.points) - centred(shape)) * weight[..., None]
    slope = keypoints.slope - keypoints.slope.mean(-3, keepdim=True)
    jacobian = slope * weight[..., None, None]
    return normal_equations(residual.flatten(-2), jacobian.flatten(-3, -2))
