"""Poses of an object in gaps of its track: one that a hand moves is moved by the palm there, too.

Trackers lose an object most often while a hand covers and moves it. On the straight line from the
last pose before a gap to the first one after it, the object is centimetres off, and in its frame
the hand seems to leave it and to come back, in all windows of the stages that see the gap. In some
gaps it also changes what it moves with (`geneoh.objects.passing`).
"""

from collections.abc import Iterable
from dataclasses import replace

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from geneoh.geometry.rigid import Rigid
from geneoh.geometry.rotations import interpolate_rotations
from geneoh.objects.evidence import radius, share_between
from geneoh.objects.movers import Mover, beside, better
from geneoh.objects.palms import RigidMotion
from geneoh.objects.passing import Gap
from geneoh.sequence.gaps import observed_around
from geneoh.sequence.sequence import ObjectTrack
from geneoh.sequence.windows import runs

KEPT, CHANGED = 0.035, 0.05
"""Distance between the usual places of the object in the palm before and after a gap, metres: up to
the first bound the hand kept it, from the second on it was taken or put down in the gap. Of made
and scanned clips with noise, held objects have at most 0.032 and others 0.065 or more."""


def held_in_gaps(motion: ObjectTrack, palms: Iterable[RigidMotion]) -> ObjectTrack:
    """The track with other poses in those gaps beside which a palm moves the object.

    `motion` has finite poses in all frames. They stay as they are in frames that are observed, and
    in gaps in which no palm seems to move the object. Palms count if they are seen for long enough
    to tell noise from motion.
    """
    gaps = [part for part in motion.seen_parts if not bool(motion.observed[:, part].all())]
    calm = [Mover.of(palm, motion.rotation) for palm in palms if palm.is_long] if gaps else []
    if not calm:
        return motion
    rotation, translation = motion.rotation.clone(), motion.translation.clone()
    for part in gaps:
        known = motion.observed[:, part]
        center = motion.meshes[part].center().to(rotation)
        turns = rotation[:, part]
        path = Rigid(turns.double(), (turns @ center + translation[:, part]).double())
        path = carried_path(path, known, calm, radius(motion.meshes[part]))
        turns = path.rotation.to(rotation)
        rotation[~known, part] = turns[~known]
        places = path.translation.to(rotation) - turns @ center
        translation[~known, part] = places[~known]
    return replace(motion, rotation=rotation, translation=translation)


def carried_path(path: Rigid, known: Bool[Tensor, " T"], palms: list[Mover], size: float) -> Rigid:
    """A path with gaps in which the object moves with the palm that moves with it most, or changes
    what it moves with if that is more sure. `size` is the radius of the object, metres."""
    every = [kept_in_palm(path, known, palm) for palm in palms]
    share, best = torch.stack([share for _, share in every]).max(0)
    frames = torch.arange(len(share), device=share.device)
    turns, places = (
        torch.stack([getattr(held, name) for held, _ in every])[best, frames]
        for name in ("rotation", "translation")
    )
    for run in runs((~known).cpu().numpy()):
        if run.start > 0 and run.stop < len(known):
            way, sure = Gap(path, run, known, size).most_probable_change(palms)
            if sure > share[run].max():
                turns[run], places[run], share[run] = way.rotation, way.translation, sure
    turned = interpolate_rotations(path.rotation, turns, share)
    return Rigid(turned, path.translation.lerp(places, share[:, None]))


def kept_in_palm(
    path: Rigid, known: Bool[Tensor, " T"], palm: Mover
) -> tuple[Rigid, Float[Tensor, " T"]]:
    """The path with gaps in which the object keeps its pose in the palm, or changes it evenly; and
    the extent, 0 to 1, to which the palm carries it there."""
    own, between = palm.holds(path), observed_around(known)
    turns = between.rotations(own.rotation[:, None])[:, 0]
    held = palm.pose.compose(Rigid(turns, between.points(own.translation)))
    off = held.translation - between.points(path.translation)
    share = torch.zeros_like(off[:, 0])
    for gap in runs((~known).cpu().numpy()):
        seen = better(off[gap], palm.error)
        first, last = carries(palm, own.translation, beside(gap, known))
        share[gap] = seen * first.lerp(last, between.fraction[gap].to(first))
    return held, share


def carries(
    palm: Mover, own: Float[Tensor, "T 3"], ends: list[Bool[Tensor, " T"]]
) -> tuple[Float[Tensor, ""], Float[Tensor, ""]]:
    """Whether a palm carries an object at both ends of a gap, 0 to 1: it moves with it beside them,
    and has it in the same place after the gap as before. `own` are places in the palm."""
    usual = [own[some].median(0).values for some in ends]
    kept = share_between((usual[-1] - usual[0]).norm(), KEPT, CHANGED)
    both = palm.moves(own, torch.stack(ends).any(0))
    first, last = (kept * palm.moves(own, ends[end]).maximum(both) for end in (0, -1))
    return first, last
