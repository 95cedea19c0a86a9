"""Remove twist about the finger bones from poses, with unchanged keypoints.

Rotating a joint about its own bone and the next joint back leaves all keypoints where they are.
Optimisers that fit MANO to keypoints without a pose prior end at an arbitrary twist, whereas the
networks are trained on poses of real hands.
"""

import math
from dataclasses import replace

import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn.functional import normalize

from geneoh.fitting.solve import solve_coupled_frames
from geneoh.fitting.subject import Subject
from geneoh.geometry.rotations import axis_angle_to_matrix, matrix_to_axis_angle, nearest_rotations
from geneoh.hand.model import HandModel

BONES = ((1, 2, 15), (4, 5, 16), (7, 8, 17), (10, 11, 18), (13, 14, 19))
"""Row of the rest offsets of the bone after each joint of each finger; the last end in the tips."""
TWIST_STEP = math.radians(15)  # step of the grid of twists
FEWEST_FRAMES = 15  # frames that are needed to distinguish a constant twist from tracker noise
LOOKED_AT = 16  # evenly spaced frames from which a twist is detected
NOISE_FILTER = 10.0  # standard deviation of the temporal Gaussian that removes noise, frames
NATURAL = 1.3  # standard deviation of natural poses in units of the model's `pose_std`
OFFSET = 0.25  # standard deviation of a tracker's constant pose error, radians per component
SURE = 27.0
"""Least log likelihood ratio, twist against constant tracker error, at which twist is removed."""
REFINED = 10.0
"""Upper bound of what `refined` adds to this ratio: the grid search alone rules most poses out."""
CONSTANT, SLOW = 1000.0, 20.0
"""Weights of a twist's change between frames, 1/rad: for a constant and for a slow twist."""
SOLVER_STEPS = 8  # Levenberg-Marquardt has converged by then
SLIGHT = 1e-3  # step of the finite differences, radians
TOLD = (
    "the fingers are twisted about their bones as no hand can be: natural poses with the same "
    "keypoints are used instead"
)


def untwisted(subject: Subject) -> Subject:
    """The subject with the twist about the bones removed from its pose, and a note that says so.

    Keypoints do not move. The subject is unchanged if its pose is not twisted, if it has no pose,
    or if it has fewer than `FEWEST_FRAMES` frames.
    """
    if subject.start is None or len(subject.joints) < FEWEST_FRAMES:
        return subject
    model, rotations, offsets = subject.shaped.model, subject.start.rotations[0], subject.offsets[0]
    fingers, bones = fingers_of(rotations), bones_of(offsets)
    seen = lasting(fingers, LOOKED_AT)
    start = likeliest(seen[:, ::2], bones, model)[:, None].expand(*seen.shape[:2], 3)
    if sureness(seen, turned(seen, bones, start), model) < SURE - REFINED:
        return subject
    found = refined(seen, bones, model, start, CONSTANT)
    if sureness(seen, turned(seen, bones, found), model) < SURE:
        return subject
    start = found.mean(1, keepdim=True).expand(*fingers.shape[:2], 3)
    twist = refined(fingers, bones, model, start, SLOW)
    natural = turned_about_bones(rotations, offsets, twist)
    pose = replace(subject.start, rotations=natural[None])
    return replace(subject, start=pose, notes=(*subject.notes, TOLD))


def turned_about_bones(
    rotations: Float[Tensor, "T 16 3 3"],
    offsets: Float[Tensor, "20 3"],
    twist: Float[Tensor, "5 T 3"],
) -> Float[Tensor, "T 16 3 3"]:
    """Local rotations of a hand with each finger joint twisted about its own bone.

    The next joint is rotated back, so that keypoints do not move. `offsets` are the rest offsets,
    `twist` is in radians.
    """
    fingers = turned(fingers_of(rotations), bones_of(offsets), twist)
    return torch.cat([rotations[:, :1], fingers.transpose(0, 1).flatten(1, 2)], dim=1)


def fingers_of(rotations: Float[Tensor, "T 16 3 3"]) -> Float[Tensor, "5 T 3 3 3"]:
    """Local rotations by finger, frame and joint."""
    return rotations[:, 1:].unflatten(1, (5, 3)).transpose(0, 1)


def bones_of(offsets: Float[Tensor, "20 3"]) -> Float[Tensor, "5 3 3"]:
    """Unit direction of the bone after each joint of each finger, in the rest frame."""
    return normalize(offsets[torch.tensor(BONES)], dim=-1)


def lasting(fingers: Float[Tensor, "5 T 3 3 3"], count: int) -> Float[Tensor, "5 N 3 3 3"]:
    """Rotations at `count` evenly spaced frames, each a Gaussian mean over neighbouring frames."""
    time = torch.arange(fingers.shape[1]).to(fingers)
    middle = torch.linspace(0, fingers.shape[1] - 1, count).to(fingers)
    weight = torch.softmax(-0.5 * ((middle[:, None] - time) / NOISE_FILTER).square(), dim=-1)
    return nearest_rotations(torch.einsum("nt,ftjrc->fnjrc", weight, fingers))


def turned(
    fingers: Float[Tensor, "5 T 3 3 3"],
    bones: Float[Tensor, "5 3 3"],
    twist: Float[Tensor, "5 T 3"],
) -> Float[Tensor, "5 T 3 3 3"]:
    """`turned_about_bones` of the fingers alone."""
    turn = axis_angle_to_matrix(twist[..., None] * bones[:, None])
    moved = fingers @ turn
    after = turn[:, :, :2].mT @ moved[:, :, 1:]
    return torch.cat([moved[:, :, :1], after], dim=2)


def unlikeness(
    rotations: Float[Tensor, "5 *B J 3 3"], model: HandModel, first: int = 0
) -> Float[Tensor, "5 *B J 3"]:
    """Deviation of axis-angle poses from the relaxed pose, in units of `pose_std`, for the J joints
    of each finger that start at joint `first`."""
    shape, last = (5, *[1] * (rotations.ndim - 4), 3, 3), first + rotations.shape[-3]
    mean, std = (values[1:].reshape(shape) for values in (model.pose_mean, model.pose_std))
    return (matrix_to_axis_angle(rotations) - mean[..., first:last, :]) / std[..., first:last, :]


def likeliest(
    fingers: Float[Tensor, "5 T 3 3 3"], bones: Float[Tensor, "5 3 3"], model: HandModel
) -> Float[Tensor, "5 3"]:
    """Constant twists on a grid after which the poses are nearest to the relaxed pose.

    A joint's pose depends on its own twist and that of the joint before, so the best twists are
    found from the last joint backwards (dynamic programming).
    """
    grid = torch.arange(-math.pi, math.pi - TWIST_STEP / 2, TWIST_STEP).to(fingers)
    turn = axis_angle_to_matrix(grid[:, None, None, None] * bones).transpose(0, 1)
    cost, best = fingers.new_zeros(5, len(grid)), []
    for joint in (2, 1, 0):  # tables over the previous joint's twist, its own twist, and frames
        moved = fingers[:, None, None, :, joint] @ turn[:, None, :, None, joint]
        if joint:
            moved = turn[:, :, None, None, joint - 1].mT @ moved
        unlike = unlikeness(moved[..., None, :, :], model, joint).square()
        cost, at = (unlike.sum((-1, -2)).mean(-1) + cost[:, None]).min(-1)
        best.append(at)
    path = [torch.zeros_like(best[-1][:, 0])]
    finger = torch.arange(5, device=fingers.device)
    for at in reversed(best):
        path.append(at[finger, path[-1]])
    return grid[torch.stack(path[1:], dim=-1)]


def refined(
    fingers: Float[Tensor, "5 T 3 3 3"],
    bones: Float[Tensor, "5 3 3"],
    model: HandModel,
    twist: Float[Tensor, "5 T 3"],
    steady: float,
) -> Float[Tensor, "5 T 3"]:
    """Twists of least squared `unlikeness` plus squared change between frames (weight `steady`).

    Levenberg-Marquardt from the initial `twist`, independently for each finger.
    """

    def residual(of: Tensor, at: Tensor) -> Tensor:
        return unlikeness(turned(of, bones, at), model).flatten(-2)

    def energy(unlike: Tensor, at: Tensor) -> Tensor:
        return unlike.square().sum((1, 2)) + (steady * at.diff(dim=1)).square().sum((1, 2))

    eye, damping = torch.eye(3).to(twist), twist.new_full((5, 1, 1, 1), 1e-2)
    coupling = twist.new_full((3,), steady**2)
    slight = SLIGHT * torch.cat([torch.zeros_like(eye[:1]), eye])
    copies = fingers.repeat(1, len(slight), 1, 1, 1)  # one call for all differences is faster
    for _ in range(SOLVER_STEPS):
        each = (twist[:, None] + slight[:, None]).flatten(1, 2)
        here, *ahead = residual(copies, each).chunk(len(slight), dim=1)
        slope = (torch.stack(ahead, dim=-1) - here[..., None]) / SLIGHT
        matrix = slope.mT @ slope
        ridge = damping * matrix.diagonal(dim1=-2, dim2=-1).mean((1, 2))[:, None, None, None]
        gradient = (slope.mT @ here[..., None])[..., 0] + _pull(twist, steady)
        moved = twist + solve_coupled_frames(matrix + ridge * eye, -gradient, coupling)
        nearer = energy(residual(fingers, moved), moved) < energy(here, twist)
        better = nearer[:, None, None]
        twist = torch.where(better, moved, twist)
        damping = torch.where(better[..., None], damping / 4, damping * 6).clamp(1e-6, 1e6)
    return twist


def _pull(twist: Float[Tensor, "5 T 3"], steady: float) -> Float[Tensor, "5 T 3"]:
    """Half gradient of the squared changes between frames."""
    change = steady**2 * twist.diff(dim=1)
    after, before = (0, 0, 1, 0), (0, 0, 0, 1)
    return torch.nn.functional.pad(change, after) - torch.nn.functional.pad(change, before)


def sureness(
    observed: Float[Tensor, "5 T 3 3 3"], natural: Float[Tensor, "5 T 3 3 3"], model: HandModel
) -> float:
    """Log likelihood ratio of two explanations of the `observed` pose, by medians over frames: a
    twisted natural pose, against a natural pose with a constant error of each component."""
    std = model.pose_std[1:].reshape(5, 3, 3)
    usual, wide = (NATURAL * std).square(), (NATURAL * std).square() + OFFSET**2

    def score(rotations: Tensor, variance: Tensor) -> Tensor:
        unlike = unlikeness(rotations, model).median(1).values * std
        return -0.5 * (unlike.square() / variance + variance.log()).sum()

    return float(score(natural, usual) - score(observed, wide))
