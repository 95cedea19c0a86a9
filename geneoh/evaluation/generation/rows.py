"""The rows of the table besides real clips: nearest training clips, and generated ones."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import torch
from jaxtyping import Float, Int
from torch import Tensor

from geneoh.bundle import Bundle, concatenated
from geneoh.choices import SIDES, Side
from geneoh.errors import GeneOHError
from geneoh.generators.text2hoi.generate import action_sequence
from geneoh.generators.text2hoi.learning.samples import ActionData, hands_of, sentences
from geneoh.generators.text2hoi.networks.library import Text2HoiNetworks
from geneoh.generators.text2hoi.networks.objects import Objects
from geneoh.generators.text2hoi.physics.jointed import JointedObject, joined
from geneoh.generators.text2hoi.physics.resting import eased, finished, kept_on_table
from geneoh.generators.text2hoi.physics.settling import settled
from geneoh.generators.text2hoi.physics.standing import StandingObject
from geneoh.generators.text2hoi.sampling import sample_actions
from geneoh.generators.text2hoi.sentences.passing import asked_giver
from geneoh.generators.text2hoi.sentences.prompt import JOINTED
from geneoh.geometry.joint import Joint
from geneoh.geometry.mesh import Mesh
from geneoh.geometry.reconstruction import mesh_of_points
from geneoh.pipeline.denoise import clean_interaction
from geneoh.pipeline.options import Options
from geneoh.progress import OnStep, steps
from geneoh.synthesis.actions.action import Actions
from geneoh.synthesis.draws import Draws
from geneoh.workers.pool import results_of

SHAPE_POINTS = 128  # points of an object for the comparison of shapes


def nearest_training(real: Actions, training: Actions) -> Actions:
    """Each clip's object with the motion of the training clip whose object is nearest.

    Candidates have the same verb, hands and kind of joint; without any, the same verb and hands;
    then the same hands; then all. Objects are compared by the chamfer distance of their points as
    they stand. Hands, object and joint move as in the training clip; for another kind of joint, one
    radian becomes one decimetre, or the reverse.
    """
    at = torch.tensor([_nearest(real, clip, training) for clip in range(len(real.verb))])
    found = training.take(at, "B")
    same = ("length", "pose", "wrist", "rotation", "translation", "hands")
    joint = found.joint * found.joint_units / real.joint_units
    return replace(real, joint=joint, **{name: getattr(found, name) for name in same})


def _nearest(real: Actions, clip: int, training: Actions) -> int:
    hands = (training.hands == real.hands[clip]).all(1)
    both = hands & (training.verb == real.verb[clip])
    alike = both & (joint_kinds(training) == joint_kinds(real)[clip])
    tried = next(each for each in (alike, both, hands, torch.ones_like(hands)) if bool(each.any()))
    which = torch.nonzero(tried)[:, 0]
    apart = chamfer(thinned(training.take(which, "B")).points, thinned(real).points[clip])
    return int(which[apart.argmin()])


def joint_kinds(actions: Actions) -> Int[Tensor, " B"]:
    """Kind of joint of each object: 0 rigid, 1 hinge, 2 slide."""
    return (actions.part > 0).any(1) * (1 + actions.slides.long())


def thinned(clips: Actions) -> Actions:
    """Clips with about `SHAPE_POINTS` points of each object, evenly spread over their order."""
    count = clips.points.shape[1]
    return clips.take(torch.arange(0, count, max(1, count // SHAPE_POINTS)), "P")


def chamfer(many: Float[Tensor, "B S 3"], one: Float[Tensor, "R 3"]) -> Float[Tensor, " B"]:
    """Chamfer distance of B point clouds to one: sum of both mean nearest distances, metres."""
    apart = torch.cdist(many, one)
    return apart.amin(1).mean(1) + apart.amin(2).mean(1)


BATCH = 16  # clips that are sampled together


@dataclass(frozen=True)
class Drawn(Bundle):
    """Sampled actions before refinement, with the contact maps on which they are conditioned."""

    actions: Actions
    touched: Float[Tensor, "B P"]


def draw_clips(
    networks: Text2HoiNetworks,
    data: ActionData,
    *,
    generator: torch.Generator,
    contact: bool = True,
    on_step: OnStep | None = None,
) -> Drawn:
    """Sample an action for each real clip: its object, hands and length, and a random sentence.

    Without `contact`, the contact map of the networks is zero.
    """
    real = data.actions.take(slice(None))
    texts = sentences(real, data, Draws(len(real.verb), generator))
    parts, every = [], torch.arange(real.joint.shape[1])
    for start in steps(range(0, len(texts), BATCH), on_step):
        some = real.take(slice(start, start + BATCH), "B")
        objects = Objects.of(some)
        inputs = objects, texts[start : start + BATCH], hands_of(some), some.length
        maps = None if contact else torch.zeros_like(objects.points[..., 0])
        verbs = [data.verb_words[verb] for verb in some.verb.tolist()]
        giver: list[Side | None] = [
            asked_giver(sentence.lower()) if verb == "pass" else None
            for sentence, verb in zip(inputs[1], verbs, strict=True)
        ]
        made, touched = sample_actions(
            networks, *inputs, generator=generator, contact=maps, giver=giver
        )
        # clips that are sampled together are as long as the longest; pad to the length of all
        made = made.at_frames(every.minimum(made.length[:, None] - 1))
        parts.append(Drawn(replace(made, verb=some.verb, name=some.name), touched))
    return concatenated(parts, "B")


STILL_JOINT = 0.3  # range of a joint's states below which it counts as still, radians or decimetres


def refined(
    actions: Actions,
    verbs: Sequence[str],
    *,
    seed: int,
    jobs: int = 1,
    on_step: OnStep | None = None,
) -> Actions:
    """Refine clips after the paper's refiner as `geneoh generate --refine geneoh` does.

    `verbs` are those of the clips. Object meshes are reconstructed from their points. An object
    whose joint is still becomes one rigid mesh, as in `geneoh generate`. `jobs` processes share the
    clips, each with one thread; results do not depend on their number. `GeneOHError` where the
    workers of a clip died, for example because memory ran out.
    """
    count, made = len(actions.verb), {}
    clips = ((n, actions.take(slice(n, n + 1), "B"), verbs[n]) for n in range(count))
    refine = partial(refined_with_number, seed=seed)
    for number, clip in results_of(clips, refine, jobs=jobs, lost=_lost):
        made[number] = clip
        if on_step is not None:
            on_step(len(made), count)
    return concatenated([made[number] for number in range(count)], "B")


def refined_with_number(numbered: tuple[int, Actions, str], seed: int) -> tuple[int, Actions]:
    """Refine a clip and return it with its number, because processes finish in any order."""
    number, clip, verb = numbered
    return number, refined_clip(clip, verb, seed)


def _lost(numbered: tuple[int, Actions, str], why: str) -> tuple[int, Actions]:
    """`GeneOHError` for a clip whose workers died, which ends the evaluation."""
    raise GeneOHError(f"clip {numbered[0]} of those that are refined: {why}")


def refined_clip(clip: Actions, verb: str, seed: int) -> Actions:
    """Refine a batch of one clip; a still joint gets its mean state in every frame."""
    if not joint_rests(clip):
        return refined_parts(clip, verb, seed)
    found = refined_parts(as_one_part(clip), verb, seed)
    return replace(
        clip,
        pose=found.pose,
        wrist=found.wrist,
        rotation=found.rotation,
        translation=found.translation,
        joint=mean_joint(clip),
    )


def refined_parts(clip: Actions, verb: str, seed: int) -> Actions:
    """Refine a batch of one clip: settle the hands, clean them, and bring both ends to rest."""
    meshes = part_meshes(clip)
    clip = held(clip, meshes, verb, torch.Generator().manual_seed(seed))
    sequence = action_sequence(clip, meshes)
    clean = clean_interaction(sequence, Options(trust_object=True, seed=seed)).sequence
    pose, wrist = clip.pose.clone(), clip.wrist.clone()
    for track in clean.hands:
        side, frames = SIDES.index(track.side), slice(track.frames)
        assert track.pose is not None, "the cleaner fits a hand model"
        assert track.wrist is not None, "the cleaner fits a hand model"
        pose[0, side, frames], wrist[0, side, frames] = track.pose, track.wrist
    return eased(replace(clip, pose=pose, wrist=wrist).ended())


def held(clip: Actions, meshes: tuple[Mesh, ...], verb: str, generator: torch.Generator) -> Actions:
    """A batch of one clip whose hands hold the object, or the part that they open or close."""
    clip = kept_on_table(clip, verb)
    if verb not in JOINTED and len(meshes) == 2:
        return finished(clip)
    still = torch.eye(3), torch.zeros(3)
    stood = StandingObject(joined(meshes), *still, clip.points[0], clip.normals[0])
    if len(meshes) == 1:
        return finished(clip, partial(settled, stood=stood, generator=generator))
    most = float(clip.joint[clip.valid].max())
    joint = Joint(clip.axis[0], clip.pivot[0], bool(clip.slides[0]), most)
    pair = meshes[0], meshes[1]
    jointed = JointedObject(stood, pair, clip.part[0], joint, closes=verb == "close")
    return jointed.finished(jointed.guided(clip), generator)[0]


def joint_rests(clip: Actions) -> bool:
    """Whether the joint in a batch of one clip moves by less than `STILL_JOINT`."""
    states = (clip.joint * clip.joint_units)[clip.valid]
    return bool(states.max() - states.min() < STILL_JOINT)


def mean_joint(clip: Actions) -> Float[Tensor, "1 T"]:
    """The mean state of the joint of a batch of one clip, in every frame."""
    return clip.joint[clip.valid].mean().expand_as(clip.joint)


def as_one_part(clip: Actions) -> Actions:
    """A batch of one clip with its object made rigid, in the mean state of its joint."""
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
