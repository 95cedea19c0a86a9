"""Data sets in miniature: one known interaction, written in the exact layout of each source.

The interaction: an object that turns and travels with a right hand and a left hand that ride along,
so that a reading in another convention shows. MANO's files are stood in for by random arrays in
MANO's layout, built on the embedded hand.
"""

import json
import pickle
import sys
import types
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import scipy.sparse
import torch
import trimesh
from scipy.spatial.transform import Rotation

from geneoh.datasets.mano import Mano, read_mano
from geneoh.datasets.tracks import keypoints
from geneoh.hand.library import load_hand

FRAMES = 9
SIDES = ("right", "left")
FLIP = np.array([-1.0, 1.0, 1.0])


class Ch:
    """Stands in for a chumpy array while a file is written."""

    def __init__(self, x):
        self.x = x


def write_mano(folder: Path) -> Path:
    """MANO_RIGHT.pkl and MANO_LEFT.pkl with MANO's names, classes and quirks."""
    hand, draw = load_hand("right"), np.random.default_rng(0)
    module = types.ModuleType("chumpy.ch")
    Ch.__module__, module.Ch = "chumpy.ch", Ch
    sys.modules.setdefault("chumpy", types.ModuleType("chumpy"))
    sys.modules["chumpy.ch"] = module
    mean = 0.15 * draw.standard_normal((15, 3))
    components = 0.5 * draw.standard_normal((45, 45)) + 2 * np.eye(45)
    folder.mkdir(parents=True, exist_ok=True)
    for side in SIDES:
        flip = FLIP if side == "left" else np.ones(3)
        arrays = {
            "v_template": hand.template.double().numpy() * flip,
            "shapedirs": Ch(hand.shape_dirs.double().numpy()),  # of the right hand in both files
            "J_regressor": scipy.sparse.csc_matrix(hand.joint_regressor.double().numpy()),
            "hands_mean": (mean * (-flip if side == "left" else flip)).reshape(45),
            "hands_components": components,
            "f": hand.faces.numpy().astype(np.uint32),
            "bs_type": "lrotmin",
        }
        (folder / f"MANO_{side.upper()}.pkl").write_bytes(pickle.dumps(arrays, protocol=2))
    del sys.modules["chumpy.ch"], sys.modules["chumpy"]
    return folder


@dataclass(frozen=True)
class Scene:
    """The known interaction, float64; dicts by side."""

    pose: dict[str, np.ndarray]
    wrist: dict[str, np.ndarray]
    betas: dict[str, np.ndarray]
    joints: dict[str, np.ndarray]
    mano: dict[str, Mano]
    rotation: np.ndarray
    shift: np.ndarray
    verts: np.ndarray
    faces: np.ndarray

    def origin(self, side: str, left="as shipped") -> np.ndarray:
        """(T, 3) translation of MANO's origin."""
        return self.wrist[side] - self.mano[side].wrist_offset(self.betas[side], left)

    def matrices(self) -> np.ndarray:
        """(T, 4, 4) of the object to the world."""
        return rigid(self.rotation, self.shift)


def rigid(rotation: np.ndarray, shift: np.ndarray) -> np.ndarray:
    result = np.tile(np.eye(4), (len(rotation), 1, 1))
    result[:, :3, :3], result[:, :3, 3] = rotation, shift
    return result


def turns(vectors: np.ndarray) -> np.ndarray:
    return Rotation.from_rotvec(vectors).as_matrix()


def vectors(rotations: np.ndarray) -> np.ndarray:
    return Rotation.from_matrix(rotations).as_rotvec()


@cache
def scene(mano_dir: Path, left: str = "as shipped") -> Scene:
    """The interaction, with keypoints as the given left hand has them."""
    draw, time = np.random.default_rng(1), np.arange(FRAMES)[:, None]
    rotation = turns(time * [0.05, 0.12, -0.08] + [0.3, 0.1, 0.2])
    shift = [0.1, 0.2, 0.9] + time * [0.01, 0.004, 0.006]
    pose, wrist, betas, joints, mano = {}, {}, {}, {}, {}
    right_pose = 0.1 * draw.standard_normal((1, 16, 3)) + 0.01 * draw.standard_normal(
        (FRAMES, 16, 3)
    )
    right_pose[:, 1:, 2] += 0.4
    for side in SIDES:
        mano[side] = read_mano(mano_dir, side)
        place = np.array([0.1, 0.05, 0.02]) * (FLIP if side == "left" else 1)
        pose[side] = right_pose * (-FLIP if side == "left" else 1)
        start = turns(pose[side][0, 0])
        pose[side][:, 0] = vectors(rotation @ start)
        wrist[side] = rotation @ place + shift
        betas[side] = draw.standard_normal(10)
        offsets = mano[side].offsets(betas[side], left)
        joints[side] = keypoints(pose[side], wrist[side], offsets)
    box = trimesh.creation.box((0.06, 0.08, 0.05))
    verts = np.array(box.vertices + [0.0, 0.01, 0.0], dtype=np.float32).astype(np.float64)
    return Scene(pose, wrist, betas, joints, mano, rotation, shift, verts, np.array(box.faces))


def write_mesh(path: Path, verts: np.ndarray, faces: np.ndarray) -> None:
    """An OBJ, or a PLY by trimesh."""
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.suffix == ".ply":
        trimesh.Trimesh(verts, faces, process=False).export(path)
        return
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in verts.tolist()]
    path.write_text("\n".join([*lines, *(f"f {a} {b} {c}" for a, b, c in (faces + 1).tolist())]))


def dump(path: Path, value, protocol: int = 4) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(pickle.dumps(value, protocol=protocol))


def save(path: Path, array) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    np.save(path, array, allow_pickle=True)


def flat(pose: np.ndarray) -> np.ndarray:
    return pose.reshape(len(pose), 48)


def grab(root: Path, s: Scene, wrong: bool) -> None:
    turn = s.rotation if wrong else s.rotation.transpose(0, 2, 1)
    fields = {
        "gender": "male",
        "sbj_id": "s1",
        "obj_name": "mug",
        "motion_intent": "use",
        "framerate": 120.0,
        "n_frames": FRAMES,
        "n_comps": 24,
        "object": {
            "params": {"transl": s.shift, "global_orient": vectors(turn)},
            "object_mesh": "tools/object_meshes/contact_meshes/mug.ply",
        },
        "contact": {"object": np.zeros((FRAMES, len(s.verts)), np.int8)},
    }
    write_mesh(root / "tools/object_meshes/contact_meshes/mug.ply", s.verts, s.faces)
    for side, name in (("right", "rhand"), ("left", "lhand")):
        mano, betas = s.mano[side], s.betas[side]
        mesh = f"tools/subject_meshes/male/s1_{name}.ply"
        write_mesh(root / mesh, mano.template + mano.shape_dirs @ betas, s.faces)
        save(root / f"tools/subject_meshes/male/s1_{name}_betas.npy", betas)
        fields[name] = {
            "vtemp": mesh,
            "params": {
                "global_orient": s.pose[side][:, 0],
                "hand_pose": np.zeros((FRAMES, 24)),
                "transl": s.origin(side),
                "fullpose": flat(s.pose[side])[:, 3:],
            },
        }
    (root / "grab/s1").mkdir(parents=True)
    packed = {name: np.array(value, dtype=object) for name, value in fields.items()}
    np.savez(root / "grab/s1/mug_drink_1.npz", **packed)


CAMERA_TURN = np.array([0.005, -0.02, 0.01])
HOI_ID = "ZY20210800001/H1/{category}/N12/S55/s02/T1"


def cameras() -> np.ndarray:
    """(T, 4, 4) of a slowly moving camera to the world."""
    time = np.arange(FRAMES)[:, None]
    return rigid(turns(time * CAMERA_TURN), time * [0.002, 0.001, 0.0])


def hoi4d_hands(root: Path, s: Scene, name: str, wrong: bool) -> None:
    back = np.linalg.inv(cameras())
    for side in SIDES:
        orient = vectors(back[:, :3, :3] @ turns(s.pose[side][:, 0]))
        offset = s.mano[side].wrist_offset(s.betas[side], "as shipped")
        wrist = (back[:, :3, :3] @ s.wrist[side][..., None])[..., 0] + back[:, :3, 3]
        for t in range(FRAMES):
            fields = {
                "poseCoeff": np.concatenate([orient[t], flat(s.pose[side])[t, 3:]]).astype("f4"),
                "beta": s.betas[side].astype("f4"),
                "trans": (wrist[t] - (0 if wrong else offset)).astype("f4"),
                "kps2D": np.zeros((21, 2)),
            }
            dump(root / f"handpose/refinehandpose_{side}" / name / f"{t}.pickle", fields, 2)
    log = root / "HOI4D_annotations" / name / "3Dseg/output.log"
    log.parent.mkdir(parents=True, exist_ok=True)
    rows = [
        f"{t} {t} {t + 1}\n" + "\n".join(" ".join(f"{x:.9f}" for x in row) for row in block)
        for t, block in enumerate(cameras())
    ]
    log.write_text("\n".join(rows) + "\n")


def hoi4d_parts(root: Path, name: str, motions: list[np.ndarray]) -> None:
    back = np.linalg.inv(cameras())
    for t in range(FRAMES):
        items = []
        for index, motion in enumerate(motions):
            pose = back[t] @ motion[t]
            angles = Rotation.from_matrix(pose[:3, :3]).as_euler("XYZ")
            items.append(
                {
                    "id": index,
                    "label": f"part{index}",
                    "center": dict(zip("xyz", pose[:3, 3].tolist(), strict=True)),
                    "rotation": dict(zip("xyz", angles.tolist(), strict=True)),
                    "dimensions": {"length": 0.1, "width": 0.1, "height": 0.1},
                }
            )
        path = root / "HOI4D_annotations" / name / f"objpose/{t:05d}.json"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps({"dataList": items, "frameId": t, "isEffective": 1}))


def hoi4d(root: Path, s: Scene, wrong: bool) -> None:
    name = HOI_ID.format(category="C2")
    hoi4d_hands(root, s, name, wrong)
    hoi4d_parts(root, name, [s.matrices()])
    write_mesh(root / "HOI4D_CAD_Model_for_release/rigid/Mug/012.obj", s.verts, s.faces)


def opened(s: Scene) -> np.ndarray:
    """(T, 4, 4) of a second part that opens about the hinge x = 0 of the first."""
    hinge = turns(np.linspace(0.3, 0.9, FRAMES)[:, None] * [0.0, 0.0, -1.0])
    return rigid(s.rotation @ hinge, s.shift)


def lid(s: Scene) -> np.ndarray:
    """Vertices of the second part, which stands on the first one's edge."""
    return s.verts + [0.0, 0.08, 0.0]


def hoi4d_articulated(root: Path, s: Scene, wrong: bool) -> None:
    name = HOI_ID.format(category="C3")
    hoi4d_hands(root, s, name, False)
    hoi4d_parts(root, name, [s.matrices(), rigid(s.rotation, s.shift + [0.0, 0.0, 0.3])])
    folder = root / "HOI4D_CAD_Model_for_release/articulated/Laptop/012/objs"
    high, low = s.verts, s.verts - [0.0, 0.0, 0.3] @ s.rotation[0]
    # The poses stand in the other order than the meshes: [new-1, new-0].
    first, second = ("new-0-align", "new-1-align") if wrong else ("new-1-align", "new-0-align")
    write_mesh(folder / f"{first}.obj", high, s.faces)
    write_mesh(folder / f"{second}.obj", low, s.faces)


def arctic(root: Path, s: Scene, wrong: bool) -> None:
    hands = {}
    for side in SIDES:
        mano = s.mano[side]
        hands[side] = {
            "rot": s.pose[side][:, 0],
            "pose": flat(s.pose[side])[:, 3:] - mano.mean,
            "trans": s.origin(side),
            "shape": s.betas[side],
            "fitting_err": np.zeros(FRAMES),
        }
    save(root / "raw_seqs/s01/box_grab_01.mano.npy", hands)
    angle = np.linspace(0.3, 0.9, FRAMES)[:, None]
    values = np.concatenate([angle, vectors(s.rotation), 1000 * s.shift], axis=1)
    save(root / "raw_seqs/s01/box_grab_01.object.npy", values)
    folder = root / "meta/object_vtemplates/box"
    top, bottom = 1000 * lid(s), 1000 * s.verts
    faces = np.concatenate([s.faces, s.faces + len(top)])
    write_mesh(folder / "mesh.obj", np.concatenate([top, bottom]), faces)
    write_mesh(folder / "top.obj", top, s.faces)
    write_mesh(folder / "bottom.obj", bottom, s.faces)
    ids = [int(wrong)] * len(top) + [int(not wrong)] * len(bottom)
    (folder / "parts.json").write_text(json.dumps(ids))


def taco(root: Path, s: Scene, wrong: bool) -> None:
    name = "(stir, spoon, bowl)/20230917_001"
    for side, role, number in (("right", "tool", "010"), ("left", "target", "022")):
        frames = {
            f"{t:05d}": {
                "hand_pose": torch.from_numpy(flat(s.pose[side])[t]).float(),
                "hand_trans": torch.from_numpy(s.wrist[side][t]).float(),
            }
            for t in range(FRAMES)
        }
        dump(root / "Hand_Poses" / name / f"{side}_hand.pkl", frames)
        shape = {"hand_shape": torch.from_numpy(s.betas[side]).float()}
        dump(root / "Hand_Poses" / name / f"{side}_hand_shape.pkl", shape)
        save(root / "Object_Poses" / name / f"{role}_{number}.npy", s.matrices())
        scale = 1 if wrong else 100
        write_mesh(root / f"Object_Models/{number}_cm.obj", scale * s.verts, s.faces)


def taco_pickle(root: Path, s: Scene, wrong: bool) -> None:
    moved = s.verts @ s.rotation.transpose(0, 2, 1) + s.shift[:, None]
    pose = rigid(s.rotation.transpose(0, 2, 1) if wrong else s.rotation, s.shift)
    dump(
        root / "20231104_010.pkl",
        {
            "hand_pose": flat(s.pose["left"]).astype("f4"),
            "hand_trans": s.wrist["left"].astype("f4"),
            "hand_shape": s.betas["left"].astype("f4"),
            "hand_verts": hand_verts(s, "left").astype("f4"),
            "hand_faces": np.zeros((1538, 3), np.int64),
            "obj_verts": moved.astype("f4"),
            "obj_faces": s.faces.astype(np.int32),
            "obj_pose": pose.astype("f4"),
        },
    )
    write_mesh(root / "20231104_010.obj", s.verts, s.faces)


def hand_verts(s: Scene, side: str) -> np.ndarray:
    """(T, 778, 3) that turn with the wrist."""
    mano = s.mano[side]
    rest = mano.template + mano.shape_dirs @ s.betas[side]
    local = rest - mano.joint_regressor[0] @ rest
    return local @ turns(s.pose[side][:, 0]).transpose(0, 2, 1) + s.wrist[side][:, None]


@dataclass(frozen=True)
class Case:
    """How one source is written, and what its wrong twin is caught by."""

    source: str
    build: Callable[[Path, Scene, bool], None]
    caught: str
    """Words of the self-test about the wrong twin."""
    start: str = "."
    """Where the reading starts."""
    parts: int = 1
    only: tuple[str, ...] = SIDES
    fps: float = 30.0
    posed: bool = True
    joints: bool = True
    left: str = "as shipped"
    object: bool = True
    known: tuple[tuple[str, object], ...] = ()


CASES = [
    Case("grab", grab, "rotation transposed", fps=120.0),
    Case("hoi4d", hoi4d, "that of the wrist", fps=15.0),
    Case("hoi4d", hoi4d_articulated, "the order of the parts", parts=2, fps=15.0),
    Case("arctic", arctic, "parts.json calls top", parts=2),
    Case("taco", taco, "too small for a hand"),
    Case("taco_pickle", taco_pickle, "from the stored object", only=("left",)),
]
