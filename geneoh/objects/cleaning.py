"""Examine the object's track for noise, and remove it.

The hand is denoised in the object frame, so noise of the object's poses would become noise of the
hand. The examination estimates white noise, and finds frames that no possible motion reaches and
flips by a symmetry rotation of the mesh. Motion that a palm shares is not noise. An exact track is
returned unchanged.
"""

from dataclasses import dataclass, fields, replace
from functools import lru_cache
from itertools import pairwise

import numpy as np
import torch
from jaxtyping import Bool, Float64
from scipy.ndimage import maximum_filter1d
from scipy.spatial.transform import Rotation
from torch import Tensor

from geneoh.geometry.distance import SurfaceDistance
from geneoh.geometry.mesh import Mesh
from geneoh.objects.consistency import Chain, longest_chain, possible_places, there_and_back
from geneoh.objects.examination import EXACT_ROTATION, EXACT_TRANSLATION, ObjectExamination
from geneoh.objects.palms import RigidMotion, Views
from geneoh.objects.smoothing import (
    CHI3_MEDIAN,
    LEAST_FRAMES,
    Summary,
    increments,
    interpolated,
    smooth_points,
    smooth_rotations,
)
from geneoh.objects.symmetry import Symmetry, find_symmetry
from geneoh.sequence.sequence import ObjectTrack
from geneoh.sequence.windows import runs

QUIET_FRAMES, QUIET_SHARE = 15, 0.1
"""The noise is measured in the calmest tenth of all stretches of this many frames: an exact track
rests there, whereas a noisy one shakes always."""
TURN_CHANGE, PLACE_CHANGE, MOTION_LIMIT = 0.21, 0.06, 5.0
"""Limits of the change between consecutive steps of a part: 12 degrees and 6 cm at 30 frames a
second, more at lower frame rates, or `MOTION_LIMIT` times its median step."""
NOISE_LIMIT, LARGEST_NOISE_LIMIT = 10.0, np.pi / 3
"""Change between consecutive steps that noise makes where it is largest, in standard deviations per
axis, and the largest such limit, radians: flips are of at least a quarter turn."""
STEADY_RATIO = 30.0
"""Largest second difference of a part's position, in standard deviations of its noise, with which
the position is used in frames where the rotation jumps."""
ACCEPTED_SECONDS = 4 / 3
"""Duration in seconds after which a pose beyond a jump is accepted: twice that for a hand
(`geneoh.sequence.shots`), because cleaning against a flipped object is worse than without any."""
LEAP = 0.04
"""Least step of a part that leaps elsewhere and comes back, metres at 30 frames a second."""
LOCAL_FRAMES, UNEVEN = 31, 1.5
"""Frames of the windows in which noise is measured apart, and ratio of the largest noise in one to
that in all frames from which it is used: up to 1.4 where noise is even, from 1.5 to 6 where an
object jitters only while a hand covers it."""
SHAKES_LOCALLY = 2.0
"""Rotational noise of a window, in units of the largest of an exact track, above which that is not
exact: motion capture has at most 0.7 anywhere."""
CHI3_QUARTILE = 1.101  # lower quartile of the length of three standard normal variables
LEAST_STRETCH = 6  # least number of kept frames in a stretch between jumps that is smoothed


FrameNoise = Float64[np.ndarray, " T"]
LocalNoise = list[tuple[float, float]]
Poses = tuple[Float64[np.ndarray, "T 3 3"], Float64[np.ndarray, "T 3"]]


@dataclass(frozen=True)
class CleanPart:
    """The clean poses of one part, and its examination; see `ObjectExamination`."""

    poses: Poses
    aligned: Poses
    confidence: Float64[np.ndarray, " T"]
    left_out: Bool[np.ndarray, " T"]
    symmetric: Bool[np.ndarray, " T"]
    doubted: Bool[np.ndarray, " T"]
    rotation_noise: Float64[np.ndarray, " T"]
    translation_noise: Float64[np.ndarray, " T"]
    is_noisy: bool = False


def clean_object(
    motion: ObjectTrack, fps: float, palms: tuple[RigidMotion, ...] = ()
) -> tuple[ObjectTrack, ObjectExamination]:
    """The object's track without noise, and its examination; the same track object if all parts are
    exact. `palms` are those of the input hands, in the same frames."""
    rotation = motion.rotation.double().cpu().numpy()
    translation = motion.translation.double().cpu().numpy()
    seen = motion.observed.cpu().numpy()
    parts = [
        clean_part((rotation[:, part], translation[:, part]), mesh, fps, seen[:, part], palms)
        for part, mesh in enumerate(motion.meshes)
    ]

    def stacked(name: str) -> Tensor:
        values = np.stack([np.asarray(getattr(part, name)) for part in parts], axis=-1)
        dtype = torch.bool if values.dtype == bool else torch.float32
        return torch.from_numpy(values).to(motion.rotation.device, dtype)

    def track(poses: list[Poses]) -> ObjectTrack:
        turns, places = (torch.from_numpy(np.stack(v, axis=1)) for v in zip(*poses, strict=True))
        return replace(
            motion, rotation=turns.to(motion.rotation), translation=places.to(motion.translation)
        )

    found = {f.name: stacked(f.name) for f in fields(ObjectExamination) if f.name != "aligned"}
    examined = ObjectExamination(**found, aligned=track([part.aligned for part in parts]))
    if not any(part.is_noisy for part in parts):
        return motion, examined
    return track([part.poses for part in parts]), examined


def clean_part(
    poses: Poses,
    mesh: Mesh,
    fps: float,
    seen: Bool[np.ndarray, " T"],
    palms: tuple[RigidMotion, ...],
) -> CleanPart:
    """One part's track without noise, and its examination. Frames that are not `seen` are filled,
    and have zero weight and confidence."""
    nowhere = np.zeros(len(seen), dtype=bool)
    none = np.zeros(len(seen))
    exact = CleanPart(poses, poses, seen.astype(float), nowhere, nowhere, nowhere, none, none)
    if seen.sum() < LEAST_FRAMES:  # noise and motion cannot be distinguished
        return exact
    rotations, places = Rotation.from_matrix(poses[0]), poses[1]
    middle = mesh.center().double().cpu().numpy()
    world = RigidMotion(rotations, rotations.apply(middle) + places, seen)
    views = Views.of(world, palms)
    shakes = is_shaky(views, fps)
    somewhere = shakes or loudest(local_noise(views)) > local_bound(fps)
    limit = step_limit(increments(rotations), TURN_CHANGE, fps)
    turns_agree = world.turn_changes().max() < views.limit(limit, RigidMotion.turn_changes)
    if not somewhere and turns_agree and steady_places(views, fps).all():
        return exact
    symmetry = symmetry_of(mesh)
    limit = step_limit(least_steps(poses[0], symmetry), TURN_CHANGE, fps)
    limit = views.limit(limit, RigidMotion.turn_changes)
    chain, world, center = _aligned(poses, seen, symmetry, limit, fps)
    turning = Views.of(replace(world, seen=chain.kept), palms)
    # where noise is largest, it alone may exceed the limit
    views = Views.of(world, palms)
    local = local_noise(views, lower_quartile)
    if is_uneven(local, views, fps):
        limit = max(limit, min(NOISE_LIMIT * loudest(local), LARGEST_NOISE_LIMIT))
        chain, world, center = _aligned(poses, seen, symmetry, limit, fps)
        turning = Views.of(replace(world, seen=chain.kept), palms)
    local = local_noise(turning)
    shakes = shakes or (somewhere and loudest(local) > local_bound(fps))
    views = Views.of(world, palms)
    noise = noise_of_frames(turning, views, local if is_uneven(local, turning, fps) else [])
    return _smoothed(views, noise, center, chain, shakes, fps)


def _aligned(
    poses: Poses, seen: Bool[np.ndarray, " T"], symmetry: Symmetry, limit: float, fps: float
) -> tuple[Chain, RigidMotion, Float64[np.ndarray, " 3"]]:
    """The chain of a part's rotations whose steps change by at most `limit`, radians; the part's
    motion with symmetry flips undone, of its steadiest point; and this point in its frame."""
    rotations, places = Rotation.from_matrix(poses[0]), poses[1]
    chain = longest_chain(rotations, limit, symmetry, fps, ACCEPTED_SECONDS)
    chain = replace(chain, kept=chain.kept & seen)
    # symmetry rotations keep the center fixed
    middles = rotations.apply(symmetry.center) + places
    rotations = rotations * Rotation.from_matrix(chain.onto_itself)
    places = middles - rotations.apply(symmetry.center)
    center = steadiest(rotations, places, (symmetry.center, np.zeros(3)))
    return chain, RigidMotion(rotations, rotations.apply(center) + places, seen), center


def symmetry_of(mesh: Mesh) -> Symmetry:
    """The symmetry of a mesh, cached because a stream needs it for every window."""
    return _kept_symmetry(mesh.copied())


@lru_cache(maxsize=8)
def _kept_symmetry(mesh: Mesh) -> Symmetry:
    return find_symmetry(SurfaceDistance(mesh))


def is_shaky(views: Views, fps: float) -> bool:
    """Whether the rotation or the centre of a part has more noise than an exact track."""
    bound = seeming_noise(fps)
    turns = views.turn_noise(quietest) > bound * EXACT_ROTATION
    return turns or views.place_noise(quietest) > bound * EXACT_TRANSLATION


def seeming_noise(fps: float) -> float:
    """How much more noise an exact track seems to have than at 30 frames a second: its motion from
    frame to frame is the larger, the fewer frames there are."""
    return max(1.0, (30 / fps) ** 2)


def local_bound(fps: float) -> float:
    """Rotational noise of a window, radians, above which the track is not exact there."""
    return seeming_noise(fps) * SHAKES_LOCALLY * EXACT_ROTATION


def local_noise(views: Views, summary: Summary = np.median) -> LocalNoise:
    """Middle frame of each window, and white noise per axis of the rotation in it, radians."""
    return [(middle, window.turn_noise(summary)) for middle, window in views.windows(LOCAL_FRAMES)]


def loudest(local: LocalNoise) -> float:
    """The largest noise of all windows; zero if there are none."""
    return max((noise for _, noise in local), default=0.0)


def is_uneven(local: LocalNoise, views: Views, fps: float) -> bool:
    """Whether a window has clearly more noise than an exact track, and than all frames together."""
    return loudest(local) > max(UNEVEN * views.turn_noise(), local_bound(fps))


def noise_of_frames(
    turning: Views, views: Views, uneven: LocalNoise
) -> tuple[FrameNoise, FrameNoise]:
    """White noise of each frame, of the rotation in `turning` and of the position in `views`: as in
    all frames, or as in the windows around it where that of the rotation is `uneven`. That of the
    position alone does not tell, since a hand that shakes the object adds its own."""
    count = len(views.world.seen)
    least = EXACT_ROTATION / 4, EXACT_TRANSLATION / 4
    if not uneven:
        whole = max(turning.turn_noise(), least[0]), max(views.place_noise(), least[1])
        return np.full(count, whole[0]), np.full(count, whole[1])
    places = [(middle, window.place_noise()) for middle, window in views.windows(LOCAL_FRAMES)]
    first, second = (
        # the median over a window shows too little at its onset
        np.interp(np.arange(count), middles, maximum_filter1d(noise, 3)).clip(floor)
        for (middles, noise), floor in zip(map(np.transpose, (uneven, places)), least, strict=True)
    )
    return first, second


def _smoothed(
    views: Views,
    noise: tuple[FrameNoise, FrameNoise],
    center: Float64[np.ndarray, " 3"],
    chain: Chain,
    shakes: bool,
    fps: float,
) -> CleanPart:
    """A part's track from its chain: smoothed if it shakes, else unchanged in kept frames.

    `views` has the positions of the point `center` of the part; `noise` is that of the rotation and
    of this position.
    """
    rotations, middles, seen = views.world.turns, views.world.places, views.world.seen
    places = middles - rotations.apply(center)
    there = steady_places(views, fps) & seen
    clean, weight = smooth_stretches(rotations, chain, noise[0])
    placed = steady(middles, chain.kept, noise[1]) & there
    if placed.sum() < 2:  # position and rotation are possible in other frames each
        placed = seen
    if shakes:
        middles, sure = smooth_points(middles, placed, noise[1])
        weight = np.minimum(weight, sure)
    else:  # frames that agree are exact
        kept, weight = chain.kept[:, None, None], weight * there
        middles = interpolated(middles, placed)
        clean = Rotation.from_matrix(np.where(kept, rotations.as_matrix(), clean.as_matrix()))
    changed = np.abs(chain.onto_itself - np.eye(3)).max((1, 2)) > 1e-3
    return CleanPart(
        (clean.as_matrix(), middles - clean.apply(center)),
        (rotations.as_matrix(), places),
        weight,
        ~(chain.kept & there) & seen,
        chain.kept & changed,
        chain.doubted & seen,
        *noise,
        is_noisy=True,
    )


def steadiest(
    rotations: Rotation, places: Float64[np.ndarray, "T 3"], points: tuple[np.ndarray, ...]
) -> Float64[np.ndarray, " 3"]:
    """The centre of a part's rotational noise: of some points, the one of least acceleration."""
    bends = [np.diff(rotations.apply(point) + places, n=2, axis=0) for point in points]
    return points[int(np.argmin([np.linalg.norm(bend, axis=1).mean() for bend in bends]))]


def steady(
    places: Float64[np.ndarray, "T 3"],
    kept: Bool[np.ndarray, " T"],
    noise: Float64[np.ndarray, " T"],
) -> Bool[np.ndarray, " T"]:
    """Kept frames, and runs of other frames without a jump of the position at their ends."""
    bends = np.linalg.norm(np.diff(places, n=2, axis=0), axis=1)
    jumps = np.pad(bends > STEADY_RATIO * noise[1:-1], 1, mode="edge")
    found = kept.copy()
    for run in runs(~kept):
        edges = np.array([run.start - 1, run.start, run.stop - 1, run.stop])
        found[run] = not jumps[edges.clip(0, len(kept) - 1)].any()
    return found


def steady_places(views: Views, fps: float) -> Bool[np.ndarray, " T"]:
    """Frames with a position of a part's centre that possible motion reaches, and to which it does
    not leap for a while, in the world or in a palm."""
    places = views.world.places
    limit = step_limit(np.diff(places, axis=0), PLACE_CHANGE, fps)
    limit = views.limit(limit, RigidMotion.place_changes)
    found = possible_places(places, limit, fps, ACCEPTED_SECONDS)
    briefly = ACCEPTED_SECONDS - 1 / fps
    found = found & ~there_and_back(places, LEAP, fps, briefly)
    for palm, seen in views.from_calm_palms():
        leaps = there_and_back(seen.places, LEAP, fps, briefly)
        found = found & ~of_the_part(leaps, places, palm.places)
    return found


def of_the_part(
    leaps: Bool[np.ndarray, " T"],
    part: Float64[np.ndarray, "T 3"],
    palm: Float64[np.ndarray, "T 3"],
) -> Bool[np.ndarray, " T"]:
    """Of the frames between leaps of a part in the frame of a palm, those of leaps of the part: in
    the world its step changes by more than that of the palm at the leaps. Else the palm leaps, as
    in a gross error of the hand's tracker. Positions are in the world, metres."""
    found = leaps.copy()
    changes = [np.linalg.norm(np.diff(each, n=2, axis=0), axis=1) for each in (part, palm)]
    for run in runs(leaps):
        steps = np.array([run.start - 1, run.stop - 1])  # changes i - 1 and i are beside step i
        beside = np.concatenate([steps - 1, steps]).clip(0, len(changes[0]) - 1)
        of_part, of_palm = (each[beside].max() for each in changes)
        found[run] = of_part > of_palm
    return found


def step_limit(steps: np.ndarray, change: float, fps: float) -> float:
    """Limit of the change between consecutive steps: `change` at 30 frames a second, or more if the
    part's median step is large; `steps` are (N, 3), radians or metres."""
    return max(change * 30 / fps, MOTION_LIMIT * float(np.median(np.linalg.norm(steps, axis=1))))


def least_steps(turns: np.ndarray, symmetry: Symmetry) -> np.ndarray:
    """Rotation steps (N, 3) between neighbouring frames, each after the best symmetry rotation."""
    each = [a.T @ b @ symmetry.nearest(b, a[None])[0][0] for a, b in pairwise(turns)]
    return Rotation.from_matrix(np.stack(each)).as_rotvec()


def quietest(lengths: Float64[np.ndarray, " N"]) -> float:
    """Median length of a track's differences, in its calmest stretches."""
    starts = range(0, max(1, len(lengths) - QUIET_FRAMES + 1), QUIET_FRAMES // 3)
    levels = [np.median(lengths[start : start + QUIET_FRAMES]) for start in starts]
    return float(np.quantile(levels, QUIET_SHARE))


def lower_quartile(lengths: Float64[np.ndarray, " N"]) -> float:
    """The median length of a track's differences by their lower quartile, which many jumps between
    quiet frames do not raise."""
    return float(np.quantile(lengths, 0.25)) * CHI3_MEDIAN / CHI3_QUARTILE


def smooth_stretches(
    rotations: Rotation, chain: Chain, noise: Float64[np.ndarray, " T"]
) -> tuple[Rotation, np.ndarray]:
    """Smooth each stretch between jumps independently; too short ones are unchanged."""
    matrices, weight = rotations.as_matrix(), chain.kept.astype(float)
    for span in chain.stretches():
        if chain.kept[span].sum() >= LEAST_STRETCH:
            smooth, weight[span] = smooth_rotations(rotations[span], chain.kept[span], noise[span])
            matrices[span] = smooth.as_matrix()
    return Rotation.from_matrix(matrices), weight
