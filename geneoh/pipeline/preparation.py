"""What the stages see of a checked sequence, and how their results are given back."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import torch

from geneoh.geometry.rigid import Rigid
from geneoh.objects.evidence import evidence_of_poses
from geneoh.objects.examination import ObjectExamination
from geneoh.objects.held_in_gaps import held_in_gaps
from geneoh.objects.palms import palm_of
from geneoh.objects.still_frame import still_frame
from geneoh.pipeline.examination.examined import Examined, examined
from geneoh.pipeline.examination.rays import with_found_rays
from geneoh.pipeline.options import Options
from geneoh.pipeline.presets import Preset
from geneoh.pipeline.results import HandResult
from geneoh.sequence.gaps import filled_poses
from geneoh.sequence.lines import poses_on_lines, without_lines
from geneoh.sequence.normalisation import NETWORK_FPS, NormalisedHand, normalised_hands
from geneoh.sequence.placing import in_world, placed, placed_hand
from geneoh.sequence.repeats import repeated_poses, without_repeats
from geneoh.sequence.sequence import ObjectTrack, Sequence

NO_OBJECT = (
    "no mesh or no pose of an object was given: the hand was cleaned by the prior of hand motion "
    "alone, and nothing is known of contact; --obj MESH names a mesh"
)
OF_AN_OBJECT = ("trust_object", "refine_object", "hand_delay")
"""Options that have no effect without an object."""
OF_OTHER_POSES = (
    "measures are against the cleaned poses of the object; a page measures against the poses in "
    "the file, which are the input's (--refine-object writes clean ones)"
)
OF_FILLED_POSES = (
    "where the object has no pose and a hand moves it, it moves with the clean hand in the result; "
    "measures there are against an object that moves with the hand as it was given"
)
OF_SHIFTED_HANDS = (
    "measures, those of the input too, are of the hands after --hand-delay; a page draws and "
    "measures the input as it was given"
)
MOVING_CAMERA = (
    "the camera moves: its motion was removed before the hand was cleaned, by the object while no "
    "hand moves with it, and accelerations are measured without it"
)
CAMERA_REMOVED = (
    "the camera's motion was removed by its poses before the hand was cleaned, and accelerations "
    "are measured without it"
)
CAMERA_CONTRADICTED = (
    "by the camera's poses the object moves while no hand moves with it: they may be inverted, of "
    "other frames, of another scale, as from the images of one camera, or of other axes, as y up "
    "and z backward; the motion that they leave was estimated by the object and removed as well"
)
FAST_CAMERA = 8.0
"""Median speed of a camera, metres a second, from which the unit of its poses is doubted: no one
runs faster while hands are filmed, and in millimetres the head of one who works does."""


@dataclass(frozen=True)
class Prepared:
    """Input of the stages."""

    hands: tuple[NormalisedHand, ...]
    undone: tuple[NormalisedHand, ...]
    """The input tracks of the hands in which a filter was undone."""
    examined: Examined
    given: Sequence
    """The input with a filter undone in its hands, whose frame and frames results get."""
    still: Rigid | None
    """Pose of the given frame in that of the stages, in each frame; None where they are one."""
    preset: Preset
    notes: tuple[str, ...]
    """Assumptions about the sequence, as sentences."""

    def as_given(self, result: HandResult, hand: NormalisedHand) -> HandResult:
        """The result of a normalised hand at the rate, side, frame and device of the input."""
        given = self.given.hand(hand.side)
        result = result.to(given.valid.device)
        track, samples = hand.track_to_user(result.track), hand.points_to_user(result.samples)
        result = replace(result, track=track, samples=samples)
        if self.still is not None:
            result = result.placed(self.still.inverse())
        return replace(
            result,
            track=replace(result.track, camera_ray=given.camera_ray),
            filled=~given.observed,
            contact=None if result.contact is None else hand.frames_to_user(result.contact),
            evidence=hand.frames_to_user(result.evidence),
        )


def prepared(sequence: Sequence, options: Options, stored: ObjectTrack) -> Prepared:
    """A checked sequence as the stages see it; `stored` has the object's poses that were given."""
    chosen, motion = options.resolved(), sequence.object
    notes = [sequence.left_out] if sequence.left_out else []
    if not motion.meshes or not motion.is_seen:
        motion, chosen = replace(motion, meshes=()), chosen.alone()
        notes += [NO_OBJECT, *idle_options(options)]
    elif options.hand_delay:
        notes.append(OF_SHIFTED_HANDS)
    notes += filled_poses(stored) if chosen.has_object else ()
    if chosen.clean_object:
        ready = examined(sequence.hands, motion, sequence.fps, options.refine_object)
    else:
        relied = torch.ones(motion.rotation.shape[:2])
        if chosen.has_object:
            exact = ObjectExamination.of_exact(motion)
            relied = evidence_of_poses(exact, motion, sequence.fps)[:, motion.seen_parts]
            motion = held_in_gaps(motion, map(palm_of, sequence.hands))
        ready = Examined(sequence.hands, motion, relied, relied)
    given = replace(sequence, hands=ready.hands)
    seen, ray_notes = with_found_rays(replace(given, object=ready.met), chosen)
    notes += [*ready.notes, *ray_notes]
    still, undone = None, ready.undone
    if chosen.clean_object:
        still = still_frame(seen.hands, seen.object, seen.fps, ready.relied)
    if still is not None:
        seen, undone = placed(seen, still), tuple(placed_hand(hand, still) for hand in undone)
        notes.append(MOVING_CAMERA)
    hands = normalised_hands(seen)
    raw = normalised_hands(replace(seen, hands=undone)) if undone else ()
    if hands[0].track.frames != sequence.frames:
        notes.append(rate_note(sequence.fps))
    return Prepared(hands, raw, ready, given, still, chosen, tuple(notes))


def brought_to_world(
    given: Sequence, camera: Rigid, options: Options
) -> tuple[Sequence, tuple[str, ...]]:
    """The sequence of a moving camera in the world, and notes: poses of the object that a slower
    sensor repeats, or that are on lines, are known in the camera's frame alone."""
    world = in_world(given, camera)
    if not options.resolved().clean_object:
        return world, ()
    repeats = repeated_poses(given.object, camera_moves=True)
    motion, repeated = without_repeats(world.object, repeats)
    motion, lines = without_lines(motion, poses_on_lines(given.object))
    notes = (*lines, *repeated)
    told = (OF_OTHER_POSES,) if notes and not options.refine_object else ()
    return replace(world, object=motion), (*notes, *told)


def told_of_camera(notes: tuple[str, ...], camera: Rigid, fps: float) -> tuple[str, ...]:
    """The notes on a sequence in the world that the camera's poses lead to, and those on these."""
    found = [note for note in dict.fromkeys(notes) if MOVING_CAMERA not in note]
    found.append(CAMERA_REMOVED)
    if any(MOVING_CAMERA in note for note in notes):
        found.append(CAMERA_CONTRADICTED)
    steps = camera.translation.diff(dim=0).norm(dim=-1)
    if len(steps) and (speed := fps * float(steps.median())) > FAST_CAMERA:
        found.append(f"by its poses the camera moves {speed:.0f} m a second; give them in metres")
    return tuple(found)


def idle_options(options: Options) -> Iterator[str]:
    """A sentence for each option that has no effect without an object."""
    for name in OF_AN_OBJECT:
        if getattr(options, name):
            option = f"--{name.replace('_', '-')}"
            yield f"{option} had no effect: it needs mesh and poses of an object"


def rate_note(fps: float) -> str:
    """A sentence about a sequence of another frame rate than that of the networks."""
    how = "averaged" if fps > NETWORK_FPS else "resampled"
    return (
        f"{how} from {fps:g} to {NETWORK_FPS:g} frames a second and back: measures, and how far "
        f"keypoints moved, are at {NETWORK_FPS:g}, on a page at {fps:g}"
    )
