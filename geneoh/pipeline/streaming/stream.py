"""Online cleaning: a stream takes a tracker's frames and returns clean ones at a fixed lag."""

import logging
import math
from collections import deque
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, TypeVar

from jaxtyping import Float
from torch import Tensor

from geneoh.bundle import ByValue
from geneoh.choices import Side
from geneoh.config import as_field_type
from geneoh.denoisers.library import load_denoisers
from geneoh.errors import ConfigError, InputError
from geneoh.fitting.fit_config import FitConfig
from geneoh.geometry.mesh_files import MeshInput, meshes_of
from geneoh.geometry.rigid import Rigid
from geneoh.hand.library import hand_of_betas
from geneoh.hand.model import HandModel
from geneoh.modes import undisturbed
from geneoh.nn.devices import named_device
from geneoh.pipeline.inputs import checked_meshes
from geneoh.pipeline.observed import DIGITS, CleanHand, Observed, between, clean_between
from geneoh.pipeline.options import Options, with_settings
from geneoh.pipeline.presets import Preset
from geneoh.pipeline.streaming.first_look import FirstLook
from geneoh.pipeline.streaming.frame_reader import FrameReader
from geneoh.pipeline.streaming.recent import RecentHand
from geneoh.sequence.normalisation import NETWORK_FPS
from geneoh.sequence.placing import placed_hand
from geneoh.sequence.sequence import HandTrack, ObjectTrack, refuse_unknown_model
from geneoh.sequence.validation import LARGEST_FPS, SMALLEST_FPS

LOG = logging.getLogger(__name__)

Mirrored = TypeVar("Mirrored", HandTrack, ObjectTrack, HandModel)

ARGUMENTS = ("meshes", "fps", "lag", "side", "betas", "hand_model", "source")
"""Arguments of `Stream` besides the settings."""
LONGEST_LAG = 1.0
"""Seconds; with a longer lag a frame would have less than a second of context before it."""
POSES_UNREAD = "the object's poses are not used, because the stream has no mesh; give it one"
FIT_STEPS = {"iterations": 4, "contact_rounds": 1}
"""Fewer than for a whole track, because the fit continues from frames already returned."""


@dataclass(frozen=True, eq=False)
class CleanFrame(ByValue):
    """One output frame of a stream."""

    index: int
    """Index of the frame among the pushed ones, from 0."""
    hand: HandTrack | None
    """The clean hand as a track of one frame, with its `joint_spread`; None if no hand was observed
    in the last two seconds of input, which ends `lag` after this frame."""
    filled: bool
    """Whether the input had no hand in this frame."""
    contact: Float[Tensor, " 5"] | None = None
    """Probability that each finger touches the object, from the thumb to the little finger; None
    without a hand or an object. It is 0.5 without evidence, as until the hand comes near."""


class Stream:
    """Cleans one hand frame by frame, at a fixed lag and with bounded memory.

        stream = geneoh.Stream("mug.obj", fps=30, lag=0.3)
        for joints, pose in tracker:  # (21, 3), and (4, 4) or None
            clean = stream.push(joints, pose)
            if clean and clean.hand:
                use(clean.hand.joints[0], clean.hand.joint_spread[0])
        last = stream.flush()

    Each `push` returns the frame that is `lag` older, in order and without omissions, and None
    until there is one; `flush` returns the rest. Use one stream per hand. The same frames, settings
    and seed give the same result, independent of timing.
    """

    @undisturbed()
    def __init__(
        self,
        meshes: MeshInput = (),
        fps: float | int = 30.0,
        lag: float | int = 0.3,
        *,
        side: Side = "right",
        betas: Any = None,
        hand_model: str | None = None,
        source: str = "the stream",
        **settings: Any,
    ) -> None:
        """Load the networks and the object.

        Args:
            meshes: of the object, one per rigid part, in metres: a mesh, its file, or a list of
                them; none for a hand without an object.
            fps: frame rate, frames a second.
            lag: delay of the clean frame in seconds, 0 to 1; rounded to whole frames, and at other
                rates than 30 at least a thirtieth of a second.
            side: side of the hand.
            betas: (10,) hand shape for `hand_model`. Without them, or if they belong to another
                hand model than `hand`, the shape is estimated from the keypoints of the first two
                seconds, or is the mean one for poses alone.
            hand_model: hand model of the betas, "embedded", "mano" or "mano-as-shipped".
            source: name of the stream in messages.
            settings: fields of `Options`; by default preset="fast" and samples=2.

        Raises:
            InputError: a mesh has no surface, or is in another unit than metres.
            ConfigError: a setting is out of range, or not available in a stream.
            MissingAssetError: a MANO hand is requested and there is no MANO file.
        """
        as_field_type(side, Side, "geneoh.Stream", "side")
        fps = as_field_type(fps, float, "geneoh.Stream", "fps")
        lag = as_field_type(lag, float, "geneoh.Stream", "lag")
        plain = Options(preset="fast", samples=2)
        options = with_settings(plain, settings, "geneoh.Stream", ARGUMENTS)
        named_device(options.device)
        chosen = preset_of_stream(options)
        if not SMALLEST_FPS <= fps <= LARGEST_FPS or not 0 <= lag <= LONGEST_LAG:
            raise ConfigError(
                f"a stream has fps from {SMALLEST_FPS:g} to {LARGEST_FPS:g} and a lag from 0 to "
                f"{LONGEST_LAG:g} seconds, got fps {fps:g} and lag {lag:g}; correct them"
            )
        refuse_unknown_model(hand_model, "geneoh.Stream")
        self._source, self._fps, self._rate = source, fps, NETWORK_FPS / fps
        self._doubts: tuple[str, ...] = ()
        self._side: Side = side
        self._meshes = checked_meshes(meshes_of(meshes))
        self._reads = partial(FrameReader, side, self._meshes, betas, hand_model)
        self._lag = within = round(lag * fps)
        if self._rate != 1:  # interpolation needs the network frames before and after
            self._lag = max(self._lag, math.ceil(fps / NETWORK_FPS))
            within = math.floor(round(self._lag * self._rate, DIGITS)) - 1
        model = hand_of_betas(side, hand_model, asked=options.hand, mano_dir=options.mano_dir)
        motion = self._other_side(ObjectTrack.resting(self._meshes, 1))
        surface = motion.surface() if self._meshes else None
        denoisers = load_denoisers(options.weights, device=options.device, paper=False)
        self._device, self._within = options.device, within
        model = self._other_side(model).to(options.device)
        known = motion.meshes, surface, model, denoisers, chosen
        self._begin = partial(RecentHand, *known, lag=within, seed=options.seed)
        self._reset()

    @property
    def lag(self) -> int:
        """Number of frames by which the output of `push` is older than its input."""
        return self._lag

    @property
    def doubts(self) -> tuple[str, ...]:
        """Doubts about the input, as sentences, which are also logged as warnings.

        Available after the first two seconds with the hand, or after `flush`; empty before.
        """
        return self._doubts

    def push(
        self, hand: Any, object_pose: Any = None, *, camera_to_world: Any = None, where: str = ""
    ) -> CleanFrame | None:
        """Take the next frame and return the clean frame that is `lag` older, or None at the start.

        Args:
            hand: (21, 3) keypoints in OpenPose order, world frame, metres; or a dict of one frame
                with fields of the file format, named without the side: `joints` (21, 3), or `pose`
                (16, 3), axis-angle in radians, with `wrist` (3,), and `confidence` (21,); or a
                track of one frame. None or NaN if the hand was lost.
            object_pose: (4, 4) matrix from the object to the world, or a pair of rotation matrix
                (3, 3) and translation (3,) in metres, with a leading axis of parts if there are
                several; None or NaN if the object was lost.
            camera_to_world: (4, 4) pose of a camera that moves, if hand and object are in its frame
                instead of the world's; then in every frame. The clean hand is in its frame, too.
            where: name of the frame in messages; by default the stream's source and frame number.

        Raises:
            InputError: an array has a wrong shape or cannot be a hand or pose in metres, or the
                first frames show another keypoint order or another unit of the object's poses. The
                frame is not taken: push the next one in its place.
        """
        where = where or f"{self._source}, frame {self._count}"
        if self._is_amid:
            raise InputError(
                f"{where}: the push before was interrupted amid its work; call flush, after which "
                "another recording begins"
            )
        with undisturbed():
            seen = self._reader.observed(hand, object_pose, where)
            camera = self._reader.camera(camera_to_world, where)
            seen = seen if camera is None else seen.placed(camera)
            unread = object_pose is not None and not self._meshes and not self._has_unread
            self._tell((*self._look.push(seen, where), *([POSES_UNREAD] if unread else ())))
            self._has_unread |= unread
            self._is_amid = True
            now = self._inward(seen)
            self._lost.append(now.hand is None)
            self._cameras.append(camera)
            for frame in self._paced(now):
                self._take(frame)
            self._count += 1
            self._tell(self._recent.new_notes())
            clean = self._next() if self._count > self._lag else None
            self._is_amid = False
            return clean

    def flush(self) -> list[CleanFrame]:
        """Return the remaining clean frames in order; the next `push` begins another recording.

        After a `push` that was interrupted, such as by Ctrl-C, none remain.

        Raises:
            InputError: the recording is shorter than two seconds, and the check of its frames shows
                that it cannot be an interaction. It is ended all the same.
        """
        try:
            if self._is_amid:
                return []
            with undisturbed():
                self._tell(self._look.end(self._source))
                if self._since is not None:  # frames after the last network frame: one more
                    self._take(self._since)
                self._clean.extend(self._recent.flush())
                self._tell(self._recent.new_notes(ended=True))
                return [self._next() for _ in range(min(self._lag, self._count))]
        finally:
            self._reset()

    def _tell(self, doubts: tuple[str, ...]) -> None:
        """Log and store doubts about the input."""
        self._doubts = doubts if self._count == 0 else self._doubts + doubts
        for words in doubts:
            LOG.warning("%s: %s", self._source, words)

    def _reset(self) -> None:
        self._recent = self._begin()
        self._look = FirstLook(self._meshes, self._fps)
        self._before: Observed | None = None
        self._since: Observed | None = None
        self._reader = self._reads()
        self._has_unread = False  # whether a pose came although there is no mesh
        self._is_amid = False  # whether a push works, or was interrupted
        self._lost: deque[bool] = deque()
        self._cameras: deque[Rigid | None] = deque()
        self._clean: deque[CleanHand | None] = deque()
        self._count = self._taken = self._given = self._dropped = 0

    def _inward(self, seen: Observed) -> Observed:
        """A frame converted for the networks: mirrored to a right hand, on the device."""
        hand = None if seen.hand is None else self._other_side(seen.hand).to(self._device)
        return Observed(hand, self._other_side(seen.object).to(self._device))

    def _paced(self, now: Observed) -> list[Observed]:
        """Resample to the network frame rate: the network frames after the previous input frame, up
        to and including this one. If several input frames fall between two network frames, data
        that is missing in the last is taken from the earlier ones."""
        before, self._before = self._before or now, now
        first = (self._count - 1) * self._rate
        last = round(self._count * self._rate, DIGITS)
        instants = range(self._taken, math.floor(last) + 1)
        seen = now.completed(self._since) if self._rate < 1 else now
        self._since = seen
        if instants:
            self._since = None if last == instants[-1] else now
        return [between(before, seen, (frame - first) / self._rate) for frame in instants]

    def _take(self, frame: Observed) -> None:
        """Give a network frame to the stages, and keep the clean one that it makes ready."""
        made = self._recent.push(frame)
        self._taken += 1
        if self._taken > self._within:
            self._clean.append(made)

    def _next(self) -> CleanFrame:
        """The next clean frame at the stream's frame rate, interpolated between network frames."""
        place = round(self._given * self._rate, DIGITS)
        while self._dropped < math.floor(place) and len(self._clean) > 1:
            self._clean.popleft()
            self._dropped += 1
        after = self._clean[min(1, len(self._clean) - 1)]
        hand, contact = clean_between(self._clean[0], after, min(place - self._dropped, 1.0))
        hand = None if hand is None else self._other_side(hand).to("cpu")
        camera = self._cameras.popleft()
        if camera is not None and hand is not None:
            hand = placed_hand(hand, camera.inverse())
        contact = None if contact is None else contact.cpu()
        frame = CleanFrame(self._given, hand, self._lost.popleft(), contact)
        self._given += 1
        return frame

    def _other_side(self, value: Mirrored) -> Mirrored:
        """A track or model of the user's hand, mirrored if it is a left hand (its own inverse)."""
        return value.mirrored() if self._side == "left" else value


def preset_of_stream(options: Options) -> Preset:
    """The preset of some options; `ConfigError` for settings that a stream does not support."""
    chosen = options.resolved()
    if not isinstance(chosen.fit, FitConfig) or options.refine_object:
        raise ConfigError(
            "a stream has the presets 'default' and 'fast' and gives no poses of the object, "
            f"got preset {options.preset!r} and refine_object={options.refine_object}; "
            "use geneoh.denoise for these"
        )
    if options.selection == "closest":
        raise ConfigError(
            "a stream gives the mean of its samples, got selection='closest'; leave it out"
        )
    if options.hand_delay:
        raise ConfigError(
            "a stream takes hand and object of one time, got "
            f"hand_delay={options.hand_delay:g}; push each hand with the object's pose of its "
            "own time"
        )
    return replace(chosen, fit=replace(chosen.fit, **FIT_STEPS))
