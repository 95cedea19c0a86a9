"""A body as rigid parts that can be drawn: one rounded bone for each joint, and a head."""

from jaxtyping import Float
from torch import Tensor

from geneoh.body.motion import pose
from geneoh.body.skeleton import BODY_JOINTS, JOINT_NAMES, PARENTS
from geneoh.geometry.mesh import Mesh
from geneoh.geometry.mesh_files import from_trimesh
from geneoh.interrupts import interrupts_wait
from geneoh.readers.bodies.base import BodyRecording
from geneoh.sequence.sequence import ObjectTrack

with interrupts_wait():
    import trimesh

RADII = {
    **{"spine": 0.1, "neck": 0.06, "head": 0.05, "hip": 0.08, "knee": 0.065, "ankle": 0.05},
    **{"foot": 0.04, "collar": 0.07, "shoulder": 0.06, "elbow": 0.042, "wrist": 0.032},
}
"""Radius in metres of the bone that ends in each joint."""
HEAD_RADII, HEAD_ABOVE = (0.075, 0.11, 0.09), (0.0, 0.09, 0.02)
"""Semi-axes of the head's ellipsoid, and its centre relative to the head joint, metres."""
BONE_SIDES = 10  # points around a bone


def mannequin(body: BodyRecording) -> tuple[tuple[str, ...], ObjectTrack]:
    """The bones of a body without its hands, as rigid parts in the world frame of its file.

    Returns their names, such as "left_elbow_to_left_wrist" of a forearm, and their motion.
    """
    motion = body.file_motion
    posed = pose(body.skeleton, motion)
    ends = [j for j in range(1, BODY_JOINTS) if bool(body.skeleton.offsets[j].norm() > 1e-3)]
    moved_by = [*(PARENTS[joint] for joint in ends), JOINT_NAMES.index("head")]
    names = [f"{JOINT_NAMES[PARENTS[joint]]}_to_{JOINT_NAMES[joint]}" for joint in ends]
    meshes = [bone(JOINT_NAMES[joint], body.skeleton.offsets[joint]) for joint in ends]
    rotation, translation = posed.rotations[:, moved_by], posed.positions[:, moved_by]
    return (*names, "head"), ObjectTrack((*meshes, head()), rotation, translation)


def bone(name: str, offset: Float[Tensor, " 3"]) -> Mesh:
    """A capsule from a joint at the origin to its child joint at `offset`."""
    radius = RADII[name.split("_")[-1].rstrip("123")]
    length = float(offset.norm())
    shape = trimesh.creation.capsule(length, radius, count=(BONE_SIDES, BONE_SIDES))
    shape.apply_translation((0, 0, length / 2 - shape.bounds[:, 2].mean()))
    turn = trimesh.geometry.align_vectors((0, 0, 1), (offset / length).numpy())
    assert turn is not None, "two directions of three numbers"
    shape.apply_transform(turn)
    return from_trimesh(shape)


def head() -> Mesh:
    """An ellipsoid above the head joint."""
    shape = trimesh.creation.icosphere(2)
    shape.apply_scale(HEAD_RADII)
    shape.apply_translation(HEAD_ABOVE)
    return from_trimesh(shape)
