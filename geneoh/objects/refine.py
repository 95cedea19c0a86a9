"""Refine the object's track with clean hands (`--refine-object`): remove drift of its poses.

Drift looks like motion, but an object moves only if a hand moves it. So the track and the drift of
its observation are solved for jointly, by least squares over all frames: the object is made to rest
in the world or in a hand wherever drift alone may explain its motion there. An object in a loose
grip returns to the same pose in the hand (`geneoh.objects.holding`). The size of the drift is
estimated by `geneoh.objects.drift`. No pose moves farther from the smooth track than its noise
explains. In long gaps, which least squares cannot bridge, the object moves with the clean hands
(`geneoh.objects.held_in_gaps`).
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import torch
from jaxtyping import Bool, Float64
from scipy import sparse
from scipy.ndimage import uniform_filter1d
from scipy.sparse.linalg import spsolve
from scipy.spatial.transform import Rotation

from geneoh.objects.cleaning import steadiest, symmetry_of
from geneoh.objects.drift import DRIFT_SECONDS, size_of_drift
from geneoh.objects.examination import EXACT_ROTATION, EXACT_TRANSLATION, ObjectExamination
from geneoh.objects.held_in_gaps import held_in_gaps
from geneoh.objects.holding import (
    RADIANS_PER_METRE,
    REST_LAG,
    REWEIGHTINGS,
    SHORTEST_GRIP,
    Frame,
    Grip,
    PartTrack,
    Track,
    could_rest,
    frame_of,
    grip_of,
)
from geneoh.objects.palms import palm_of, world_path
from geneoh.objects.smoothing import DAMPING, FREEDOM, LEAST_ACCELERATION, WINDOW
from geneoh.sequence.sequence import HandTrack, ObjectTrack
from geneoh.sequence.windows import in_long_runs

FREE_DRIFT = 0.3
"""Standard deviation of the drift where the object neither rests nor is held, in units of the
noise: drift and motion cannot be distinguished there."""
LARGEST_CHANGE = 3.0
"""Largest distance of a pose from the smooth track, standard deviations of the noise."""
BRIDGED = 0.35
"""Longest gap of the poses that least squares bridge better than the motion of hands, seconds."""


def refine_object(
    smooth: ObjectTrack, examined: ObjectExamination, hands: Sequence[HandTrack], fps: float
) -> ObjectTrack:
    """The track without drift; exact poses are unchanged, and so is a part with fewer known poses
    than a grip needs, whose motion would be extrapolated.

    All poses of a part that was ever seen become valid, so that no reader fills them again.
    `smooth` is the cleaned track (`geneoh.objects.cleaning`) and `examined` the examination of the
    input track; the hands are clean, with joints and pose.
    """
    if len(smooth.rotation) <= REST_LAG + 1:
        return smooth
    rotation, translation = smooth.rotation.clone(), smooth.translation.clone()
    lost = examined.confidence == 0
    unsure = (examined.is_noisy | lost) & ((~lost).sum(0) >= SHORTEST_GRIP)
    for part in torch.nonzero(unsure.any(0))[:, 0].tolist():
        turns, places = refine_part(smooth, examined, part, hands, fps)
        chosen = unsure[:, part]
        rotation[chosen, part] = torch.from_numpy(turns).to(rotation)[chosen]
        translation[chosen, part] = torch.from_numpy(places).to(translation)[chosen]
    found = replace(smooth, rotation=rotation, translation=translation)
    gaps = (lost & unsure & ~examined.left_out).cpu().numpy()
    long = np.stack([in_long_runs(part, BRIDGED * fps) for part in gaps.T], 1)
    known = torch.from_numpy(~long).to(lost.device)
    found = held_in_gaps(replace(found, valid=known), map(palm_of, hands))
    valid = None if smooth.valid is None else smooth.valid.any(0).expand_as(smooth.valid)
    return replace(found, valid=valid)


def refine_part(
    smooth: ObjectTrack,
    examined: ObjectExamination,
    part: int,
    hands: Sequence[HandTrack],
    fps: float,
) -> tuple[Float64[np.ndarray, "T 3 3"], Track]:
    """Refined rotations and translations of one part."""
    first, seen = poses_of(smooth, part), poses_of(examined.aligned, part)
    # the point at which the noise was measured
    center = steadiest(*seen, (symmetry_of(smooth.meshes[part]).center, np.zeros(3)))
    first, seen = ((turns, turns.apply(center) + places) for turns, places in (first, seen))
    confidence = examined.confidence[:, part].double().cpu().numpy()
    lost = (confidence == 0) & ~examined.left_out[:, part].cpu().numpy()
    own = (
        examined.rotation_noise[:, part].double().cpu().numpy().clip(EXACT_ROTATION / 4),
        examined.translation_noise[:, part].double().cpu().numpy().clip(EXACT_TRANSLATION / 4),
    )
    noise = float(own[0].max()), float(own[1].max())
    squared = np.square(seen[1] - first[1]).sum(1) / own[1] ** 2
    weights = (
        confidence * (noise[0] / own[0]) ** 2,
        ~lost * (FREEDOM + 3) / (FREEDOM + squared) * (noise[1] / own[1]) ** 2,
    )
    known = confidence > 0
    turned = world_path(first[0]) + (seen[0] * first[0].inv()).as_rotvec()
    shakes = (noise[0] > EXACT_ROTATION, turned), (noise[1] > EXACT_TRANSLATION, seen[1])
    observed = [values / size for size, (noisy, values) in zip(noise, shakes, strict=True) if noisy]
    share = size_of_drift(observed, known, fps)
    track = PartTrack(*first, noise, (share * noise[0], share * noise[1]), known)
    frames = [
        Frame.of_world(len(lost)),
        *(frame_of(hand, smooth, part, track.known) for hand in hands),
    ]
    grips = [grip_of(frame, track) for frame in frames[1:]]
    frames = [replace(f, near=f.near & could_rest(f, track)) for f in frames]
    start = first
    for grip in grips:
        start = grip.taken(start, lost)
    turns, places = _resting(
        frames, grips, start, seen, weights, track, np.exp(-1 / (DRIFT_SECONDS * fps))
    )
    step = bounded((turns * first[0].inv()).as_rotvec(), own[0], track.known)
    turns = Rotation.from_rotvec(step) * first[0]
    places = first[1] + bounded(places - first[1], own[1], ~lost)
    return turns.as_matrix(), places - turns.apply(center)


def poses_of(track: ObjectTrack, part: int) -> tuple[Rotation, Track]:
    """Rotations and translations of one part."""
    turns = Rotation.from_matrix(track.rotation[:, part].double().cpu().numpy())
    return turns, track.translation[:, part].double().cpu().numpy()


def _resting(
    frames: list[Frame],
    grips: list[Grip],
    first: tuple[Rotation, Track],
    seen: tuple[Rotation, Track],
    weights: tuple[np.ndarray, np.ndarray],
    track: PartTrack,
    stay: float,
) -> tuple[Rotation, Track]:
    """Rotations and positions of least energy, initialised with `first`, by iteratively reweighted
    least squares; `stay` is the drift's correlation between neighbouring frames."""
    turns, places = first
    sizes = tuple(zip(track.noise, track.drift, strict=True))
    start = np.arange(len(places) - 1)
    second = fading_differences(track.known)
    bends = [np.asarray(second @ path) for path in (world_path(turns), places)]
    stiff = [
        1 / (uniform_filter1d(np.square(bend).mean(1), WINDOW) + (LEAST_ACCELERATION * size) ** 2)
        for bend, size in zip(bends, track.noise, strict=True)
    ]
    loose = ~np.any([frame.near for frame in frames], axis=0) / FREE_DRIFT**2
    loose = np.append(loose, loose[-1])
    for share in np.linspace(0, 1, REWEIGHTINGS):
        left = [frame.left(turns, places, start) for frame in frames]
        motion = [frame.step(start) for frame in frames]
        scales = [frame.scale[0] * (frame.scale[1] / frame.scale[0]) ** share for frame in frames]
        still = [
            frame.near * stillness(*step, size) / size**2
            for frame, step, size in zip(frames, left, scales, strict=True)
        ]
        moves = [(turn, shift, w) for (turn, shift), w in zip(motion, still, strict=True)]
        held = [(grip.places, grip.weights[1]) for grip in grips]
        bend = second, 0 * bends[1], stiff[1]
        places = solve(seen[1], weights[1], sizes[1], stay, loose, held, moves, bend)
        moves = [
            (turn, -turned, w / RADIANS_PER_METRE**2)
            for (turn, _), (turned, _), w in zip(motion, left, still, strict=True)
        ]
        gap = (seen[0] * turns.inv()).as_rotvec()
        bend = second, -second @ world_path(turns), stiff[0]
        held = [((grip.turns * turns.inv()).as_rotvec(), grip.weights[0]) for grip in grips]
        step = solve(gap, weights[0], sizes[0], stay, loose, held, moves, bend)
        turns = Rotation.from_rotvec(step) * turns
    return turns, places


def stillness(turned: np.ndarray, shifted: np.ndarray, size: float) -> Float64[np.ndarray, " N"]:
    """Robust weight of rest, from 1 for zero steps around each one to 0 for large ones in units of
    `size`."""
    units = np.square(shifted).mean(1) + np.square(turned / RADIANS_PER_METRE).mean(1)
    units = units / size**2
    return 1 / (1 + uniform_filter1d(units, WINDOW, mode="nearest")) ** 2


def fading_differences(known: Bool[np.ndarray, " T"]) -> sparse.csr_matrix:
    """Second differences of a track as a matrix (T - 2, T), which are zero for a track whose
    velocity fades before the first and after the last known frame as in `damped_ends`."""
    first, last = np.flatnonzero(known)[[0, -1]]
    one, frames = sparse.csr_matrix(sparse.identity(len(known))), np.arange(1, len(known) - 1)
    ahead, behind = (
        sparse.csr_matrix(sparse.diags(np.where(fades, DAMPING, 1.0)))
        for fades in (frames < first, frames > last)
    )
    return ahead @ (one[2:] - one[1:-1]) - behind @ (one[1:-1] - one[:-2])


def solve(
    seen: Track,
    weight: np.ndarray,
    sizes: tuple[float, float],
    stay: float,
    loose: np.ndarray,
    held: list[tuple[np.ndarray, np.ndarray]],
    moves: list[tuple[np.ndarray, np.ndarray, np.ndarray]],
    bend: tuple[sparse.csr_matrix, np.ndarray, np.ndarray],
) -> Track:
    """The track x of least energy, solved for jointly with the drift d of its observation.

    Args:
        seen: observations x + d + white noise, with the `weight` of each frame.
        sizes: standard deviations of the white noise and of the drift.
        stay: correlation of the drift between neighbouring frames.
        loose: additional precision of the drift in each frame, in units of its own.
        held: for each hand, the target points (T, 3) of x by its grip, and their weights (T,).
        moves: for each frame of reference, the rotations (N, 3, 3) and translations (N, 3) that
            move a resting x from one frame to the next, and their weights (N,).
        bend: the second differences of each coordinate as a matrix (T - 2, T), their targets
            (T - 2, 3), and their weights (T - 2,).
    """
    count = len(seen)
    one = sparse.csr_matrix(sparse.identity(count))
    ahead, behind = one[1:], one[:-1]
    observed = each(weight) / sizes[0] ** 2
    drift = ahead - stay * behind
    drift = drift.T @ drift / (1 - stay**2)
    drift = sparse.kron(drift + sparse.diags(loose) + one[:1].T @ one[:1], sparse.identity(3))
    matrix, right = sparse.csr_matrix((3 * count, 3 * count)), np.zeros(3 * count)
    second, goal, stiff = bend
    rows = [(each(stiff), triple(second), goal)]
    rows += [(each(worth), triple(one), goal) for goal, worth in held]
    for turn, shift, worth in moves:
        blocks = [sparse.coo_matrix(one_turn) for one_turn in turn]  # scipy warns of bare arrays
        back = sparse.csr_matrix(sparse.block_diag(blocks)) @ triple(behind)
        rows.append((each(worth), triple(ahead) - back, shift))
    for worth, row, goal in rows:
        matrix = matrix + row.T @ worth @ row
        right += row.T @ worth @ goal.ravel()
    both = sparse.bmat(
        [[matrix + observed, observed], [observed, drift / sizes[1] ** 2 + observed]], format="csc"
    )
    known = observed @ seen.ravel()
    found = np.asarray(spsolve(both, np.concatenate([right + known, known])))
    return found[: 3 * count].reshape(count, 3)


def each(values: np.ndarray) -> sparse.csr_matrix:
    """Diagonal matrix of per-frame weights, repeated for three coordinates."""
    return sparse.csr_matrix(sparse.diags(np.repeat(values, 3)))


def triple(matrix: sparse.csr_matrix) -> sparse.csr_matrix:
    """A matrix over frames, extended to three coordinates per frame."""
    return sparse.csr_matrix(sparse.kron(matrix, sparse.identity(3)))


def bounded(step: Track, noise: Float64[np.ndarray, " T"], seen: Bool[np.ndarray, " T"]) -> Track:
    """The change `step`, in seen frames limited to `LARGEST_CHANGE` deviations of the noise."""
    length = np.linalg.norm(step, axis=1)
    share = np.minimum(1, LARGEST_CHANGE * 3**0.5 * noise / length.clip(1e-12))
    return np.where(seen, share, 1)[:, None] * step
