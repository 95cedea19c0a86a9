"""Generated clips with the hands that the cleaner makes of theirs."""

from dataclasses import replace
from functools import partial

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.bundle import concatenated
from geneoh.choices import SIDES
from geneoh.errors import GeneOHError
from geneoh.generators.text2hoi.interaction_file import sequence_of
from geneoh.generators.text2hoi.resting import eased, finished
from geneoh.generators.text2hoi.settling import settled
from geneoh.generators.text2hoi.standing import StandingObject
from geneoh.geometry.mesh import Mesh
from geneoh.geometry.reconstruction import mesh_of_points
from geneoh.pipeline.denoise import clean_interaction
from geneoh.pipeline.options import Options
from geneoh.progress import OnStep
from geneoh.synthesis.actions import Actions
from geneoh.workers.pool import results_of

STILL = 0.3
"""Range of a joint's states below which it stands still: radians or decimetres."""


def refined(
    actions: Actions, *, seed: int, jobs: int = 1, on_step: OnStep | None = None
) -> Actions:
    """Drawn clips as `geneoh generate --refine geneoh` makes them of what the paper's refiner left.

    Objects have the meshes that follow from their points. One whose joint stands still is one
    mesh, as `geneoh generate` is given it; hands at an object whose joint moves go through the
    cleaner alone. `jobs` processes share the clips, each with one thread, and give the bits of one.

    Raises:
        GeneOHError: a clip ended its workers, as where memory runs out.
    """
    count, made = len(actions.verb), {}
    clips = ((n, actions.take(slice(n, n + 1), "B")) for n in range(count))
    refine = partial(refined_with_number, seed=seed)
    for number, clip in results_of(clips, refine, jobs=jobs, lost=lost):
        made[number] = clip
        if on_step is not None:
            on_step(len(made), count)
    return concatenated([made[number] for number in range(count)], "B")


def refined_with_number(numbered: tuple[int, Actions], seed: int) -> tuple[int, Actions]:
    """A clip refined, with its number, because processes end in any order."""
    number, clip = numbered
    return number, refined_clip(clip, seed)


def lost(numbered: tuple[int, Actions], why: str) -> tuple[int, Actions]:
    """A clip that ended its workers ends the evaluation."""
    raise GeneOHError(f"clip {numbered[0]} of those that are refined: {why}")


def refined_clip(clip: Actions, seed: int) -> Actions:
    """A batch of one clip, refined; a joint that stands still has one state in every frame."""
    if not joint_rests(clip):
        return refined_parts(clip, seed)
    found = refined_parts(as_one_part(clip), seed)
    return replace(
        clip,
        pose=found.pose,
        wrist=found.wrist,
        rotation=found.rotation,
        translation=found.translation,
        joint=mean_joint(clip),
    )


def refined_parts(clip: Actions, seed: int) -> Actions:
    """A batch of one clip, refined, and at rest at either end, which the cleaner does not know."""
    meshes, settle = part_meshes(clip), None
    if len(meshes) == 1:
        still = torch.eye(3), torch.zeros(3)
        stood = StandingObject(meshes[0], *still, clip.points[0], clip.normals[0])
        settle = partial(settled, stood=stood, generator=torch.Generator().manual_seed(seed))
    clip = finished(clip, settle)
    sequence = sequence_of(clip, meshes)
    clean = clean_interaction(sequence, Options(trust_object=True, seed=seed)).sequence
    pose, wrist = clip.pose.clone(), clip.wrist.clone()
    for track in clean.hands:
        side, frames = SIDES.index(track.side), slice(track.frames)
        assert track.pose is not None, "the cleaner fits a hand model"
        assert track.wrist is not None, "the cleaner fits a hand model"
        pose[0, side, frames], wrist[0, side, frames] = track.pose, track.wrist
    return eased(replace(clip, pose=pose, wrist=wrist).ended())


def joint_rests(clip: Actions) -> bool:
    """Whether the joint of a batch of one clip moves by less than `STILL`."""
    states = (clip.joint * clip.joint_units)[clip.valid]
    return bool(states.max() - states.min() < STILL)


def mean_joint(clip: Actions) -> Float[Tensor, "1 T"]:
    """The mean state of the joint of a batch of one clip, in every frame."""
    return clip.joint[clip.valid].mean().expand_as(clip.joint)


def as_one_part(clip: Actions) -> Actions:
    """A batch of one clip whose object is rigid, in the mean state of its joint."""
    posed = replace(clip, joint=mean_joint(clip))
    return replace(
        posed,
        points=posed.posed_points()[:, 0],
        normals=posed.posed_normals()[:, 0],
        part=torch.zeros_like(clip.part),
        axis=torch.zeros_like(clip.axis),
        joint=torch.zeros_like(clip.joint),
    )


def part_meshes(clip: Actions) -> tuple[Mesh, ...]:
    """A mesh for each part of the object of a batch of one clip."""
    points, normals, part = clip.points[0], clip.normals[0], clip.part[0]
    which = [part == number for number in part.unique().tolist()]
    return tuple(mesh_of_points(points[own], normals[own]) for own in which)
