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
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
import scipy.sparse
import torch
import trimesh
from scipy.spatial.transform import Rotation

from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.library import load_hand
from geneoh.hand.skeleton import PARENTS, TIP_PARENTS, forward_kinematics
from geneoh.readers.builders import OPENPOSE_FROM_MANO
from geneoh.readers.joint_orders import ORDERS
from geneoh.readers.sources.fphab import EXTRINSIC

FRAMES = 9
SIDES = ("right", "left")
FLIP = np.array([-1.0, 1.0, 1.0])


class Ch:
    """Stands in for a chumpy array while a file is written."""

    def __init__(self, x):
        self.x = x


def mano_arrays(side: str) -> dict[str, np.ndarray]:
    """What a file of MANO holds, with its quirks."""
    hand, draw, flip = load_hand(side), np.random.default_rng(0), np.ones(3)
    mean = 0.15 * draw.standard_normal((15, 3))
    return {
        "v_template": hand.template.double().numpy(),
        "shapedirs": load_hand("right").shape_dirs.double().numpy(),  # of the right in both files
        "posedirs": hand.pose_dirs.double().numpy(),
        "J_regressor": hand.joint_regressor.double().numpy(),
        "weights": hand.skin_weights.double().numpy(),
        "kintree_table": np.array([[2**32 - 1, *PARENTS[1:]], range(16)], dtype=np.uint32),
        "hands_mean": (mean * (-FLIP if side == "left" else flip)).reshape(45),
        "hands_components": 0.1 * draw.standard_normal((45, 45)) + 2 * np.eye(45),
        "f": hand.faces.numpy().astype(np.uint32),
    }


class Hand:
    """One side of MANO in plain numpy, float64."""

    def __init__(self, side: str) -> None:
        arrays = mano_arrays(side)
        self.side, self.template = side, arrays["v_template"]
        self.shape_dirs, self.joint_regressor = arrays["shapedirs"], arrays["J_regressor"]
        self.mean, self.components = arrays["hands_mean"], arrays["hands_components"]

    def rest(self, betas: np.ndarray, left: str) -> np.ndarray:
        """(V, 3) vertices of the rest pose."""
        flip = FLIP if self.side == "left" and left == "mirrored" else np.ones(3)
        return self.template + (self.shape_dirs * flip[:, None]) @ betas

    def wrist_offset(self, betas: np.ndarray, left: str = "as shipped") -> np.ndarray:
        return (self.joint_regressor @ self.rest(betas, left))[0]

    def keypoints(self, pose, wrist, betas, left: str = "as shipped") -> np.ndarray:
        """(T, 21, 3) in OpenPose's order."""
        verts = self.rest(betas, left)
        joints, tips = self.joint_regressor @ verts, verts[list(load_hand("right").tip_verts)]
        bones = joints[1:] - joints[list(PARENTS[1:])]
        offsets = np.concatenate([bones, tips - joints[list(TIP_PARENTS)]])
        turned = axis_angle_to_matrix(torch.from_numpy(pose))
        offsets = torch.from_numpy(offsets).expand(len(pose), 20, 3)
        return forward_kinematics(turned, torch.from_numpy(wrist), offsets)[0].numpy()


def write_mano(folder: Path) -> Path:
    """MANO_RIGHT.pkl and MANO_LEFT.pkl with MANO's names and classes."""
    module = types.ModuleType("chumpy.ch")
    Ch.__module__, module.Ch = "chumpy.ch", Ch
    sys.modules.setdefault("chumpy", types.ModuleType("chumpy"))
    sys.modules["chumpy.ch"] = module
    folder.mkdir(parents=True, exist_ok=True)
    for side in SIDES:
        arrays: dict[str, object] = {**mano_arrays(side), "bs_type": "lrotmin"}
        arrays["shapedirs"] = Ch(arrays["shapedirs"])
        arrays["J_regressor"] = scipy.sparse.csc_matrix(arrays["J_regressor"])
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
    mano: dict[str, Hand]
    rotation: np.ndarray
    shift: np.ndarray
    verts: np.ndarray
    faces: np.ndarray
    angle: np.ndarray
    """(T,) of a second part."""

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
def scene(left: str = "as shipped") -> Scene:
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
        mano[side] = Hand(side)
        place = np.array([0.1, 0.05, 0.02]) * (FLIP if side == "left" else 1)
        pose[side] = right_pose * (-FLIP if side == "left" else 1)
        start = turns(pose[side][0, 0])
        pose[side][:, 0] = vectors(rotation @ start)
        wrist[side] = rotation @ place + shift
        betas[side] = draw.standard_normal(10)
        joints[side] = mano[side].keypoints(pose[side], wrist[side], betas[side], left)
    box = trimesh.creation.box((0.06, 0.08, 0.05))
    verts = np.array(box.vertices, dtype=np.float32).astype(np.float64)
    angle = np.linspace(0.3, 0.9, FRAMES)
    faces = np.array(box.faces)
    return Scene(pose, wrist, betas, joints, mano, rotation, shift, verts, faces, angle)


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


def in_clip(s: Scene, side: str) -> Scene:
    """The scene as a clip can hold it: 24 components, and a mesh whose middle is not its origin."""
    mano, aside = s.mano[side], np.array([0.02, -0.01, 0.03])
    own = mano.components[:24]
    coefficients = np.linalg.solve(own[:, :24].T, flat(s.pose[side])[:, 3:27].T).T
    pose = np.concatenate([s.pose[side][:, :1], (coefficients @ own).reshape(-1, 15, 3)], axis=1)
    joints = mano.keypoints(pose, s.wrist[side], s.betas[side])
    return replace(
        s,
        pose={**s.pose, side: pose},
        joints={**s.joints, side: joints},
        verts=s.verts + aside,
        shift=s.shift - s.rotation @ aside,
    )


def middle(s: Scene) -> np.ndarray:
    """(T, 3) mean of the object's vertices."""
    return s.rotation @ s.verts.mean(0) + s.shift


def centred(s: Scene, side: str) -> Scene:
    """Everything moved so that the middle of the object is the origin in each frame."""
    return replace(
        s,
        wrist={**s.wrist, side: s.wrist[side] - middle(s)},
        joints={**s.joints, side: s.joints[side] - middle(s)[:, None]},
        shift=s.shift - middle(s),
    )


def clip_array(s: Scene, side: str, wrong: bool) -> np.ndarray:
    """A clip of a scene that `in_clip` made, as TOCH's scripts write it."""
    flip = FLIP if side == "left" else np.ones(3)
    count, own = 40, s.mano[side].components[:24]
    model = mano_model(side)
    verts = model.shaped(torch.from_numpy(s.betas[side]).float()).posed(
        torch.from_numpy(s.pose[side]).float(), torch.from_numpy(s.wrist[side]).float()
    )
    share = np.random.default_rng(3).dirichlet(np.ones(3), count)
    points = np.einsum("pk,pkx->px", share, s.verts[s.faces[np.arange(count) % len(s.faces)]])
    points = points @ s.rotation.transpose(0, 2, 1) + s.shift[:, None] - middle(s)[:, None]
    hand = verts.verts.double().numpy() - middle(s)[:, None]
    turn = s.rotation if wrong else s.rotation.transpose(0, 2, 1)
    coefficients = np.linalg.lstsq(own.T, flat(s.pose[side])[:, 3:].T, rcond=None)[0].T
    sizes = (2334, 3, 24, 3 * count, 3 * count, 3, 3)
    form: list = [(f"f{k}", "f4", (size,)) for k, size in enumerate(sizes)]
    clip = np.zeros(FRAMES, dtype=[*form, ("f7", "i4"), ("f8", "i4"), ("f9", "?")])
    clip["f0"], clip["f3"] = (
        (flip * values).reshape(FRAMES, -1).astype("f4") for values in (hand, points)
    )
    clip["f1"], clip["f2"] = s.pose[side][:, 0], coefficients
    clip["f5"] = vectors(turn)
    clip["f6"] = s.shift - flip * middle(s)  # for left hands the mirrored middle, as TOCH has it
    clip["f7"], clip["f8"], clip["f9"] = 1, 500 + np.arange(FRAMES), side == "left"
    return clip


@cache
def mano_model(side: str):
    """MANO with the official left file, from the embedded hand."""
    return replace(load_hand(side), shape_dirs=load_hand("right").shape_dirs)


def grab_listing(root: Path, s: Scene) -> None:
    for name, size in (("apple", 0.5), ("mug", 1.0), ("table", 2.0)):
        write_mesh(root / f"data/grab/object_meshes/{name}.ply", size * s.verts, s.faces)


def grab_clips(root: Path, s: Scene, wrong: bool) -> None:
    """GeneOH's clip of a right hand, with the person's betas and places."""
    s = in_clip(s, "right")
    save(root / "data/grab/source_data/test/14.npy", clip_array(s, "right", wrong))
    save(root / "data/grab/source_data/test/14_meta_data.npy", {"clip_len": FRAMES})
    model = mano_model("right").shaped(torch.from_numpy(s.betas["right"]).float())
    pose, wrist = (torch.from_numpy(x["right"]).float() for x in (s.pose, s.wrist))
    fields = {
        "rhand_verts": model.posed(pose, wrist).verts.numpy(),
        "rhand_global_orient": s.pose["right"][:, 0].astype("f4"),
        "rhand_hand_pose": np.zeros((FRAMES, 24), "f4"),
        "rhand_transl": s.origin("right").astype("f4"),
        "rhand_betas": s.betas["right"].astype("f4"),
    }
    save(root / "data/grab/source_data_wsubj/test/14_subj.npy", fields)
    grab_listing(root, s)


def grab_clips_left(root: Path, s: Scene, wrong: bool) -> None:
    """TOCH's clip of a left hand, with correspondences; the wrong one lists another object."""
    s = in_clip(s, "left")
    clip = clip_array(s, "left", False)
    clip["f7"] -= wrong
    more = [("f9", "?", (40,)), ("f10", "f4", (40,)), ("f11", "f4", (120,)), ("f12", "?")]
    longer = np.zeros(FRAMES, dtype=clip.dtype.descr[:9] + more)
    for name in clip.dtype.names[:9]:
        longer[name] = clip[name]
    longer["f12"] = True
    save(root / "data/grab/source_data/test/7.npy", longer)
    grab_listing(root, s)


def hoi4d_cases(root: Path, s: Scene, wrong: bool) -> None:
    joints = s.joints["right"][:, np.argsort(OPENPOSE_FROM_MANO)]
    trans = s.wrist["right"] if wrong else s.origin("right")
    frames = {
        t: {
            "theta": torch.from_numpy(flat(s.pose["right"])[t][None]).float(),
            "beta": torch.from_numpy(s.betas["right"][None]).float(),
            "trans": torch.from_numpy(trans[t][None]).float(),
            "joints": joints[t].reshape(63).astype("f4"),
            "obj_rot": s.rotation[t],
            "obj_trans": s.shift[t],
        }
        for t in range(FRAMES)
    }
    save(root / "Mug/case3/merged_data.npy", frames)
    flag = {"case_flag": HOI_ID.format(category="C2")}
    save(root / "Mug/case3/meta_data.npy", flag)
    write_mesh(root / "HOI4D_CAD_Model_for_release/rigid/Mug/012.obj", s.verts, s.faces)


def halved(s: Scene) -> Scene:
    """The scene as it comes out of half precision, in which ArcticNet's predictions are stored."""
    pose, wrist, joints, betas = {}, {}, {}, {}
    for side in SIDES:
        mean = np.concatenate([np.zeros(3), s.mano[side].mean])
        relative = turns((flat(s.pose[side]) - mean).reshape(-1, 3)).astype("f2").astype("f8")
        pose[side] = vectors(relative).reshape(FRAMES, 16, 3) + mean.reshape(16, 3)
        betas[side] = s.betas[side].astype("f2").astype("f8")
        origin = s.origin(side).astype("f2").astype("f8")
        wrist[side] = origin + s.mano[side].wrist_offset(betas[side])
        joints[side] = s.mano[side].keypoints(pose[side], wrist[side], betas[side])
    rotation = turns(vectors(s.rotation).astype("f2").astype("f8"))
    shift, angle = (values.astype("f2").astype("f8") for values in (s.shift, s.angle))
    hands = {"pose": pose, "wrist": wrist, "joints": joints, "betas": betas}
    return replace(s, **hands, rotation=rotation, shift=shift, angle=angle)


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
    hinge = turns(s.angle[:, None] * [0.0, 0.0, -1.0])
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


def arctic(root: Path, s: Scene, wrong: bool) -> dict:
    hands = {}
    for side in SIDES:
        mano = s.mano[side]
        hands[side] = {
            "rot": s.pose[side][:, 0],
            "pose": flat(s.pose[side])[:, 3:] - mano.mean,
            "trans": s.origin(side),
            "shape": s.betas[side],
            "fitting_err": 0.001 * (1 + np.arange(FRAMES)),
        }
    save(root / "raw_seqs/s01/box_grab_01.mano.npy", hands)
    values = np.concatenate([s.angle[:, None], vectors(s.rotation), 1000 * s.shift], axis=1)
    save(root / "raw_seqs/s01/box_grab_01.object.npy", values)
    folder = root / "meta/object_vtemplates/box"
    top, bottom = 1000 * lid(s), 1000 * s.verts
    faces = np.concatenate([s.faces, s.faces + len(top)])
    write_mesh(folder / "mesh.obj", np.concatenate([top, bottom]), faces)
    write_mesh(folder / "top.obj", top, s.faces)
    write_mesh(folder / "bottom.obj", bottom, s.faces)
    ids = [int(wrong)] * len(top) + [int(not wrong)] * len(bottom)
    (folder / "parts.json").write_text(json.dumps(ids))
    return hands


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


def arctic_processed(root: Path, s: Scene, wrong: bool) -> None:
    raw = arctic(root, s, False)
    from_m = np.argsort(OPENPOSE_FROM_MANO)
    params, world = {}, {}
    for side in SIDES:
        for name in ("rot", "pose", "trans"):
            params[f"{name}_{side[0]}"] = raw[side][name].astype("f4")
        params[f"shape_{side[0]}"] = np.tile(raw[side]["shape"], (FRAMES, 1)).astype("f4")
        world[f"joints.{side}"] = s.joints[side][:, from_m].astype("f4")
    params["obj_arti"] = s.angle
    params["obj_rot"] = vectors(s.rotation)
    params["obj_trans"] = s.shift * (1 if wrong else 1000)
    lids = lid(s) @ opened(s)[:, :3, :3].transpose(0, 2, 1) + s.shift[:, None]
    boxes = s.verts @ s.rotation.transpose(0, 2, 1) + s.shift[:, None]
    world["verts.object"] = np.concatenate([lids, boxes], axis=1).astype("f4")
    fields = {"world_coord": world, "cam_coord": {}, "2d": {}, "bbox": {}, "params": params}
    save(root / "outputs/processed_verts/seqs/s01/box_grab_01.npy", fields)
    (root / "outputs/meta").symlink_to(root / "meta")


def arcticnet(root: Path, s: Scene, wrong: bool) -> None:
    arctic(root / "data", s, False)
    folder = root / "eval/s01_box_grab_01_1"
    (folder / "preds").mkdir(parents=True)
    (folder / "meta_info").mkdir()
    names = [f"./images/s01/box_grab_01/1/{t + 33:05d}.jpg" for t in range(FRAMES)]
    torch.save(names, folder / "meta_info/meta_info.imgname.pt")

    def put(key: str, values: np.ndarray) -> None:
        padded = np.concatenate([values, values[-1:]])
        torch.save(torch.from_numpy(padded).half(), folder / f"preds/pred.{key}.pt")

    for side in SIDES:
        relative = flat(s.pose[side]) - np.concatenate([np.zeros(3), s.mano[side].mean])
        put(f"mano.pose.{side[0]}", turns(relative.reshape(-1, 3)).reshape(FRAMES, 16, 3, 3))
        put(f"mano.beta.{side[0]}", np.tile(s.betas[side], (FRAMES, 1)))
        put(f"mano.cam_t.{side[0]}", s.wrist[side] if wrong else s.origin(side))
    put("object.rot", vectors(s.rotation))
    put("object.cam_t", s.shift)
    put("object.radian", s.angle)


def text_frames(folder: Path, rows: np.ndarray) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for t, row in enumerate(rows):
        (folder / f"{t:06d}.txt").write_text(" ".join(f"{x:.9f}" for x in row.ravel()))


def h2o(root: Path, s: Scene, wrong: bool) -> None:
    folder, back = root / "subject1/h1/0/cam4", np.linalg.inv(cameras())
    hands, points = [], []
    for side in ("left", "right"):
        orient = vectors(back[:, :3, :3] @ turns(s.pose[side][:, 0]))
        wrist = (back[:, :3, :3] @ s.wrist[side][..., None])[..., 0] + back[:, :3, 3]
        offset = 0 if wrong else s.mano[side].wrist_offset(s.betas[side], "as shipped")
        flag = np.ones((FRAMES, 1))
        betas = np.tile(s.betas[side], (FRAMES, 1))
        hands += [flag, wrist - offset, orient, flat(s.pose[side])[:, 3:], betas]
        joints = s.joints[side] @ back[:, :3, :3].transpose(0, 2, 1) + back[:, None, :3, 3]
        points += [flag, joints.reshape(FRAMES, 63)]
    text_frames(folder / "hand_pose_mano", np.concatenate(hands, axis=1))
    text_frames(folder / "hand_pose", np.concatenate(points, axis=1))
    placed = (back @ s.matrices()).reshape(FRAMES, 16)
    text_frames(folder / "obj_pose_rt", np.concatenate([np.full((FRAMES, 1), 5), placed], axis=1))
    text_frames(folder / "cam_pose", cameras())
    write_mesh(root / "object/milk/milk.obj", s.verts, s.faces)


def dexycb(root: Path, s: Scene, wrong: bool) -> None:
    folder, serial = root / "20200709-subject-01/20200709_141754", "836212060125"
    mano = s.mano["right"]
    coefficients = np.linalg.solve(mano.components.T, (flat(s.pose["right"])[:, 3:] - mano.mean).T)
    trans = s.wrist["right"] if wrong else s.origin("right")
    hand = np.concatenate([s.pose["right"][:, 0], coefficients.T, trans], axis=1)
    other = np.tile([0.0, 0, 0, 1, 0, 0, 0], (FRAMES, 1))
    grasped = np.concatenate([Rotation.from_matrix(s.rotation).as_quat(), s.shift], axis=1)
    folder.mkdir(parents=True)
    np.savez(
        folder / "pose.npz",
        pose_y=np.stack([other, grasped], axis=1).astype("f4"),
        pose_m=hand[:, None].astype("f4"),
    )
    (folder / "meta.yml").write_text(
        f"serials:\n- '{serial}'\nnum_frames: {FRAMES}\nextrinsics: '20200702_151821'\n"
        "ycb_ids:\n- 2\n- 14\nycb_grasp_ind: 1\nmano_sides:\n- right\n"
        "mano_calib:\n- 20200514-subject-01_right\n"
    )
    camera = rigid(turns(np.array([[0.3, -0.2, 0.1]])), np.array([[0.1, 0.2, -0.5]]))[0]
    rows = "\n".join(f"  - {x:.9f}" for x in camera[:3].ravel())
    calibration = root / "calibration/extrinsics_20200702_151821/extrinsics.yml"
    calibration.parent.mkdir(parents=True)
    calibration.write_text(f"extrinsics:\n  '{serial}':\n{rows}\n")
    betas = root / "calibration/mano_20200514-subject-01_right/mano.yml"
    betas.parent.mkdir(parents=True)
    betas.write_text("betas:\n" + "\n".join(f"- {x:.9f}" for x in s.betas["right"]))
    back = np.linalg.inv(camera)
    (folder / serial).mkdir()
    for t in range(FRAMES):
        joints = s.joints["right"][t] @ back[:3, :3].T + back[:3, 3]
        np.savez(
            folder / serial / f"labels_{t:06d}.npz",
            seg=np.zeros((4, 4), np.uint8),
            joint_3d=joints[None].astype("f4"),
        )
    write_mesh(root / "models/025_mug/textured_simple.obj", s.verts, s.faces)


def ho3d(root: Path, s: Scene, wrong: bool) -> None:
    gl = np.diag([1.0, -1.0, -1.0])
    offset = 0 if wrong else s.mano["right"].wrist_offset(s.betas["right"], "as shipped")
    orient = vectors(gl @ turns(s.pose["right"][:, 0]))
    joints = (s.joints["right"] @ gl)[:, np.argsort(OPENPOSE_FROM_MANO)]
    for t in range(FRAMES):
        fields = {
            "handPose": np.concatenate([orient[t], flat(s.pose["right"])[t, 3:]]),
            "handTrans": gl @ s.wrist["right"][t] - offset,
            "handBeta": s.betas["right"],
            "handJoints3D": joints[t],
            "objRot": vectors(gl @ s.rotation[t])[:, None],
            "objTrans": gl @ s.shift[t],
            "objName": "025_mug",
            "objLabel": 14,
            "camMat": np.eye(3),
        }
        dump(root / f"train/ABF10/meta/{t:04d}.pkl", fields, 2)
    write_mesh(root / "models/025_mug/textured_simple.obj", s.verts, s.faces)


def oakink(root: Path, s: Scene, wrong: bool) -> None:
    anno = root / "image/anno"
    middle = (s.verts.max(0) + s.verts.min(0)) / 2
    moved = s.shift + s.rotation @ middle  # of the mesh with its bounding box centred
    extrinsic = rigid(turns(np.array([[0.2, 0.1, -0.3]])), np.array([[0.1, 0.0, 0.5]]))[0]
    trans = s.origin("right") if wrong else s.wrist["right"]
    quats = Rotation.from_rotvec(s.pose["right"].reshape(-1, 3)).as_quat()[:, [3, 0, 1, 2]]
    for t in range(FRAMES):
        name = f"A01001_0001_0000__2021-09-26-19-59-58__0__{t}__0.pkl"
        fields = {
            "hand_anno": {
                "hand_pose": torch.from_numpy(quats.reshape(FRAMES, 16, 4)[t]).float(),
                "hand_shape": torch.from_numpy(s.betas["right"]).float(),
                "hand_tsl": torch.from_numpy(trans[t]).float(),
            },
            "cam_extr": extrinsic,
            "obj_anno": rigid(s.rotation, moved)[t],
        }
        dump(anno / "general_info" / name, fields)
        joints = s.joints["right"][t] @ extrinsic[:3, :3].T + extrinsic[:3, 3]
        dump(anno / "hand_j" / name, joints.astype("f4"))
    write_mesh(root / "image/obj/A01001.obj", s.verts + [0.5, 0.0, 0.1], s.faces)


def oakink2(root: Path, s: Scene, wrong: bool) -> None:
    frames = [100 + 4 * t for t in range(FRAMES)]
    mano = {}
    for t, frame in enumerate(frames):
        mano[frame] = {}
        for side, prefix in (("right", "rh__"), ("left", "lh__")):
            quats = Rotation.from_rotvec(s.pose[side][t]).as_quat()[None, :, [3, 0, 1, 2]]
            trans = s.origin(side) if wrong else s.wrist[side]
            mano[frame][f"{prefix}pose_coeffs"] = torch.from_numpy(quats).float()
            mano[frame][f"{prefix}tsl"] = torch.from_numpy(trans[t : t + 1]).float()
            mano[frame][f"{prefix}betas"] = torch.from_numpy(s.betas[side][None]).float()
    poses = {frame: s.matrices()[t].astype("f4") for t, frame in enumerate(frames)}
    fields = {
        "mocap_frame_id_list": frames,
        "frame_id_list": frames,
        "obj_list": ["O02@0015@00001"],
        "obj_transf": {"O02@0015@00001": poses},
        "raw_mano": mano,
    }
    dump(root / "anno_preview/scene_01__A001++seq__a.pkl", fields)
    folder = root / "object_raw/align_ds/O02@0015@00001"
    write_mesh(folder / "scan.obj", s.verts, s.faces)


def fphab(root: Path, s: Scene, wrong: bool) -> None:
    way, offset = "Subject_1/open_milk/1", 0
    if not wrong:
        offset = s.mano["right"].wrist_offset(s.betas["right"], "as shipped")
    back = np.linalg.inv(EXTRINSIC)
    scaled = s.matrices()
    scaled[:, :3, 3] *= 1000
    fits = {}
    for t in range(FRAMES):
        fits[f"{t:06d}.pkl"] = {
            "fullpose": flat(s.pose["right"])[t],
            "pose": np.zeros(18),
            "shape": s.betas["right"],
            "trans": s.wrist["right"][t] - offset,
            "side": "right",
            "ncomps": 15,
            "err": np.zeros(1),
        }
    dump(root / "fhbhands_fits" / way / "pkls.pkl", fits)
    joints = 1000 * s.joints["right"] @ back[:3, :3].T + back[:3, 3]
    joints = joints[:, np.argsort(ORDERS["fphab"].entries)].reshape(FRAMES, 63)
    for folder, file, rows in (
        ("Hand_pose_annotation_v1_1", "skeleton.txt", joints),
        ("Object_6D_pose_annotation_v1_1", "object_pose.txt", (back @ scaled).swapaxes(1, 2)),
    ):
        path = root / folder / way / file
        path.parent.mkdir(parents=True)
        lines = [f"{t} " + " ".join(f"{x:.7f}" for x in row.ravel()) for t, row in enumerate(rows)]
        path.write_text("\n".join(lines))
    write_mesh(root / "Object_models/milk_model/milk_model.ply", s.verts, s.faces)


class NumpyArrayWrapper:
    """Stands in for joblib's description of an array while a file is written."""


class JoblibPickler(pickle._Pickler):
    """Writes as joblib.dump does: the bytes of an array right behind its description."""

    def save(self, obj, save_persistent_id=True):
        if not isinstance(obj, np.ndarray):
            return super().save(obj, save_persistent_id)
        wrapper = NumpyArrayWrapper()
        wrapper.__dict__ = {
            "subclass": np.ndarray,
            "shape": obj.shape,
            "order": "C",
            "dtype": obj.dtype,
            "allow_mmap": True,
            "numpy_array_alignment_bytes": 16,
        }
        super().save(wrapper, save_persistent_id)
        self.framer.commit_frame(force=True)
        self.file_handle.write(b"\x03" + b"\xff" * 3 + np.ascontiguousarray(obj).tobytes())


def dump_joblib(path: Path, value) -> None:
    NumpyArrayWrapper.__module__ = "joblib.numpy_pickle"
    module = types.ModuleType("joblib.numpy_pickle")
    module.NumpyArrayWrapper = NumpyArrayWrapper
    sys.modules["joblib"], sys.modules["joblib.numpy_pickle"] = types.ModuleType("joblib"), module
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("wb") as file:
        pickler = JoblibPickler(file, protocol=4)
        pickler.file_handle = file
        pickler.dump(value)
    del sys.modules["joblib.numpy_pickle"], sys.modules["joblib"]


def both57m(root: Path, s: Scene, wrong: bool) -> None:
    """A body of which the pelvis moves like the object, and the wrists stand where hands are."""
    places = np.random.default_rng(2).normal(0, 0.2, (52, 3))
    places[0] = 0
    body = np.zeros((FRAMES, 21, 3))
    for side, joint in (("left", 20), ("right", 21)):
        places[joint] = (s.wrist[side][0] - s.shift[0]) @ s.rotation[0]
        body[:, joint - 1] = vectors(s.rotation[0].T @ turns(s.pose[side][:1, 0]))
    parents = [2**32 - 1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19]
    parents += [20, 22, 23] * 5 + [21, 37, 38] * 5
    fields = {
        "v_template": places,
        "J_regressor": scipy.sparse.csc_matrix(np.eye(52)),
        "kintree_table": np.array([parents, range(52)], dtype=np.int64),
    }
    dump(root / "SMPLH_MALE.pkl", fields, 2)
    first, second = ("right", "left") if wrong else ("left", "right")
    clip = {
        "trans": s.shift,
        "root_orient": vectors(s.rotation),
        "body_pose": body,
        "hand_pose": np.concatenate([s.pose[first][:, 1:], s.pose[second][:, 1:]], axis=1),
        "seq_len": FRAMES,
        "data_path": "somewhere",
        "body_cond": ["stands"],
        "hand_cond": ["waves"],
    }
    dump_joblib(root / "data/ExampleDataset.p", [clip])


def hamer(root: Path, s: Scene, wrong: bool) -> None:
    focal, image, box = 600.0, np.array([640.0, 480.0]), 200.0
    rows: dict[str, list] = {}
    for t in range(FRAMES):
        for side in SIDES:
            right, flip = side == "right", np.ones(3) if side == "right" else FLIP
            trans = s.wrist[side][t] + [0.05, 0.02, 0.1]
            centre = image / 2 + [30.0, -20.0]
            spread = 2 * focal / trans[2]
            shift = 2 * (centre - image / 2) / spread
            keep = np.ones(3) if wrong else flip
            pose = turns(s.pose[side][t] * (1 if right else -FLIP))
            for name, value in {
                "right": float(right),
                "frame": t,
                "box_center": centre,
                "box_size": box,
                "img_size": image,
                "pred_keypoints_3d": (s.joints[side][t] - trans) * keep,
                "pred_cam": [
                    spread / box,
                    (trans[0] - shift[0]) * flip[0],
                    trans[1] - shift[1],
                ],
                "global_orient": pose[:1],
                "hand_pose": pose[1:],
                "betas": s.betas[side],
            }.items():
                rows.setdefault(name, []).append(value)
    arrays = {name: torch.tensor(np.array(values)).float() for name, values in rows.items()}
    params = {name: arrays.pop(name) for name in ("global_orient", "hand_pose", "betas")}
    torch.save({**arrays, "pred_mano_params": params}, root / "video.pt")


def hawor(root: Path, s: Scene, wrong: bool) -> None:
    order = SIDES if wrong else ("left", "right")
    fields = [
        [s.origin(side, "mirrored" if side == "left" else "as shipped") for side in order],
        [s.pose[side][:, 0] for side in order],
        [flat(s.pose[side])[:, 3:] for side in order],
        [np.tile(s.betas[side], (FRAMES, 1)) for side in order],
        [np.ones(FRAMES) for _ in order],
    ]
    dump_joblib(root / "video/world_space_res.pth", [np.array(f, dtype="f4") for f in fields])


def aria(root: Path, s: Scene, wrong: bool) -> None:
    back, scale = np.linalg.inv(cameras()), 1000 if wrong else 1
    head = ["tracking_timestamp_us"]
    columns = [1_000_000 + 100_000 * np.arange(FRAMES)]
    for side in ("left", "right"):
        joints = s.joints[side] @ back[:, :3, :3].transpose(0, 2, 1) + back[:, None, :3, 3]
        head.append(f" {side}_tracking_confidence")
        columns.append(np.full(FRAMES, 0.9))
        for landmark in range(21):
            entries = ORDERS["aria"].entries
            known = landmark in entries
            place = joints[:, entries.index(landmark)] if known else np.zeros((FRAMES, 3))
            head += [f"t{axis}_{side}_landmark_{landmark}_device" for axis in "xyz"]
            columns += list(scale * place.T)
    write_table(root / "hand_tracking/hand_tracking_results.csv", head, columns)
    quats = Rotation.from_matrix(cameras()[:, :3, :3]).as_quat()
    head = ["graph_uid", "tracking_timestamp_us"]
    head += [f"t{c}_world_device" for c in "xyz"] + [f"q{c}_world_device" for c in "xyzw"]
    columns = [np.zeros(FRAMES), columns[0], *cameras()[:, :3, 3].T, *quats.T]
    write_table(root / "slam/closed_loop_trajectory.csv", head, columns)


def write_table(path: Path, head: list[str], columns: list[np.ndarray]) -> None:
    path.parent.mkdir(parents=True)
    rows = [",".join(f"{x:.12g}" for x in row) for row in np.stack(columns, axis=1)]
    path.write_text("\n".join([",".join(head), *rows]) + "\n")


def landmarks(root: Path, s: Scene, wrong: bool) -> None:
    entries = ORDERS["webxr"].entries
    hands = {}
    for side in SIDES:
        points = np.zeros((FRAMES, 25, 3))
        points[:, entries] = s.joints[SIDES[(side == "left") != wrong]]
        hands[side] = [{"points": p.tolist(), "confidence": 0.9} for p in points]
    value = {"format": "geneoh-landmarks", "version": 1, "order": "webxr", "fps": 72}
    (root / "hands.json").write_text(json.dumps({**value, "hands": hands}))


def keypoint_array(root: Path, s: Scene, wrong: bool) -> None:
    order = np.argsort(ORDERS["mano" if wrong else "fphab"].entries)
    np.save(root / "hand.npy", s.joints["right"][:, order])


def parameter_array(root: Path, s: Scene, wrong: bool) -> None:
    pose = flat(s.pose["left"]) * (57.3 if wrong else 1)
    np.savez(root / "hand.npz", pose=pose, trans=s.origin("left"), betas=s.betas["left"])


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
    expected: Callable[[Scene], Scene] = lambda s: s
    """The sequence that the files hold, where they cannot hold all of it."""
    fitted: bool = False
    """Betas are not in the file and found from vertices."""
    unknown: tuple[int, ...] = ()
    """Keypoints that the source does not have."""
    known: tuple[tuple[str, object], ...] = ()


CASES = [
    Case("grab", grab, "rotation transposed", fps=120.0),
    Case(
        "grab_clips",
        grab_clips,
        "from the stored object",
        only=("right",),
        expected=lambda s: in_clip(s, "right"),
    ),
    Case(
        "grab_clips",
        grab_clips_left,
        "from the stored object",
        only=("left",),
        fitted=True,
        expected=lambda s: centred(in_clip(s, "left"), "left"),
    ),
    Case("hoi4d_cases", hoi4d_cases, "origin to its wrist", only=("right",), fps=15.0),
    Case("hoi4d", hoi4d, "that of the wrist", fps=15.0),
    Case("hoi4d", hoi4d_articulated, "the order of the parts", parts=2, fps=15.0),
    Case("arctic", arctic, "parts.json calls top", parts=2),
    Case("arctic_processed", arctic_processed, "from the stored object", "outputs", parts=2),
    Case(
        "arcticnet",
        arcticnet,
        "that of the wrist",
        "eval",
        parts=2,
        expected=halved,
        known=(("objects", "data/meta/object_vtemplates"),),
    ),
    Case("taco", taco, "too small for a hand"),
    Case("taco_pickle", taco_pickle, "from the stored object", only=("left",)),
    Case("h2o", h2o, "origin to its wrist"),
    Case("dexycb", dexycb, "origin to its wrist", only=("right",)),
    Case("ho3d", ho3d, "origin to its wrist", only=("right",)),
    Case("oakink", oakink, "origin to its wrist", only=("right",)),
    Case("oakink2", oakink2, "that of the origin"),
    Case("fphab", fphab, "origin to its wrist", only=("right",)),
    Case(
        "both57m",
        both57m,
        "bend backward",
        "data",
        joints=False,
        object=False,
        known=(("body", "SMPLH_MALE.pkl"),),
    ),
    Case(
        "hamer",
        hamer,
        "misses the stored keypoints",
        object=False,
        left="mirrored",
        known=(("focal", 600.0),),
    ),
    Case("hawor", hawor, "bend backward", object=False, left="mirrored"),
    Case("aria", aria, "millimetres", fps=10.0, posed=False, object=False, unknown=(1,)),
    Case("landmarks", landmarks, "curl away from the palm", fps=72.0, posed=False, object=False),
    Case(
        "keypoints",
        keypoint_array,
        "another order",
        only=("right",),
        posed=False,
        object=False,
        known=(("side", "right"), ("joint_order", "fphab")),
    ),
    Case(
        "parameters",
        parameter_array,
        "convert degrees to radians",
        only=("left",),
        object=False,
        known=(("side", "left"), ("translation", "origin")),
    ),
]
