"""Clean clips, and the noise that is put on their hands and objects."""

import math
from collections.abc import Collection
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Literal, cast, get_args

import torch
import trimesh.creation
from jaxtyping import Float, Int
from scipy.ndimage import gaussian_filter1d, maximum_filter1d
from torch import Tensor

from geneoh.choices import Noise, ObjectNoise
from geneoh.evaluation.protocols.synthetic import draw_clip
from geneoh.geometry.distance import SurfaceDistance
from geneoh.geometry.mesh import Mesh
from geneoh.geometry.rigid import Rigid
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.skeleton import TIP_KEYPOINTS
from geneoh.objects.symmetry import Symmetry, find_symmetry
from geneoh.readers.npz.files import load
from geneoh.seeds import seeded_generator
from geneoh.sequence.gaps import fill_gaps, fill_object
from geneoh.sequence.keypoints import PALM, palm_axes
from geneoh.sequence.noise import corrupt_sequence
from geneoh.sequence.object_noise import corrupt_object, draw_object_noise
from geneoh.sequence.placing import placed
from geneoh.sequence.sequence import ObjectTrack, Sequence
from geneoh.synthesis.shapes.scans import MeshFolder, Scans, build_scans, read_folder
from tools.noisy_objects.filters import ObjectFilter, filtered_as

EXAMPLES = Path(__file__).parents[2] / "examples"
FRAMES = 60
RECORDING = "recording"
MADE = ("mug", "ycb_035_power_drill.ply")
"""A family and a scan that are in no training data."""
ROUND = ("bottle", "cylinder", "bowl", "ball")
ROUND_SCANS = ("ycb_005_tomato_soup_can.ply", "ycb_024_bowl.ply", "ycb_056_tennis_ball.ply")
SHAKEN = "shaken "
"""Prefix of a clip's name: hand and object are shaken together."""
BESIDE = "beside "
"""Prefix of a clip's name: the mirrored hand moves beside the object and holds nothing."""
HOVERING = "hovering "
"""The same, as near to the object as a touching hand may be."""
FILMED = "filmed "
"""The same clip in the frame of a camera on a moving head."""
TRACKED = "tracked "
"""The same as `FILMED`, with the poses of the camera, which have white noise of `TRACKING`."""
TRACKING = (math.radians(0.1), 0.001)
"""Standard deviation per axis of the noise of a camera's poses, radians and metres."""
LARGE = "large "
"""The same clip with an object that is joined to a box, as to a piece of furniture."""
BOX, BOX_AWAY = 1.0, 0.6
"""Sides of the box, and distance of its top below the object's middle in its frame, metres."""
HULL, BOXED = "hull of ", "box of "
"""The same clip with the convex hull of the object, or a box around it, for the object's mesh."""
WALKED = "walked "
"""The same clip of someone who walks, at `SPEED`, and bobs by `BOB` twice a second."""
SPEED, BOB = 1.3, 0.03
"""Metres a second, and amplitude in metres."""
TRAY = "tray on the back of "
"""The clip's hand with a tray on its back, which it carries, for the object."""
TRAY_SIZE, SKIN = (0.25, 0.2, 0.02), 0.011
"""Sides of the tray, and thickness of the hand over the keypoints of the palm, metres."""
OFF, NEAR = 0.06, 0.015
"""Median over frames of the distance from its nearest keypoint to the object, metres, in clips
`BESIDE` (at least) and `HOVERING`."""
HERTZ, DEGREES, LEVER = 4.0, 25.0, 0.25
"""Frequency and amplitude of the shaking in the middle half of the clip, and distance in metres of
its pivot from the wrist."""
HEAD_SECONDS, HEAD_DEGREES, HEAD_SHIFT = 0.35, 12.0, 0.06
"""Time scale of the head's motion (standard deviation of a Gaussian), and its size per axis as a
standard deviation, in degrees and metres: it turns by 34 degrees per second per axis."""
EYE = (0.0, 0.0, 0.5)
"""Mean position of the object in the frame of the camera, metres."""
SPINS = "spins"
"""Noise "flips", about an axis of symmetry of the mesh."""
HandNoise = Literal[Noise, "clean"]
WhiteNoise = Literal["turn 2", "turn 10", "place 2", "place 10", "both 2", "both 10"]
"""White noise, by its standard deviation per axis in degrees and millimetres."""
CoveredNoise = Literal["covered 2", "covered 5"]
"""White noise of so many degrees and millimetres while the object moves, as where a hand covers it,
and `UNCOVERED` of it in other frames."""
UNCOVERED, MOVED, COVERED_FRAMES = 0.1, 0.002, 9
"""Share of that noise; step of a vertex from which the object moves, on average, metres; and frames
around one in which it moves that count as moving, too."""
Gap = Literal["lost 10", "lost 30", "on a line 10", "on a line 30"]
"""Number of frames without a pose, in one gap where they are farthest from a straight line; or with
poses on this line, without a mark."""
Stuck = Literal["stuck 10", "stuck 30", "hand stuck 10", "hand stuck 30"]
"""Number of frames in which the track of the object, or of the hand, keeps the pose before them,
where it moves farthest from it, with white noise of `STUCK_NOISE` in all frames."""
STUCK_NOISE, STUCK_HAND_NOISE = "both 1", 0.002
"""White noise of objects, and of the position of hands, metres per axis."""
ObjectKind = Literal[
    Stuck, ObjectNoise, WhiteNoise, CoveredNoise, ObjectFilter, Gap, "exact", "spins"
]


@cache
def scans() -> Scans:
    """The scanned objects that the clips need."""
    return scans_of(read_folder(EXAMPLES / "objects"), (*MADE, *ROUND_SCANS))


def scans_of(found: MeshFolder, names: Collection[str]) -> Scans:
    """Those objects of a folder that have one of the names."""
    wanted = [n for n, name in enumerate(found.names) if name in names]
    return build_scans(
        replace(
            found,
            names=tuple(found.names[n] for n in wanted),
            meshes=tuple(found.meshes[n] for n in wanted),
        )
    )


@cache
def clip_of(name: str) -> Sequence:
    """The recording, or a made clip of a family or a scan, changed as the name says; bottles have
    no cap."""
    for prefix, changed in CHANGES.items():
        if name.startswith(prefix):
            return changed(clip_of(name.removeprefix(prefix)))
    if name == RECORDING:
        return load(EXAMPLES / "taco_clean.npz", obj=EXAMPLES / "taco_object.obj")
    made = draw_clip(name, 0, FRAMES, scans() if name.endswith(".ply") else None)
    whole = made.object
    body = ObjectTrack(whole.meshes[:1], whole.rotation[:, :1], whole.translation[:, :1])
    return replace(made, object=body)


def made_clips(
    names: list[str] | tuple[str, ...],
    count: int,
    first: int,
    frames: int,
    scans: Scans | None = None,
) -> list[Sequence]:
    """Clips of families or scans in turn, numbered from `first`, which seeds each."""
    return [draw_clip(names[n % len(names)], first + n, frames, scans) for n in range(count)]


def shaken(sequence: Sequence, hertz: float = HERTZ, degrees: float = DEGREES) -> Sequence:
    """A clip whose hand shakes its object."""
    (hand,), frames = sequence.hands, sequence.frames
    assert hand.joints is not None, "every clip has joints"
    time = torch.arange(frames)
    share = (4 * (time / (frames - 1) - 0.5).abs()).clamp(1, 1.2).sub(1.2) / -0.2
    angle = share * math.radians(degrees) * torch.sin(2 * math.pi * hertz * time / sequence.fps)
    turn = axis_angle_to_matrix(angle[:, None] * torch.eye(3)[0])
    pivot = hand.joints[frames // 2, 0] + torch.tensor([0.0, LEVER, 0.0])
    return placed(sequence, Rigid(turn, pivot - turn @ pivot))


def filmed(sequence: Sequence) -> Sequence:
    """A clip in the frame of a camera on a moving head, which sees the object half a metre away."""
    return placed(sequence, head_of(sequence))


def tracked(sequence: Sequence) -> Sequence:
    """The same with the poses of the camera, which are noisy."""
    generator = seeded_generator("tracked", sequence.source)
    turn, shift = torch.randn(2, sequence.frames, 3, generator=generator)
    noise = Rigid(axis_angle_to_matrix(TRACKING[0] * turn), TRACKING[1] * shift)
    camera = noise.compose(head_of(sequence).inverse())
    return replace(filmed(sequence), camera_to_world=camera.matrices())


def head_of(sequence: Sequence) -> Rigid:
    """The motion from the world to the camera on a head."""
    frames, generator = sequence.frames, seeded_generator("filmed", sequence.source)
    sigma = HEAD_SECONDS * sequence.fps
    noise = torch.randn(6, frames + round(8 * sigma), generator=generator).numpy()
    smooth = gaussian_filter1d(noise, sigma) * (2 * math.pi**0.5 * sigma) ** 0.5
    turn, shift = torch.from_numpy(smooth[:, round(4 * sigma) :][:, :frames]).mT.split(3, dim=1)
    head = axis_angle_to_matrix(math.radians(HEAD_DEGREES) * turn)
    camera = sequence.object.translation.mean((0, 1)) - torch.tensor(EYE)
    return Rigid(head, HEAD_SHIFT * shift - head @ camera)


def hovering(sequence: Sequence) -> Sequence:
    """A clip with the hand mirrored at the object's centre, and moved aside until it is as near as
    a touching hand may seem."""
    joints = sequence.hands[0].joints
    assert joints is not None, "every clip has joints"
    middle = sequence.object.translation[:, 0, 0].mean()
    return beside(sequence, NEAR, start=float(middle + joints[..., 0].mean()))


def beside(sequence: Sequence, off: float = OFF, start: float = 0.0) -> Sequence:
    """A clip with the mirrored hand in place of the hand, moved aside until it is `off` away.

    It is moved along x, beginning with a shift of `start`; metres.
    """
    (hand,), surface = sequence.hands, sequence.object.surface()
    hand = hand.mirrored()
    assert hand.joints is not None, "every clip has joints"
    assert hand.wrist is not None, "every clip has parameters"
    for step in range(200):
        shift = torch.tensor([start - 0.005 * step, 0.0, 0.0])
        joints = hand.joints + shift
        if float(surface.query(joints).distance.amin(-1).median()) >= off:
            break
    return replace(sequence, hands=(replace(hand, joints=joints, wrist=hand.wrist + shift),))


def large(sequence: Sequence) -> Sequence:
    """A clip with a box as part of the object's mesh, away from the hand."""
    mesh = sequence.object.meshes[0]
    box = trimesh.creation.box((BOX, BOX, BOX))
    middle = mesh.verts.mean(0) - torch.tensor([0.0, 0.0, BOX_AWAY + BOX / 2])
    verts = torch.cat([mesh.verts, middle + torch.from_numpy(box.vertices).to(mesh.verts)])
    faces = torch.cat([mesh.faces, torch.from_numpy(box.faces).to(mesh.faces) + len(mesh.verts)])
    return replace(sequence, object=replace(sequence.object, meshes=(Mesh(verts, faces),)))


def hull_of(sequence: Sequence) -> Sequence:
    """A clip with the convex hull of the object for its mesh."""
    return with_shape(sequence, solid_of(sequence).convex_hull)


def box_of(sequence: Sequence) -> Sequence:
    """A clip with a box around the object for its mesh."""
    return with_shape(sequence, trimesh.creation.box(bounds=solid_of(sequence).bounds))


def solid_of(sequence: Sequence) -> trimesh.Trimesh:
    """The object's mesh, as trimesh has it."""
    mesh = sequence.object.meshes[0]
    return trimesh.Trimesh(mesh.verts.numpy(), mesh.faces.numpy(), process=False)


def with_shape(sequence: Sequence, shape: trimesh.Trimesh) -> Sequence:
    """A clip with another mesh of its object."""
    verts, faces = torch.from_numpy(shape.vertices).float(), torch.from_numpy(shape.faces)
    return replace(sequence, object=replace(sequence.object, meshes=(Mesh(verts, faces),)))


def walked(sequence: Sequence) -> Sequence:
    """A clip of someone who walks."""
    time = torch.arange(sequence.frames) / sequence.fps
    bob = BOB * torch.sin(2 * math.pi * 2 * time)
    still = torch.eye(3).expand(sequence.frames, 3, 3)
    return placed(sequence, Rigid(still, torch.stack([SPEED * time, 0 * time, bob], dim=1)))


def with_tray(sequence: Sequence) -> Sequence:
    """A clip with a tray on the back of its hand for the object."""
    joints = sequence.hands[0].joints
    assert joints is not None, "every clip has joints"
    axes, palm = palm_axes(joints[:, None]), joints[:, list(PALM)]
    bent = joints[:, sorted(TIP_KEYPOINTS)[1:]].mean(1) - palm.mean(1)
    up = -axes[..., 2] * (bent * axes[..., 2]).sum(-1, keepdim=True).sign()  # away from the tips
    turn = torch.stack([axes[..., 0], torch.linalg.cross(up, axes[..., 0]), up], dim=-1)
    height = ((palm - palm.mean(1, keepdim=True)) * up[:, None]).sum(-1).amax(1)
    place = palm.mean(1) + (height + SKIN + TRAY_SIZE[2] / 2)[:, None] * up
    box = trimesh.creation.box(TRAY_SIZE)
    mesh = Mesh(torch.from_numpy(box.vertices).float(), torch.from_numpy(box.faces))
    return replace(sequence, object=ObjectTrack((mesh,), turn[:, None], place[:, None]))


CHANGES = {
    SHAKEN: shaken,
    BESIDE: beside,
    HOVERING: hovering,
    FILMED: filmed,
    TRACKED: tracked,
    LARGE: large,
    HULL: hull_of,
    BOXED: box_of,
    WALKED: walked,
    TRAY: with_tray,
}


@cache
def symmetry_of(name: str) -> Symmetry:
    """The symmetry of a clip's object."""
    return find_symmetry(SurfaceDistance(clip_of(name).object.meshes[0]))


def with_noisy_hand(clean: Sequence, noise: HandNoise, seed: int) -> Sequence:
    """A clip with a noisy hand, or as it is."""
    if noise == "clean":
        return clean
    return corrupt_sequence(
        clean, noise, generator=seeded_generator("hand", noise, clean.source, seed)
    )


def with_noisy_object(
    sequence: Sequence, kind: ObjectKind, seed: int, symmetry: Symmetry
) -> Sequence:
    """A clip with a noisy object, or as it is."""
    if kind == "exact":
        return sequence
    generator = seeded_generator("object", kind, sequence.source, seed)
    if kind == SPINS:
        return with_spins(sequence, symmetry, generator)
    if kind in get_args(ObjectFilter):
        return filtered_as(sequence, cast(ObjectFilter, kind))
    if kind in get_args(Gap):
        return with_gap(sequence, kind)
    if kind in get_args(Stuck):
        if kind.startswith("hand"):
            return with_stuck_hand(sequence, kind, generator)
        return with_white_noise(with_stuck_poses(sequence, kind), STUCK_NOISE, generator)
    if kind in get_args(WhiteNoise):
        return with_white_noise(sequence, kind, generator)
    if kind in get_args(CoveredNoise):
        return with_white_noise(sequence, kind, generator, covered(sequence))
    return corrupt_object(sequence, cast(ObjectNoise, kind), generator=generator)


def with_gap(sequence: Sequence, kind: str) -> Sequence:
    """The clip with a `Gap` in the poses of its object."""
    name, length = kind.rsplit(" ", 1)
    motion, frames = sequence.object, sequence.frames
    middles = motion.translation + motion.rotation @ motion.meshes[0].center()
    tries = []
    for start in range(1, frames - int(length)):
        seen = torch.ones(frames, 1, dtype=torch.bool)
        seen[start : start + int(length)] = False
        filled = fill_object(motion, seen)
        places = filled.translation + filled.rotation @ motion.meshes[0].center()
        tries.append((float((places - middles).norm(dim=-1).mean()), start, filled))
    _, _, filled = max(tries)
    return replace(sequence, object=filled if name == "lost" else replace(filled, valid=None))


def with_stuck_poses(sequence: Sequence, kind: str) -> Sequence:
    """The clip with poses of its object that are `Stuck`."""
    motion = sequence.object
    middles = motion.translation[:, 0] + motion.rotation[:, 0] @ motion.meshes[0].center()
    return replace(sequence, object=motion[stuck_frames(middles, kind)])


def with_stuck_hand(sequence: Sequence, kind: str, generator: torch.Generator) -> Sequence:
    """The clip with a hand that is `Stuck`."""
    (hand,) = sequence.hands
    joints = fill_gaps(hand).joints
    assert joints is not None, "every clip has joints"
    frames = stuck_frames(joints.mean(1), kind)
    shift = STUCK_HAND_NOISE * torch.randn(sequence.frames, 3, generator=generator)
    wrist = None if hand.wrist is None else hand.wrist[frames] + shift
    moved = replace(hand[frames], joints=joints[frames] + shift[:, None], wrist=wrist)
    return replace(sequence, hands=(moved,))


def stuck_frames(places: Float[Tensor, "T 3"], kind: str) -> Int[Tensor, " T"]:
    """The frame whose pose a `Stuck` track has in each frame."""
    length, frames = int(kind.rsplit(" ", 1)[1]), torch.arange(len(places))
    before = int((places[length:] - places[:-length]).norm(dim=-1)[:-1].argmax())
    frames[before : before + length + 1] = before
    return frames


def covered(sequence: Sequence) -> Float[Tensor, "T 1 1"]:
    """Share of the noise of each frame's pose of an object that is covered while it moves."""
    motion = sequence.object
    verts = motion.rotation[:, 0] @ motion.meshes[0].verts.T + motion.translation[:, 0, :, None]
    steps = verts.diff(dim=0, prepend=verts[:1]).norm(dim=1).mean(-1)
    moves = maximum_filter1d((steps > MOVED).numpy(), COVERED_FRAMES)
    return torch.where(torch.from_numpy(moves), 1.0, UNCOVERED)[:, None, None]


def with_white_noise(
    sequence: Sequence,
    kind: str,
    generator: torch.Generator,
    share: Float[Tensor, "T 1 1"] | float = 1.0,
) -> Sequence:
    """White noise of the rotation, of the translation, or of both; a share of it in each frame."""
    name, size = kind.split()
    turn, shift = share * torch.randn(2, sequence.frames, 1, 3, generator=generator)
    turn *= math.radians(float(size)) * (name != "place")
    shift *= 0.001 * float(size) * (name != "turn")
    return displaced(sequence, axis_angle_to_matrix(turn), shift)


def with_spins(sequence: Sequence, symmetry: Symmetry, generator: torch.Generator) -> Sequence:
    """Flips about the object's axis of symmetry, or about any axis of a ball."""
    axis = None
    if not symmetry.is_ball:
        step = torch.from_numpy(symmetry.rotations[1] - symmetry.rotations[1].T).float()
        axis = torch.nn.functional.normalize(
            torch.stack([step[2, 1], step[0, 2], step[1, 0]]), dim=0
        )
    turn, shift = draw_object_noise("flips", sequence.frames, axis, generator=generator)
    motion, center = sequence.object, torch.from_numpy(symmetry.center).float()
    turns = axis_angle_to_matrix(turn)
    shift = shift + (motion.rotation[:, 0] @ (center - turns @ center)[..., None])[..., 0]
    return displaced(sequence, turns[:, None], shift[:, None])


def displaced(
    sequence: Sequence, turn: Float[Tensor, "T Q 3 3"], shift: Float[Tensor, "T Q 3"]
) -> Sequence:
    """A clip whose object is rotated in its own frame and shifted in the world frame, metres."""
    motion = sequence.object
    rotation, translation = motion.rotation @ turn, motion.translation + shift
    return replace(sequence, object=replace(motion, rotation=rotation, translation=translation))
