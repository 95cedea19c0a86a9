"""What pictures and pages show of an interaction: posed hands, the object, their measures."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, cached_property, partial
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from geneoh.bundle import concatenated
from geneoh.choices import Axis, Colouring, Side
from geneoh.errors import InputError
from geneoh.geometry.distance import MovingSurface
from geneoh.geometry.mesh import Mesh
from geneoh.geometry.rigid import Rigid
from geneoh.geometry.rotations import matrix_to_quat_wxyz
from geneoh.metrics.report import FrameMeasures
from geneoh.objects.camera_motion import steady_camera
from geneoh.pipeline.examination.shots import common_shots, cuts_in, shot_of, with_masks
from geneoh.readers.bodies.base import BodyRecording
from geneoh.sequence.gaps import without_placeholders
from geneoh.sequence.placing import in_world
from geneoh.sequence.resample import nearest_frames, poses_over_frames
from geneoh.sequence.sequence import HandTrack, ObjectTrack, Sequence, without_unseen
from geneoh.sequence.validation import check_seen, check_tracks
from geneoh.sequence.windows import blocks
from geneoh.viz.look import BODY_COLOUR, OBJECT_COLOUR, Colour, ramp_colours, ramp_position
from geneoh.viz.mannequin import mannequin
from geneoh.viz.posed_track import PosedTrack, pose_track
from geneoh.viz.surface import with_sharp_edges

EXACT_WITHIN = 0.03  # distances of vertices are exact within this many metres of the object's box


@dataclass(frozen=True)
class DrawnSurface:
    """A mesh of one frame, world frame, with a colour for each vertex."""

    verts: Float[np.ndarray, "V 3"]
    faces: Int[np.ndarray, "F 3"]
    colours: Float[np.ndarray, "V 3"]
    position: Float[np.ndarray, " V"]
    """Position of each vertex on the colour ramp, 0 to 1; the object never covers high ones."""


@dataclass(frozen=True)
class Version:
    """One version of the interaction: the input, or the result."""

    title: str
    hands: tuple[PosedTrack, ...]

    @cached_property
    def measures(self) -> FrameMeasures:
        """Measures over all hands: largest depth, sum of fingertips, mean acceleration."""
        hands = [hand.measures for hand in self.hands]
        valid = torch.stack([hand.valid for hand in hands]).any(0)
        depth = torch.stack([hand.depth.where(hand.valid, 0) for hand in hands]).amax(0)
        fingers = torch.stack([hand.fingers.where(hand.valid, 0) for hand in hands]).sum(0)
        return FrameMeasures(
            valid=valid,
            touching=torch.stack([hand.touching for hand in hands]).any(0),
            depth=depth.where(valid, torch.nan),
            fingers=fingers.where(valid, torch.nan),
            acceleration=torch.stack([hand.acceleration for hand in hands]).nanmean(0),
        )

    def drawn(self, frame: int, colouring: Colouring) -> DrawnSurface | None:
        """All hands of a frame as one surface; None when there are none."""
        surfaces = []
        for hand in self.hands:
            if bool(hand.valid[frame]):
                spread = None if hand.spread is None else hand.spread[frame]
                position = ramp_position(colouring, hand.distance[frame], spread).numpy()
                colours = ramp_colours(colouring, position)
                verts, faces = hand.verts[frame].numpy(), hand.model.faces.numpy()
                surfaces.append(DrawnSurface(verts, faces, colours, position))
        return _joined(surfaces) if surfaces else None


@dataclass(frozen=True)
class Scene:
    """Versions of one interaction around one object."""

    title: str
    versions: tuple[Version, ...]  # before, then after; or one alone
    object: ObjectTrack
    fps: float
    samples: dict[Side, Float[Tensor, "S T 21 3"]]  # keypoints of all samples, if kept
    object_confidence: Float[Tensor, " T"] | None = None
    """Confidence in the object's pose, 0 to 1; None where it is unknown or 1 in every frame."""
    filled: Bool[Tensor, " T"] | None = None
    """Frames in which the input lacked a hand that the result has; None if they are unknown."""
    notes: tuple[str, ...] = ()
    """What is to be said about the input and its hands, as sentences."""
    body: BodyRecording | None = None
    """The body that the hands belong to, if known; its limbs are the last parts of `object`."""
    limbs: tuple[str, ...] = ()
    """Names of the last parts of `object` if these are limbs of the body; nothing is measured
    against them."""

    @property
    def frames(self) -> int:
        """Number of frames T."""
        return len(self.object.rotation)

    @property
    def hands(self) -> list[PosedTrack]:
        """The hands of all versions."""
        return [hand for version in self.versions for hand in version.hands]

    def means(self, version: Version) -> dict[str, float]:
        """The means of a version over the frames of the input that have its hands, as the report
        has them, but at the clip's own frame rate: without the accelerations across a cut of the
        video, and over all its frames with a hand if those of the input are unknown."""
        measures, bends = version.measures, version.measures.acceleration.clone()
        for cut in self.cuts:
            bends[cut - 1 : cut + 1] = torch.nan
        measures = replace(measures, acceleration=bends)
        return (measures if self.filled is None else measures.counted(~self.filled)).means()

    @cached_property
    def cuts(self) -> list[int]:
        """First frames of all shots of a video but the first, by the hands of the last version."""
        hands = tuple(HandTrack(h.side, h.valid, h.joints) for h in self.versions[-1].hands)
        return cuts_in(Sequence(hands, self.object, self.fps))

    @property
    def parts(self) -> list[int]:
        """The parts of the object to draw: those that were ever seen."""
        return self.object.seen_parts if self.object.meshes else []

    @cached_property
    def sharp_parts(self) -> tuple[Mesh, ...]:
        """The parts of the object with their vertices doubled along sharp edges."""
        return tuple(with_sharp_edges(mesh) for mesh in self.object.meshes)

    def part_pose(self, part: int, frame: int) -> Rigid:
        """From a part's own frame to the world."""
        return Rigid(self.object.rotation[frame, part], self.object.translation[frame, part])

    def part_motion(self, part: int) -> tuple[Float[np.ndarray, "T 4"], Float[np.ndarray, "T 3"]]:
        """A part's pose in the world over time: quaternion w, x, y, z and translation."""
        quat_wxyz = matrix_to_quat_wxyz(self.object.rotation[:, part])
        return quat_wxyz.numpy(), self.object.translation[:, part].numpy()

    def part_name(self, part: int) -> str:
        """ "object", or "object 1", "object 2" of several parts; "body_head" of a limb."""
        own = len(self.object.meshes) - len(self.limbs)
        if self.is_limb(part):
            return f"body_{self.limbs[part - own]}"
        return f"object {part + 1}" if own > 1 else "object"

    def part_colour(self, part: int) -> Colour:
        """The colour of a part of the object, or of a limb."""
        return BODY_COLOUR if self.is_limb(part) else OBJECT_COLOUR

    def is_limb(self, part: int) -> bool:
        """Whether a part belongs to the body and not to the object."""
        return part >= len(self.object.meshes) - len(self.limbs)

    @property
    def up(self) -> Axis:
        """Axis of the world that points up: that of the body, or z without a body."""
        return "z" if self.body is None else self.body.up

    @property
    def has_object(self) -> bool:
        """Whether there is a mesh besides the limbs of a body, against which hands are measured."""
        measured = any(hand.distance_of is not None for hand in self.hands)
        return measured and len(self.object.meshes) > len(self.limbs)

    def shows(self, colouring: Colouring) -> bool:
        """Whether there is data for a colouring: expected errors for "spread", else an object."""
        if colouring == "spread":
            return any(hand.joint_spread is not None for hand in self.hands)
        return colouring != "plain" and self.has_object

    def object_verts(self, part: int, frame: int) -> Float[Tensor, "V 3"]:
        """Vertices of a part in the world."""
        return self.part_pose(part, frame).apply(self.object.meshes[part].verts)

    def drawn_object(self, frame: int) -> DrawnSurface | None:
        """The `parts` of the object in a frame as one surface; None without any."""
        surfaces = []
        for part in self.parts:
            mesh = self.sharp_parts[part]
            verts = self.part_pose(part, frame).apply(mesh.verts).detach().numpy()
            colours = np.broadcast_to(
                np.array(self.part_colour(part), dtype=np.float32), verts.shape
            )
            position = np.zeros(len(verts), dtype=np.float32)
            surfaces.append(DrawnSurface(verts, mesh.faces.numpy(), colours, position))
        return _joined(surfaces) if surfaces else None


def _joined(surfaces: list[DrawnSurface]) -> DrawnSurface:
    """Several surfaces as one."""
    starts = np.cumsum([0] + [len(each.verts) for each in surfaces[:-1]])
    faces = [each.faces + start for each, start in zip(surfaces, starts, strict=True)]
    rest = zip(*((each.verts, each.colours, each.position) for each in surfaces), strict=True)
    verts, colours, position = map(np.concatenate, rest)
    return DrawnSurface(verts, np.concatenate(faces), colours, position)


def make_scene(
    sequences: dict[str, Sequence],
    *,
    title: str | None = None,
    samples: dict[Side, Float[Tensor, "S R 21 3"]] | None = None,
    mano_dir: Path | str | None = None,
    body: BodyRecording | None = None,
) -> Scene:
    """Pose every hand of one or two versions of an interaction.

    The object is that of the last sequence; without a mesh only hands are shown. Poses that it
    lacks are filled in, in each shot of a video, as the cleaner does. What a moving camera saw is
    shown in the world, if the camera's poses are known. Nothing is measured against a part that was
    never seen. A hand model is fitted to a hand that has only keypoints. Betas of MANO get MANO's
    mesh where the user has its files, else the embedded hand fitted to the same bones.

    `sequences` maps titles to versions, before and after; `samples` may have any frame rate, and
    those of a side that is not shown are left out.
    """
    sequences = {name: seen_hands(sequence) for name, sequence in sequences.items()}
    last_title, last = next(reversed(sequences.items()))
    if body is None:
        refuse_lost_meshes(last)
    for sequence in sequences.values():
        check_tracks(sequence)
        for hand in sequence.hands:
            check_seen(hand, sequence.source or "the sequence")
        if sequence.frames != last.frames:
            raise InputError(
                f"{sequence.source}: both must have the same frames, got {sequence.frames} "
                f"against {last.frames}; cut them to the same frames"
            )
    shown = {hand.side for hand in last.hands}
    samples = {side: drawn for side, drawn in (samples or {}).items() if side in shown}
    if (camera := steady_camera(last)) is not None:
        sequences = {name: in_world(sequence, camera) for name, sequence in sequences.items()}
        last = sequences[last_title]
        samples = {
            side: poses_over_frames(camera, drawn.shape[1]).apply(drawn)
            for side, drawn in samples.items()
        }
    shots = common_shots(last)
    motion = concatenated(with_masks(shot_of(last, shot).object for shot in shots))
    met = seen_object(motion)
    distance_of = partial(_distances, cache(met.surface)) if met.meshes else None
    versions = []
    for name, sequence in sequences.items():
        hands = [pose_track(hand, distance_of, sequence.fps, mano_dir) for hand in sequence.hands]
        versions.append(Version(name, tuple(hands)))
    paced: dict[Side, Float[Tensor, "S T 21 3"]] = {
        side: drawn[:, nearest_frames(drawn.shape[1], last.frames)]
        for side, drawn in samples.items()
    }
    scene = Scene(title or last_title, tuple(versions), motion, last.fps, paced)
    return scene if body is None else with_body(scene, body)


def seen_hands(sequence: Sequence) -> Sequence:
    """A sequence without hands in no frame and without placeholders of keypoints."""
    sequence = without_unseen(sequence)
    return replace(sequence, hands=tuple(map(without_placeholders, sequence.hands)))


def seen_object(motion: ObjectTrack) -> ObjectTrack:
    """An object without parts that were never seen, which rest at the world's origin."""
    return motion.of_parts(motion.seen_parts) if motion.meshes else motion


def _distances(
    surface_of: Callable[[], MovingSurface], verts: Float[Tensor, "T V 3"]
) -> Float[Tensor, "T V"]:
    """Signed distances of vertices; the surface is built here, as some formats need no distance."""
    surface = replace(surface_of(), within=EXACT_WITHIN)
    each = (surface.at(block).query(verts[block]) for block in blocks(len(verts)))
    return torch.cat([found.distance for found in each])


def refuse_lost_meshes(sequence: Sequence) -> None:
    """`InputError` where meshes that a file names are missing; a file may name none at all."""
    if sequence.object.missing and not sequence.object.meshes:
        raise InputError(
            f"{sequence.source}: expected the mesh of the object whose poses it has, got none; "
            "pass --obj MESH"
        )


def with_body(scene: Scene, body: BodyRecording) -> Scene:
    """The scene with the limbs of a body, of the same number of frames, as parts to draw."""
    if body.frames != scene.frames:
        raise InputError(
            f"{body.source}: body and hands must have the same frames, got {body.frames} against "
            f"{scene.frames}; cut them to the same frames"
        )
    names, limbs = mannequin(body)
    shown = with_parts_behind(scene.object, limbs)
    return replace(scene, object=shown, body=body, limbs=names)


def with_parts_behind(motion: ObjectTrack, more: ObjectTrack) -> ObjectTrack:
    """An object with the parts of another one appended to its own."""
    own = len(motion.meshes)  # drops the placeholder pose of a track without a mesh
    return ObjectTrack(
        (*motion.meshes, *more.meshes),
        torch.cat([motion.rotation[:, :own], more.rotation], dim=1),
        torch.cat([motion.translation[:, :own], more.translation], dim=1),
        torch.cat([motion.observed[:, :own], more.observed], dim=1),
    )
