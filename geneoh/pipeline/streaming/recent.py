"""A right hand at 30 frames a second that is cleaned as it comes, from its last two seconds.

Every few frames the three stages see one window, which ends with the newest frame. Where two
windows overlap, the targets of the fit are blended, and it holds on to the frames that are out
already, so that no seam shows.
"""

from collections import deque
from collections.abc import Sequence
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
from geneoh.objects.evidence import evidence_at_hand, evidence_of_nearness, evidence_of_poses
from geneoh.objects.palms import palm_at
from geneoh.pipeline.examination.faults import without_faults_of
from geneoh.pipeline.examination.rays import FoundRay, found_ray
from geneoh.pipeline.observed import CleanHand, Observed, lost_like
from geneoh.pipeline.presets import Preset
from geneoh.pipeline.results import clean_track
from geneoh.pipeline.spread import joint_spread
from geneoh.pipeline.streaming.recent_place import ChangingShift, RecentRun
from geneoh.pipeline.touch import finger_contact, fingers_apart
from geneoh.progress import timed
from geneoh.sequence.gaps import fill_gaps, fill_object
from geneoh.sequence.normalisation import NETWORK_FPS
from geneoh.sequence.sequence import HandTrack, ObjectTrack
from geneoh.sequence.windows import WINDOW

HOP = 7
"""Frames between two runs of the stages, at most. The last of them has so many frames less after it
than the lag."""
FIRST_SHARE = 0.7
"""Share of a newer window in the target of the first frame that an older one has seen too; it grows
to all of it over `HOP` frames."""
HELD, HOLD = 2, 30.0
"""Frames already out that the fit holds on to, and their weight beside that of new ones."""
AHEAD = 2  # frames after those that are asked for which the fit sees as well
SETTLED = WINDOW  # observed frames after which the shape of the hand is kept


class RecentHand:
    """The last two seconds of one hand and its object, and the frames that wait to be taken."""

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
        """Begin without frames. `surface` has the search trees of the meshes, and is None without
        any; of its motion no frame is read. `model` is the right hand."""
        self._meshes, self._surface, self._model = meshes, surface, model
        self._denoisers, self._chosen, self._lag = denoisers, chosen, lag
        self._generator = torch.Generator().manual_seed(seed)
        self._new: list[Observed] = []
        self._track: HandTrack | None = None
        self._motion: ObjectTrack | None = None
        still = model.template.new_zeros(chosen.samples, 1, 3)
        self._place = ChangingShift(still, still)
        self._ready: deque[CleanHand | None] = deque()
        self._pushed = self._done = self._observed = 0
        self._near = 0.0  # how far the hand has dealt with the object yet
        self._shape: Subject | None = None
        self._found: FoundRay | None = None
        self._out: HandState | None = None
        self._given: tuple[int, HandState] | None = None
        self._target: tuple[int, Tensor] | None = None

    def push(self, frame: Observed) -> CleanHand | None:
        """Take the next frame and give the one that is `lag` older; None where there is none yet,
        or no hand was seen in the two seconds before."""
        self._new.append(frame)
        self._pushed += 1
        self._observed += frame.hand is not None
        due = self._pushed - self._lag
        if due > self._done:
            self._clean(min(self._done + HOP, self._pushed))
        return self._ready.popleft() if due > 0 else None

    def flush(self) -> list[CleanHand | None]:
        """All frames that are still to come."""
        if self._pushed > self._done:
            self._clean(self._pushed)
        left = list(self._ready)
        self._ready.clear()
        return left

    def _clean(self, stop: int) -> None:
        """Make frames ready, from the first that is not done up to `stop`."""
        track, motion = self._window()
        if track is None:
            self._ready.extend([None] * (stop - self._done))
            self._done, self._out, self._target = stop, None, None
            return
        first, whole, motion = self._pushed - track.frames, track, fill_object(motion)
        track, _ = without_faults_of(track, NETWORK_FPS, motion)
        surface = self._placed(motion)
        subject = self._subject(track, surface)
        given = self._parameters(subject, track, first, frames_alike(whole, track))
        subject = subject.completed(given)
        ray = self._ray(track, motion)
        surface, poses, near, noise = self._object(motion, surface, subject, ray)
        stages = RecentRun(
            self._denoisers,
            subject,
            given,
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
        state, joints = self._fitted(subject, given, target, surface, evidence, first, stop)
        new = slice(self._done - first, stop - first)
        spread = joint_spread(samples, alone=1 - evidence)[new] if len(samples) > 1 else None
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
        """The last two seconds with what is new; no hand where none was seen in them."""
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
        """The ray of the camera, as told or as the noise of the window or an earlier one tells."""
        if track.camera_ray is not None and self._chosen.camera_told:
            return fill_gaps(track).camera_ray
        if self._surface is not None and self._chosen.camera_found:
            self._found = found_ray(track, motion, NETWORK_FPS) or self._found
        return self._found and self._found.direction.expand(track.frames, 3)

    def _placed(self, motion: ObjectTrack) -> MovingSurface | None:
        """The parts of the object that were seen, in a motion; None without any."""
        if self._surface is None or not motion.is_seen or not self._chosen.has_object:
            return None
        moved = replace(self._surface, rotation=motion.rotation, translation=motion.translation)
        return moved.of_parts(motion.seen_parts)

    def _subject(self, track: HandTrack, surface: MovingSurface | None) -> Subject:
        """The hand of the window, whose shape is kept when enough was seen of it."""
        carrier = None
        if surface is not None:
            carrier = carrier_of(track, surface, torch.ones_like(surface.translation[..., 0]))
        subject = subject_of(track, self._model, carrier)
        if self._shape is not None:
            kept = self._shape
            return replace(subject, shaped=kept.shaped, betas=kept.betas, offsets=kept.offsets)
        if self._observed >= SETTLED:
            self._shape = subject
        return subject

    def _parameters(
        self, subject: Subject, track: HandTrack, first: int, settled: int
    ) -> HandState:
        """Parameters of the input; where it has none, only frames new since then are fitted, and
        those that are not among the first `settled`, which more frames may show to be no fault.
        """
        if subject.start is not None:
            return subject.start
        joints, trust = subject.joints[None], subject.fit_trust[None]
        start = start_from_keypoints(joints, subject.shaped, trust)
        known = 0
        if self._given is not None:
            before = self._given[1][first - self._given[0] :][:settled]
            start = concatenated([before, start[before.wrist.shape[1] :]])
            known = max(before.wrist.shape[1] - HELD, 0)
        new = slice(known, None)
        found = fit_keypoints(joints[:, new], trust[:, new], subject.shaped, start[new])
        found = concatenated([start[:known], found])
        observed = int(track.observed.nonzero()[-1]) + 1  # what is filled after it may change
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
        """The object without its noise, None without one; how far its poses are relied on and the
        hand is taken to deal with it; and the noise."""
        whole = subject.joints.new_ones(len(subject.joints))
        relied, near, noise = whole[:, None], whole, None
        if surface is None:
            return None, whole, torch.zeros_like(whole), None
        if self._chosen.clean_object:
            palm = palm_at(subject.joints, subject.trust > 0)
            motion, examined = clean_object(motion, NETWORK_FPS, (palm,))
            parts, noise = motion.seen_parts, examined.white_noise
            relied = evidence_of_poses(examined, motion, NETWORK_FPS)[:, parts]
            clean = motion.of_parts(parts)
            surface = replace(surface, rotation=clean.rotation, translation=clean.translation)
            near = evidence_of_nearness(subject.joints, surface, NETWORK_FPS, ray)
        return surface, evidence_at_hand(relied, subject.joints, surface), near, noise

    def _blended(self, target: Float[Tensor, "T 21 3"], first: int) -> Float[Tensor, "T 21 3"]:
        """The target of a window, to which that of the windows before crosses where they overlap:
        from frame to frame the new one counts more, so that what is out goes on without a jump."""
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
        given: HandState,
        target: Float[Tensor, "T 21 3"],
        surface: MovingSurface | None,
        evidence: Float[Tensor, " T"],
        first: int,
        stop: int,
    ) -> tuple[HandState, Float[Tensor, "N 21 3"]]:
        """Parameters and keypoints of the new frames, continued from those that are out."""
        held = 0 if self._out is None else self._out.wrist.shape[1]
        cut = slice(self._done - held - first, min(stop + AHEAD, self._pushed) - first)
        start, wanted = given[cut], target[None, cut].clone()
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
    """How many frames at the start of two tracks of a hand are the same."""
    differ = (one.trust != other.trust).any(-1).nonzero()
    return int(differ[0]) if len(differ) else one.frames
