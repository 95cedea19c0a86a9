"""One recording of a data set or an estimator, from the files as they are distributed."""

from pathlib import Path
from typing import Any

import numpy as np

from geneoh.choices import JointOrder, Side, Translation, Unit
from geneoh.config import checked_call
from geneoh.errors import ConfigError
from geneoh.geometry.mesh import METRES, MeshInput, meshes_of
from geneoh.readers.base import ReaderOptions
from geneoh.readers.foreign_files import read_array
from geneoh.readers.recordings import read_one
from geneoh.readers.records import Array, Place
from geneoh.sequence.sequence import Sequence
from geneoh.sequence.validation import check_sequence


@checked_call
def read(
    source: str,
    path: Path | str,
    *,
    clip: str | None = None,
    obj: MeshInput = (),
    object_pose: Path | str | Array | None = None,
    objects: Path | str | None = None,
    mano_dir: Path | str | None = None,
    body: Path | str | None = None,
    side: Side | None = None,
    fps: float | None = None,
    unit: Unit = "m",
    joint_order: JointOrder = "openpose",
    keypoint_unit: Unit | None = None,
    translation: Translation | None = None,
    mean_pose: bool | None = None,
    swap_parts: bool = False,
    focal: float | None = None,
    camera: Place | None = None,
) -> Sequence:
    """Read one recording of a data set or an estimator, as `geneoh denoise --from` does.

    Args:
        source: whose files they are, such as "hoi4d" or "hamer"; `geneoh convert --help` lists all.
        path: the file or folder of the recording, as the data set unpacks.
        clip: which recording, where the path holds several.
        obj: mesh of the object or its file, or one per rigid part, for sources without meshes.
        object_pose: (T, 4, 4) or (T, Q, 4, 4) object to the hand's frame, or the npy file of it,
            for sources without an object.
        objects: folder of the data set's object meshes, where they are not in their usual place.
        mano_dir: folder of your MANO files, which some sources need.
        body: your SMPL+H model, for sources whose hands belong to a body.
        side: of two hands, the one to keep; for bare arrays, the side that they are of.
        fps: frames a second, instead of the source's own.
        unit: of the mesh files in `obj`.
        joint_order: order of bare keypoints.
        keypoint_unit: of bare keypoints and of `object_pose` beside them, by default metres.
        translation: what the translation of bare MANO parameters moves.
        mean_pose: whether bare MANO parameters are relative to MANO's mean pose.
        swap_parts: HOI4D, whether the poses of the two parts are stored in exchanged order.
        focal: focal length of the camera in pixels, for HaMeR and WiLoR.
        camera: position of the camera in the world, metres, where the source does not say it and
            the hand was estimated from images; (0, 0, 0) where the coordinates are the camera's.

    Raises:
        ConfigError: there is no source of that name, or it holds no bare keypoints of any unit.
        InputError: a file cannot be read, or several recordings are there and `clip` is not given.
        MissingAssetError: a file that the user must supply is not there.
    """
    if keypoint_unit is not None and source not in ("keypoints", "landmarks"):
        raise ConfigError(f"--keypoint-unit is for bare keypoints, got {source}; drop it")
    options = options_with_files(
        mano_dir=as_path(mano_dir),
        body=as_path(body),
        objects=as_path(objects),
        obj=obj,
        object_pose=object_pose,
        side=side,
        fps=fps,
        unit=unit,
        joint_order=joint_order,
        keypoint_unit=keypoint_unit,
        translation=translation,
        swap_parts=swap_parts,
        mean_pose=mean_pose,
        focal=focal,
        camera=camera,
    )
    recording = read_one(source, Path(path), options, clip)
    check_sequence(recording.sequence, recording.name)
    return recording.sequence


def options_with_files(
    *,
    obj: MeshInput,
    object_pose: Path | str | Array | None,
    unit: Unit = "m",
    keypoint_unit: Unit | None = None,
    **others: Any,
) -> ReaderOptions:
    """Options with the files read that hold the object's meshes and poses; see `read`."""
    if isinstance(object_pose, Path | str):
        object_pose = read_array(Path(object_pose), ("T", 4, 4), ("T", "Q", 4, 4))
    if object_pose is not None and keypoint_unit is not None:
        object_pose = np.array(object_pose, dtype=np.float64)
        object_pose[..., :3, 3] *= METRES[keypoint_unit]
    given = {"object_pose": object_pose, "keypoint_unit": keypoint_unit, **others}
    return ReaderOptions(meshes=meshes_of(obj, unit), **given)


def as_path(given: Path | str | None) -> Path | None:
    """A path that may be missing."""
    return None if given is None else Path(given)
