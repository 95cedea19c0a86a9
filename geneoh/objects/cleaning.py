"""The object's track: how noisy it is, and the track that is left when the noise is taken out.

The hand is denoised in the object's frame, so what shakes the object shakes the hand. The track is
examined first, without the hand: its white noise, from its own fourth differences; the frames that
no possible motion reaches; the rotations that a symmetric mesh cannot tell apart. A track that is
found exact is returned as it is.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import torch
from jaxtyping import Bool, Float
from scipy.spatial.transform import Rotation
from torch import Tensor

from geneoh.geometry.distance import SurfaceDistance
from geneoh.geometry.mesh import Mesh
from geneoh.objects.consistency import Chain, longest_chain
from geneoh.objects.smoothing import increments, noise_level, smooth_points, smooth_rotations
from geneoh.objects.symmetry import Symmetry, find_symmetry
from geneoh.sequence.sequence import ObjectTrack

EXACT_ROTATION, EXACT_TRANSLATION = 0.006, 0.0004
"""White noise per axis up to which a track of 30 frames a second counts as exact, radians and
metres: motion capture has 0.003 and 0.00016. At fewer frames a second motion itself looks like
noise, with the square of the time between frames, and the bounds grow with it."""
QUIET_FRAMES, QUIET_SHARE = 15, 0.1
"""A track is as noisy as in the calmest tenth of its stretches of so many frames: an exact one
rests there, one that shakes does so always."""
TURN_RATE, MOTION_LIMIT = 6.3, 5.0
"""A part may turn by one revolution a second (radians a second), or from one frame to the next by
so many times its median turn."""
SHORTEST = 6
"""Frames below which noise cannot be told from motion."""


@dataclass(frozen=True)
class PartExamination:
    """What a part's track says about its own noise."""

    rotation_noise: float
    """Deviation of white noise per axis, radians."""
    translation_noise: float
    """Deviation of white noise per axis, metres."""
    confidence: Float[Tensor, " T"]
    """How much each frame agrees with the others, 0 (left out) to 1."""
    left_out: Bool[Tensor, " T"]
    """Frames whose rotation no possible motion reaches."""
    symmetric: Bool[Tensor, " T"]
    """Frames whose rotation was changed by one of the mesh onto itself."""
    is_noisy: bool
    """Whether the track was cleaned at all."""

    def sentences(self, part: str) -> Iterator[str]:
        """What a user should know, where there is anything."""
        if not self.is_noisy:
            return
        yield (
            f"the pose of {part} shakes by {np.degrees(self.rotation_noise):.1f} degrees and "
            f"{1000 * self.translation_noise:.1f} mm per axis; the hand was cleaned against a "
            "smooth track of it"
        )
        if count := int(self.left_out.sum()):
            yield f"{count} frames in which the pose of {part} jumps were left out"
        if count := int(self.symmetric.sum()):
            yield f"{count} frames in which {part} is turned by its own symmetry were turned back"


def clean_object(
    motion: ObjectTrack, fps: float
) -> tuple[ObjectTrack, tuple[PartExamination, ...]]:
    """The object's track without its noise, and what was found in each part.

    The very same track comes back where all parts are exact. Nothing is asked of the hand.
    """
    rotation, translation = motion.rotation.clone(), motion.translation.clone()
    found = []
    for part, mesh in enumerate(motion.meshes):
        turns = motion.rotation[:, part].cpu().double().numpy()
        places = motion.translation[:, part].cpu().double().numpy()
        clean_turns, clean_places, examined = clean_part(turns, places, mesh, fps)
        if examined.is_noisy:
            rotation[:, part] = torch.from_numpy(clean_turns).to(rotation)
            translation[:, part] = torch.from_numpy(clean_places).to(translation)
        found.append(examined)
    if not any(examined.is_noisy for examined in found):
        return motion, tuple(found)
    return replace(motion, rotation=rotation, translation=translation), tuple(found)


def clean_part(
    turns: np.ndarray, places: np.ndarray, mesh: Mesh, fps: float
) -> tuple[np.ndarray, np.ndarray, PartExamination]:
    """One part's rotations (T, 3, 3) and translations (T, 3), cleaned, and what was found."""
    frames = len(turns)
    everywhere, nowhere = torch.ones(frames), torch.zeros(frames, dtype=torch.bool)
    exact = PartExamination(0.0, 0.0, everywhere, nowhere, nowhere, is_noisy=False)
    if frames < SHORTEST:
        return turns, places, exact
    rotations = Rotation.from_matrix(turns)
    center = (mesh.verts.amax(0) + mesh.verts.amin(0)).double().cpu().numpy() / 2
    middles = rotations.apply(center) + places  # where noise of the rotation moves nothing
    steps = increments(rotations)
    fourth_turns, fourth_places = np.diff(steps, n=3, axis=0), np.diff(middles, n=4, axis=0)
    bound = max(1.0, (30 / fps) ** 2)
    shakes = quiet_noise(fourth_turns) > bound * EXACT_ROTATION
    shakes |= quiet_noise(fourth_places) > bound * EXACT_TRANSLATION
    if not shakes and np.linalg.norm(steps, axis=1).max() < step_limit(steps, fps):
        return turns, places, exact
    symmetry = find_symmetry(SurfaceDistance(mesh))
    limit = step_limit(least_steps(turns, symmetry), fps)
    chain = longest_chain(rotations, limit, symmetry)
    rotations = rotations * Rotation.from_matrix(chain.onto_itself)
    rotation_noise = noise_level(fourth_differences(rotations, chain.kept), 4)
    translation_noise = noise_level(fourth_places, 4)
    clean, weight = smooth_stretches(rotations, chain, max(rotation_noise, EXACT_ROTATION / 4))
    if shakes:
        everywhere = np.ones(frames, dtype=bool)
        noise = max(translation_noise, EXACT_TRANSLATION / 4)
        middles, sure = smooth_points(middles, everywhere, noise)
        weight = np.minimum(weight, sure)
    else:  # frames that agree are exact
        kept = chain.kept[:, None, None]
        clean = Rotation.from_matrix(np.where(kept, rotations.as_matrix(), clean.as_matrix()))
    changed = np.abs(chain.onto_itself - np.eye(3)).max((1, 2)) > 1e-3
    examined = PartExamination(
        rotation_noise,
        translation_noise,
        confidence=torch.from_numpy(weight).float(),
        left_out=torch.from_numpy(~chain.kept),
        symmetric=torch.from_numpy(chain.kept & changed),
        is_noisy=True,
    )
    return clean.as_matrix(), middles - clean.apply(center), examined


def step_limit(steps: np.ndarray, fps: float) -> float:
    """Radians that a part may turn from one frame to the next, by its own steps (N, 3)."""
    return max(TURN_RATE / fps, MOTION_LIMIT * float(np.median(np.linalg.norm(steps, axis=1))))


def least_steps(turns: np.ndarray, symmetry: Symmetry) -> np.ndarray:
    """The steps (N, 3) between neighbouring frames, each after the best rotation onto itself."""
    onto = [symmetry.nearest(b, a[None])[0][0] for a, b in pairwise(turns)]
    return np.stack(
        [
            Rotation.from_matrix(a.T @ b @ onto[i]).as_rotvec()
            for i, (a, b) in enumerate(pairwise(turns))
        ]
    )


def fourth_differences(rotations: Rotation, kept: np.ndarray) -> np.ndarray:
    """Fourth differences (N, 3) of a rotation where five frames in a row are kept, else all."""
    found = np.diff(increments(rotations), n=3, axis=0)
    whole = np.convolve(kept, np.ones(5), "valid") > 4
    return found[whole] if whole.any() else found


def quiet_noise(fourth: np.ndarray) -> float:
    """The noise of the calmest stretches of a track, from its fourth differences (N, 3)."""
    starts = range(0, max(1, len(fourth) - QUIET_FRAMES + 1), QUIET_FRAMES // 3)
    levels = [noise_level(fourth[start : start + QUIET_FRAMES], 4) for start in starts]
    return float(np.quantile(levels, QUIET_SHARE))


def smooth_stretches(
    rotations: Rotation, chain: Chain, noise: float
) -> tuple[Rotation, np.ndarray]:
    """Each stretch between jumps smoothed by itself; too short ones as they are."""
    matrices, weight = rotations.as_matrix(), chain.kept.astype(float)
    for span in chain.stretches():
        if chain.kept[span].sum() >= SHORTEST:
            smooth, weight[span] = smooth_rotations(rotations[span], chain.kept[span], noise)
            matrices[span] = smooth.as_matrix()
    return Rotation.from_matrix(matrices), weight
