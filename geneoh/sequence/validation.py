"""Plausibility of a sequence: metres, radians, rigid motion, a hand that comes near its object.

Shapes are checked where tracks are built, magnitudes here. The limits are far outside the range of
hand motion, so that noise does not reach them.
"""

from dataclasses import replace

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from geneoh.errors import InputError
from geneoh.geometry.distance import pairwise_distances
from geneoh.geometry.mesh import checked_mesh
from geneoh.geometry.rotations import is_rotation
from geneoh.hand.skeleton import LARGEST_HAND, SMALLEST_HAND
from geneoh.sequence.distance_check import check_distance, least_distance
from geneoh.sequence.sequence import HandTrack, ObjectTrack, Sequence

LARGEST_ANGLE = 4 * torch.pi
"""Largest length of an axis-angle vector, radians. Pi is enough for every rotation; vectors in
degrees are longer."""

SMALLEST_FPS, LARGEST_FPS = 1.0, 1000.0
"""Range of the frame rate. Frames more than a second apart say nothing about the motion between."""

FARTHEST_POINT = 1e4
"""Largest coordinate in metres; at ten kilometres float32 resolves about a millimetre."""

FARTHEST_SCENE = 100.0
"""Distance in metres from the world's origin beyond which hardly any recording takes place."""

UNIT_TOLERANCE = 1e-3
"""Largest deviation from 1 of the length of a unit vector."""

WRIST_APART = 0.1
"""Largest median distance between `wrist` and the first keypoint, metres."""

WRIST_FROM_ORIGIN = 0.15
"""Largest distance in metres of MANO's wrist from its origin, where parameters of zero place it."""

COLLAPSED_EXTENT = 0.01
"""Extent in metres below which the keypoints of a frame are no hand: some trackers write zeros
where they found none."""

MILLIMETRE_SPAN = 40
"""Span of a hand above which its unit is millimetres; in centimetres it is about half of this."""

FLAT_RATIO = 0.02
"""Ratio of the smallest to the largest extent of keypoints along the axes, below which they lie in
a plane, as 2D keypoints do; in the example recording it is a fifth and more."""


def collapsed(hand: HandTrack) -> Bool[Tensor, " T"]:
    """Mask of valid frames in which all keypoints coincide, or all pose parameters are zero."""
    empty = torch.zeros_like(hand.valid)
    if hand.joints is not None:
        empty = (hand.joints.amax(1) - hand.joints.amin(1)).amax(-1) < COLLAPSED_EXTENT
    if hand.pose is not None and hand.wrist is not None:
        zero = (hand.pose == 0).flatten(1).all(-1) & (hand.wrist.norm(dim=-1) < WRIST_FROM_ORIGIN)
        empty = empty | (zero & bool(hand.pose[hand.valid].any()))
    return hand.valid & empty


def without_collapsed(hand: HandTrack) -> HandTrack:
    """The track with its collapsed frames not valid, unless no valid frame would remain."""
    lost = collapsed(hand)
    return replace(hand, valid=hand.valid & ~lost) if bool((hand.valid & ~lost).any()) else hand


def check_sequence(sequence: Sequence, name: str = "") -> None:
    """Refuse a sequence that cannot be an interaction in metres, radians and frames a second.

    `name` is the name of the sequence in messages, by default its source. `InputError` reports the
    first fault and its remedy. Hands must be finite wherever they are valid.
    """
    name = name or sequence.source or "the sequence"
    check_tracks(sequence, name)
    if not SMALLEST_FPS <= sequence.fps <= LARGEST_FPS:
        seconds = 1 / LARGEST_FPS <= sequence.fps < SMALLEST_FPS
        cure = f"as seconds per frame it is {1 / sequence.fps:.4g}, pass that" if seconds else ""
        raise InputError(
            f"{name}: 'fps' must be {SMALLEST_FPS:g} to {LARGEST_FPS:g} frames a second, "
            f"got {sequence.fps:g}; {cure or 'correct it'}"
        )
    for hand in sequence.hands:
        check_hand(hand, name)
    check_object(sequence.object, name)
    # The second hand may be far away from the object, so only the nearer one is checked.
    nearest = min(sequence.hands, key=lambda hand: least_distance(hand, sequence.object))
    check_distance(nearest, sequence.object, name)


def check_tracks(sequence: Sequence, name: str = "") -> None:
    """Refuse a sequence without hands or frames, with two hands of one side, unequal lengths, a
    mesh without a surface, or poses of a camera that are none."""
    name = name or sequence.source or "the sequence"
    sides = [hand.side for hand in sequence.hands]
    if not sides or len(set(sides)) < len(sides):
        got = " and ".join(sides) or "none"
        raise InputError(f"{name}: expected one hand or one of each side, got {got}; correct it")
    if not sequence.frames:
        raise InputError(f"{name}: expected at least one frame, got none; choose others")
    for hand in sequence.hands:
        if hand.frames != sequence.frames:
            raise InputError(
                f"{name}: hand and object must have the same number of frames, got {hand.frames} "
                f"for the {hand.side} hand and {sequence.frames} for the object; "
                "cut them to the same frames"
            )
    for mesh in sequence.object.meshes:
        checked_mesh(mesh, str(mesh.source or f"a mesh of {name}"))
    check_camera(sequence.camera_to_world, sequence.frames, name)


def check_camera(poses: Float[Tensor, "T 4 4"] | None, frames: int, name: str) -> None:
    """Refuse poses of a camera that are not one rigid motion for each frame."""
    if poses is None:
        return
    what, cure = "the camera's poses", "cut the clip to the frames in which the camera was tracked"
    if len(poses) != frames:
        raise InputError(
            f"{name}: {what} must be one for each of the {frames} frames, got {len(poses)}; cut "
            "them to the same frames"
        )
    if len(lost := (~poses.isfinite().flatten(1).all(1)).nonzero()):
        raise InputError(
            f"{name}: {what} must be finite in every frame, got NaN or infinity in {len(lost)}, "
            f"the first is {int(lost[0])}; {cure}"
        )
    check_place(poses[:, :3, 3], what, name)
    bottom = (poses[:, 3] - poses.new_tensor([0.0, 0.0, 0.0, 1.0])).abs().amax(-1)
    if len(wrong := (~is_rotation(poses[:, :3, :3]) | (bottom > UNIT_TOLERANCE)).nonzero()):
        frame = int(wrong[0])
        raise InputError(
            f"{name}: {what} must be rigid motions from the camera to the world, got in frame "
            f"{frame} {poses[frame].tolist()}; give matrices of a rotation and a position in metres"
        )


def check_hand(hand: HandTrack, name: str) -> None:
    """Refuse a hand of the wrong size or with angles that are not in radians."""
    check_seen(hand, name)
    for field in ("pose", "confidence"):
        if (values := getattr(hand, field)) is not None:
            check_finite(values[hand.valid], f"'{field}' of the {hand.side} hand", name)
    for points, seen in ((hand.joints, hand.trust > 0), (hand.wrist, hand.valid)):
        if points is not None:  # keypoints without confidence may be anywhere
            check_place(points[seen], f"the {hand.side} hand", name)
    if hand.betas is not None and not bool(hand.betas.isfinite().all()):
        raise InputError(
            f"{name}: 'betas' of the {hand.side} hand must be finite, got NaN or infinity; "
            "leave them out where they are not known"
        )
    if hand.confidence is not None:
        check_confidence(hand, hand.confidence, name)
    if hand.joints is not None:
        check_size(hand, hand.joints, name)
    if hand.joints is not None and hand.wrist is not None:
        check_wrist(hand, hand.wrist, hand.joints, name)
    if hand.pose is not None:
        check_angles(hand, hand.pose, name)
    if hand.camera_ray is not None:
        check_rays(hand, hand.camera_ray, name)


def check_seen(hand: HandTrack, name: str) -> None:
    """Refuse a hand that is in no frame."""
    if not bool(hand.valid.any()):
        raise InputError(
            f"{name}: at least one frame must hold the {hand.side} hand, got {hand.frames} frames "
            "without; choose frames with it"
        )


def check_confidence(hand: HandTrack, confidence: Float[Tensor, "T 21"], name: str) -> None:
    """Refuse a confidence outside of 0 to 1 in frames with the hand."""
    sure = confidence[hand.valid]
    if not bool(((sure >= 0) & (sure <= 1)).all()):
        raise InputError(
            f"{name}: 'confidence' of the {hand.side} hand must be between 0 and 1, got "
            f"{float(sure.min()):g} to {float(sure.max()):g}; rescale it"
        )


def check_wrist(
    hand: HandTrack, wrist: Float[Tensor, "T 3"], joints: Float[Tensor, "T 21 3"], name: str
) -> None:
    """Refuse a wrist that is not where the first keypoint is."""
    apart = (wrist - joints[:, 0]).norm(dim=-1)[hand.trust[:, 0] > 0]
    if len(apart) and float(apart.median()) > WRIST_APART:
        raise InputError(
            f"{name}: 'wrist' of the {hand.side} hand must be where keypoint 0 of 'joints' is, "
            f"got {float(apart.median()):.2g} m between them; give both in the same frame, or "
            "leave the pose and its wrist out"
        )


def check_angles(hand: HandTrack, pose: Float[Tensor, "T 16 3"], name: str) -> None:
    """Refuse a pose that is not in radians, by its largest angle in the median frame: degrees are
    too large in most frames, failures of a tracker only in few."""
    angle = float(pose[hand.valid].norm(dim=-1).amax(-1).median())
    if angle > LARGEST_ANGLE:
        raise InputError(
            f"{name}: the pose of the {hand.side} hand must be axis-angle in radians, got an "
            f"angle of {angle:.3g}; convert degrees to radians"
        )


def check_rays(hand: HandTrack, ray: Tensor, name: str) -> None:
    """Refuse viewing rays that are not one unit vector per frame."""
    lengths = ray.norm(dim=-1)
    if ray.shape != (hand.frames, 3) or not bool(((lengths - 1).abs() < UNIT_TOLERANCE).all()):
        raise InputError(
            f"{name}: the camera_ray of the {hand.side} hand must be {hand.frames} directions "
            f"of length 1, got {len(ray)} of length {float(lengths.min()):.3g} to "
            f"{float(lengths.max()):.3g}; divide each by its length"
        )


def check_size(hand: HandTrack, joints: Float[Tensor, "T 21 3"], name: str) -> None:
    """Refuse keypoints that all coincide, or whose span is not that of a hand in metres."""
    span = float(hand_span(joints[without_collapsed(hand).valid]))
    if span > LARGEST_HAND:  # keypoints without confidence may be anywhere
        sure = joints.masked_fill(~(hand.trust > 0)[..., None], torch.nan)
        span = max(float(hand_span(sure[hand.observed])), SMALLEST_HAND)
    if span == 0:
        raise InputError(
            f"{name}: at least one frame must hold the {hand.side} hand, got all its keypoints in "
            "one place; leave the hand out, or mark frames that hold it"
        )
    if SMALLEST_HAND <= span <= LARGEST_HAND:
        return
    cure = "numbers of another unit, rescale them"
    if span > LARGEST_HAND:
        cure, unit = "centimetres, divide by 100", "cm"
        if span > MILLIMETRE_SPAN:
            cure, unit = "millimetres, divide by 1000", "mm"
        cure += f"; files of bare keypoints take --keypoint-unit {unit}"
        if lies_flat(joints[hand.valid]):
            cure += "; or like pixels, as all lie in a plane: give 3D keypoints"
    raise InputError(
        f"{name}: the joints of the {hand.side} hand must be in metres and span "
        f"{SMALLEST_HAND:g} to {LARGEST_HAND:g}, got {span:.3g}; these look like {cure}"
    )


def lies_flat(joints: Float[Tensor, "T 21 3"]) -> bool:
    """Whether keypoints lie in a plane across an axis, as pixel coordinates with a score do."""
    extent = joints.amax(1) - joints.amin(1)
    return 0 < float((extent.amin(-1) / extent.amax(-1)).nanmedian()) < FLAT_RATIO


def check_finite(values: Float[Tensor, "T ..."], what: str, name: str) -> None:
    """Refuse NaN and infinity among values of valid frames."""
    if not bool(values.isfinite().all()):
        raise InputError(
            f"{name}: {what} must be finite wherever it is valid, got NaN or infinity; mark such "
            "frames as not valid"
        )


def check_place(points: Float[Tensor, "*B 3"], what: str, name: str) -> None:
    """Refuse points so far from the origin that float32 cannot resolve a millimetre."""
    check_finite(points, what, name)
    farthest = float(points.abs().max())
    if not farthest <= FARTHEST_POINT:
        raise InputError(
            f"{name}: {what} must be within {FARTHEST_POINT:.0f} m of the origin, got a coordinate "
            f"of {farthest:.3g}; correct the numbers or their unit, or move the origin"
        )


def hand_span(joints: Float[Tensor, "T 21 3"]) -> Float[Tensor, ""]:
    """Largest distance between two keypoints, median over frames; keypoints that are NaN are left
    out."""
    return pairwise_distances(joints, joints).nan_to_num(0).flatten(1).amax(1).median()


def check_object(motion: ObjectTrack, name: str) -> None:
    """Refuse poses that are not finite or not rigid, or not one part per mesh."""
    if motion.meshes and len(motion.meshes) != motion.rotation.shape[1]:
        parts, meshes = motion.rotation.shape[1], len(motion.meshes)
        raise InputError(
            f"{name}: the object moves {parts} rigid {'part' if parts == 1 else 'parts'}, got "
            f"{meshes} {'mesh' if meshes == 1 else 'meshes'}; "
            "give one mesh per part, in the order of the parts; join the meshes of one part in a "
            "file"
        )
    both = (motion.rotation, motion.translation)
    finite = torch.stack([part.isfinite().flatten(1).all(1) for part in both]).all(0)
    if not bool(finite.all()):
        raise InputError(
            f"{name}: the object's motion must be finite in every frame, got NaN or infinity in "
            f"{int((~finite).sum())}, the first is {int((~finite).nonzero()[0])}; write NaN "
            "where the object was not found"
        )
    check_place(motion.translation, "the object", name)
    wrong = (~is_rotation(motion.rotation)).nonzero()
    if len(wrong):
        frame, part = wrong[0].tolist()
        raise InputError(
            f"{name}: the object's rotations must be rotation matrices with R^T R = I and "
            f"determinant 1, got in frame {frame} {describe_matrix(motion.rotation[frame, part])}"
        )


def describe_matrix(matrix: Float[Tensor, "3 3"]) -> str:
    """For a message: why a matrix is no rotation, and the remedy."""
    determinant = float(torch.linalg.det(matrix))
    if determinant < 0:
        return f"determinant {determinant:.3g}, a reflection; mirror the mesh instead"
    scale = determinant ** (1 / 3)
    if scale < 1e-6:
        return "determinant 0; write NaN in frames in which the object was not found"
    if bool(is_rotation(matrix / scale)):
        return (
            f"a rotation times {scale:.3g}; a scale belongs to the mesh, divide the matrix by it "
            "and multiply the vertices"
        )
    return "columns of unequal length or not at right angles; correct the numbers"
