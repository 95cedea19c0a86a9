"""Online cleaning of a right hand at 30 frames a second, from its last two seconds.

Every few frames the three stages process one window, which ends with the newest frame. Where two
windows overlap, the targets of the fit are blended, and the fit keeps to frames that were already
returned, so that no seam shows.
"""

from collections import deque
from collections.abc import Sequence
from copy import copy
from dataclasses import replace

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.bundle import concatenated
from geneoh.denoisers.library import Denoisers
from geneoh.fitting.fit import fit_hand, fit_keypoints, start_from_keypoints
from geneoh.fitting.fit_config import FitConfig
from geneoh.fitting.subject import Subject, subject_of
from geneoh.fitting.terms import HandState
from geneoh.geometry.distance import MovingSurface
from geneoh.geometry.mesh import Mesh
from geneoh.hand.model import HandModel
from geneoh.objects.carrying import carrier_of
from geneoh.objects.cleaning import clean_object
from geneoh.objects.evidence import (
    TOLERATED,
    TOLERATED_BY_RAY,
    evidence_at_hand,
    evidence_of_nearness,
    evidence_of_poses,
)
from geneoh.objects.examination import ObjectExamination
from geneoh.objects.held_in_gaps import held_in_gaps
from geneoh.objects.palms import palm_at
from geneoh.pipeline.examination.faults import without_faults_of
from geneoh.pipeline.examination.rays import FoundRay, found_ray
from geneoh.pipeline.observed import CleanHand, Observed, lost_like
from geneoh.pipeline.presets import Preset
from geneoh.pipeline.results import clean_track
from geneoh.pipeline.spread import joint_spread
from geneoh.pipeline.streaming.first_look import without_options
from geneoh.pipeline.streaming.recent_place import ChangingShift, RecentRun
from geneoh.pipeline.touch import finger_contact, fingers_apart
from geneoh.progress import timed
from geneoh.sequence.gaps import fill_gaps, fill_object, without_placeholders
from geneoh.sequence.normalisation import NETWORK_FPS
from geneoh.sequence.sequence import HandTrack, ObjectTrack
from geneoh.sequence.windows import WINDOW

HOP = 7
"""Most frames between two runs of the stages. The last frames of a run have less context after them
than the lag."""
FIRST_SHARE = 0.7
"""Weight of the newer window in the target of the first new frame; it grows to 1 over `HOP`."""
HELD, HOLD = 2, 30.0
"""Number of already returned frames in the fit, and their weight relative to new frames."""
AHEAD = 2  # frames after the requested ones that the fit includes
SETTLED = WINDOW  # observed frames after which the hand shape is fixed
STREAM_ERROR_RATIO = 3.0
"""`ERROR_RATIO` of `geneoh.pipeline.spread` with two samples and few frames after the newest ones,
from `tools.stream_lags`: 81% of the true keypoints of synthetic clips are in the 90% radius at a
lag of 0.1 s, 85% at 0.3 s and 98% at 1 s."""
KEYPOINT_STEPS = 8  # of the fit to keypoints alone, which goes on in the next frames


class RecentHand:
    """State of one hand and its object: the last two seconds, and clean frames to return."""

    def __init__(
        self,
        meshes: tuple[Mesh, ...],
        surface: MovingSurface | None,
        model: HandModel,
        denoisers: Denoisers,
        chosen: Preset,
        *,
        lag: int,
        seed: int,
    ) -> None:
        """Begin without frames. `surface` provides the search trees of the meshes, not the motion,
        and is None without meshes. `model` is the right hand."""
        # copies of its fields, which answer less exactly beyond their limit after many queries
        own = surface and replace(surface, fields=tuple(map(copy, surface.fields)))
        self._meshes, self._surface, self._model = meshes, own, model
        self._denoisers, self._chosen, self._lag = denoisers, chosen, lag
        self._generator = torch.Generator().manual_seed(seed)
        self._new: list[Observed] = []
        self._track: HandTrack | None = None
        self._motion: ObjectTrack | None = None
        still = model.template.new_zeros(chosen.samples, 1, 3)
        self._place = ChangingShift(still, still)
        self._ready: deque[CleanHand | None] = deque()
        self._pushed = self._done = self._observed = 0
        self._near = 0.0  # largest interaction with the object so far, 0 to 1
        self._shape: Subject | None = None
        self._notes: tuple[str, ...] = ()
        self._found: FoundRay | None = None
        self._out: HandState | None = None
        self._given: tuple[int, HandState] | None = None
        self._target: tuple[int, Tensor] | None = None

    def push(self, frame: Observed) -> CleanHand | None:
        """Take the next frame and return the clean one that is `lag` older; None if there is none
        yet, or if no hand was observed in the last two seconds."""
        self._new.append(frame)
        self._pushed += 1
        self._observed += frame.hand is not None
        due = self._pushed - self._lag
        if due > self._done:
            self._clean(min(self._done + HOP, self._pushed))
        return self._ready.popleft() if due > 0 else None

    def flush(self) -> list[CleanHand | None]:
        """The remaining clean frames."""
        if self._pushed > self._done:
            self._clean(self._pushed)
        left = list(self._ready)
        self._ready.clear()
        return left

    def new_notes(self, *, ended: bool = False) -> tuple[str, ...]:
        """Assumptions about the hand, once: as soon as its shape is fixed, or the stream ended."""
        if self._shape is None and not ended:
            return ()
        found, self._notes = self._notes, ()
        return tuple(map(without_options, found))

    def _clean(self, stop: int) -> None:
        """Clean the frames from the first that is not done up to `stop`, exclusive."""
        track, motion = self._window()
        if track is None:
            self._ready.extend([None] * (stop - self._done))
            self._done, self._out, self._target = stop, None, None
            return
        track, motion = without_placeholders(track), fill_object(motion)
        first, whole = self._pushed - track.frames, track
        track, _ = without_faults_of(track, NETWORK_FPS, motion)
        surface = self._placed(motion)
        subject = self._subject(track, surface)
        parameters = self._parameters(subject, track, first, frames_alike(whole, track))
        subject = subject.completed(parameters)
        ray = self._ray(track, motion)
        surface, poses, near, noise = self._object(motion, surface, subject, ray)
        stages = RecentRun(
            self._denoisers,
            subject,
            parameters,
            timed(None, {}),
            self._generator,
            place=self._place,
            first=first,
            done=self._done,
        )
        samples, near = stages.relied_on(
            surface,
            poses,
            near,
            self._chosen if surface is not None else self._chosen.alone(),
            NETWORK_FPS,
            ray=ray,
            object_noise=noise,
        )
        target = self._blended(samples.mean(0), first)
        evidence = near * poses
        state, joints = self._fitted(subject, parameters, target, surface, evidence, first, stop)
        new = slice(self._done - first, stop - first)
        spread, seen = None, (subject.trust > 0).any(-1)
        if len(samples) > 1:
            spread = joint_spread(samples, STREAM_ERROR_RATIO, alone=1 - evidence, observed=seen)[
                new
            ]
        made = clean_track(state, joints, subject.betas, self._model.name, spread)
        contact: Sequence[Tensor | None] = [None] * made.frames
        if surface is not None:
            self._near = max(self._near, float(near.max()))
            apart = fingers_apart(state.verts(subject.shaped)[0], surface.at(new), self._model)
            contact = list(finger_contact(apart, spread, self._near * poses[new]))
        frames = enumerate(contact)
        self._ready.extend(CleanHand(made[at : at + 1], touch) for at, touch in frames)
        self._done = stop

    def _window(self) -> tuple[HandTrack | None, ObjectTrack]:
        """The last two seconds including new frames; the hand is None if never observed in them."""
        new, self._new = self._new, []
        motion = [frame.object for frame in new]
        motion = concatenated([self._motion, *motion] if self._motion is not None else motion)
        self._motion = motion[-WINDOW:]
        known = self._track or next((frame.hand for frame in new if frame.hand is not None), None)
        if known is not None:
            lost = lost_like(known)
            before = (
                self._track or lost[torch.zeros(len(motion.rotation) - len(new), dtype=torch.long)]
            )
            known = concatenated([before, *(frame.hand or lost for frame in new)])[-WINDOW:]
        self._track = known if known is not None and bool(known.valid.any()) else None
        return self._track, replace(self._motion, meshes=self._meshes)

    def _ray(self, track: HandTrack, motion: ObjectTrack) -> Float[Tensor, "T 3"] | None:
        """The camera ray: from the track, or estimated from the noise of this or an earlier
        window."""
        if track.camera_ray is not None and self._chosen.camera_told:
            return fill_gaps(track).camera_ray
        if self._surface is not None and self._chosen.camera_found:
            self._found = found_ray(track, motion, NETWORK_FPS) or self._found
        return self._found and self._found.direction.expand(track.frames, 3)

    def _placed(self, motion: ObjectTrack) -> MovingSurface | None:
        """The surface of the observed object parts with a motion; None if there are none."""
        if self._surface is None or not motion.is_seen or not self._chosen.has_object:
            return None
        moved = replace(self._surface, rotation=motion.rotation, translation=motion.translation)
        return moved.of_parts(motion.seen_parts)

    def _subject(self, track: HandTrack, surface: MovingSurface | None) -> Subject:
        """The subject of the window; its shape is fixed after `SETTLED` observed frames."""
        carrier = None
        if surface is not None:
            carrier = carrier_of(track, surface, torch.ones_like(surface.translation[..., 0]))
        subject = subject_of(track, self._model, carrier)
        if self._shape is not None:
            kept = self._shape
            return replace(subject, shaped=kept.shaped, betas=kept.betas, offsets=kept.offsets)
        self._notes = subject.notes
        if self._observed >= SETTLED:
            self._shape = subject
        return subject

    def _parameters(
        self, subject: Subject, track: HandTrack, first: int, settled: int
    ) -> HandState:
        """Pose parameters of the input, fitted if it has none.

        Earlier fits are reused for all but the new frames and those after the first `settled`,
        whose detection as a fault may still change.
        """
        if subject.start is not None:
            return subject.start
        joints, trust, known = subject.joints[None], subject.fit_trust[None], 0
        start = start_from_keypoints(joints, subject.shaped, trust)
        if self._given is not None:
            before = self._given[1][first - self._given[0] :][:settled]
            start = concatenated([before, start[before.wrist.shape[1] :]])
            known = max(before.wrist.shape[1] - HELD, 0)
        new = slice(known, None)
        unknown = joints[:, new], trust[:, new], subject.shaped, start[new]
        fitted = fit_keypoints(*unknown, noise=subject.keypoint_noise, iterations=KEYPOINT_STEPS)
        found = concatenated([start[:known], fitted])
        observed = int(track.observed.nonzero()[-1]) + 1  # later ones may change
        self._given = first, found[: min(observed, settled)]
        return found

    def _object(
        self,
        motion: ObjectTrack,
        surface: MovingSurface | None,
        subject: Subject,
        ray: Float[Tensor, "T 3"] | None,
    ) -> tuple[
        MovingSurface | None, Float[Tensor, " T"], Float[Tensor, " T"], Float[Tensor, " 2"] | None
    ]:
        """The cleaned object's surface, None without an object; per frame the reliability of its
        poses and the interaction of the hand with it, 0 to 1; and the white noise of its poses."""
        whole = subject.joints.new_ones(len(subject.joints))
        if surface is None:
            return None, whole, torch.zeros_like(whole), None
        near, noise, examined = whole, None, ObjectExamination.of_exact(motion)
        if self._chosen.clean_object:
            palm = palm_at(subject.joints, subject.trust > 0)
            motion, examined = clean_object(motion, NETWORK_FPS, (palm,))
            motion = held_in_gaps(motion, (palm,))
            noise, clean = examined.white_noise, motion.of_parts(motion.seen_parts)
            surface = replace(surface, rotation=clean.rotation, translation=clean.translation)
            near = evidence_of_nearness(subject.joints, surface, NETWORK_FPS, ray)
        bound = TOLERATED if ray is None else TOLERATED_BY_RAY
        relied = evidence_of_poses(examined, motion, NETWORK_FPS, tolerated=bound)
        relied = relied[:, motion.seen_parts]
        return surface, evidence_at_hand(relied, subject.joints, surface), near, noise

    def _blended(self, target: Float[Tensor, "T 21 3"], first: int) -> Float[Tensor, "T 21 3"]:
        """The target of a window, cross-faded from that of earlier windows where they overlap, so
        that new frames continue the returned ones without a jump."""
        if self._target is not None:
            begin, before = self._target
            before = before[max(first - begin, 0) :]
            after = torch.arange(len(before)) + first - self._done
            share = FIRST_SHARE + (1 - FIRST_SHARE) * after.to(target).clamp(0) / HOP
            both = before.lerp(target[: len(before)], share.clamp(max=1)[:, None, None])
            target = torch.cat([both, target[len(before) :]])
        self._target = first, target
        return target

    def _fitted(
        self,
        subject: Subject,
        parameters: HandState,
        target: Float[Tensor, "T 21 3"],
        surface: MovingSurface | None,
        evidence: Float[Tensor, " T"],
        first: int,
        stop: int,
    ) -> tuple[HandState, Float[Tensor, "N 21 3"]]:
        """Pose parameters and keypoints of the new frames, continued from the returned ones."""
        held = 0 if self._out is None else self._out.wrist.shape[1]
        cut = slice(self._done - held - first, min(stop + AHEAD, self._pushed) - first)
        start, wanted = parameters[cut], target[None, cut].clone()
        trust = torch.ones_like(wanted[..., 0])
        if self._out is not None:
            start = concatenated([self._out, start[held:]])
            wanted[:, :held] = self._out.joints(subject.shaped)
            trust[:, :held] = HOLD
        assert isinstance(self._chosen.fit, FitConfig), "Stream refuses others"
        state = fit_hand(
            wanted,
            trust,
            subject.shaped,
            start,
            config=self._chosen.fit,
            surface=None if surface is None else surface.at(cut),
            evidence=evidence[cut],
        )
        state = state[held : held + stop - self._done]
        self._out = (state if self._out is None else concatenated([self._out, state]))[-HELD:]
        return state, state.joints(subject.shaped)[0]


def frames_alike(one: HandTrack, other: HandTrack) -> int:
    """Number of frames at the start of two tracks of one hand with the same trust."""
    differ = (one.trust != other.trust).any(-1).nonzero()
    return int(differ[0]) if len(differ) else one.frames
