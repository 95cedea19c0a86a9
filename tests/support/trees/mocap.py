"""Data sets of motion capture, in world frames: GRAB and its clips, ARCTIC, OakInk2, BOTH57M."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import scipy.sparse
import torch
from scipy.spatial.transform import Rotation

from geneoh.readers.joint_orders import ORDERS
from trees.interaction import Scene, flat, lid, opened, turns, vectors
from trees.mano_files import FLIP, SIDES, mano_model
from trees.writers import dump, dump_joblib, save, write_mesh


def grab(root: Path, s: Scene, wrong: bool) -> None:
    turn = s.rotation if wrong else s.rotation.transpose(0, 2, 1)
    fields = {
        "gender": "male",
        "sbj_id": "s1",
        "obj_name": "mug",
        "motion_intent": "use",
        "framerate": 120.0,
        "n_frames": s.frames,
        "n_comps": 24,
        "object": {
            "params": {"transl": s.shift, "global_orient": vectors(turn)},
            "object_mesh": "tools/object_meshes/contact_meshes/mug.ply",
        },
        "contact": {"object": np.zeros((s.frames, len(s.verts)), np.int8)},
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
                "hand_pose": np.zeros((s.frames, 24)),
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
    clip = np.zeros(s.frames, dtype=[*form, ("f7", "i4"), ("f8", "i4"), ("f9", "?")])
    clip["f0"], clip["f3"] = (
        (flip * values).reshape(s.frames, -1).astype("f4") for values in (hand, points)
    )
    clip["f1"], clip["f2"] = s.pose[side][:, 0], coefficients
    clip["f5"] = vectors(turn)
    clip["f6"] = s.shift - flip * middle(s)  # for left hands the mirrored middle, as TOCH has it
    clip["f7"], clip["f8"], clip["f9"] = 1, 500 + np.arange(s.frames), side == "left"
    return clip


def grab_listing(root: Path, s: Scene) -> None:
    for name, size in (("apple", 0.5), ("mug", 1.0), ("table", 2.0)):
        write_mesh(root / f"data/grab/object_meshes/{name}.ply", size * s.verts, s.faces)


def grab_clips(root: Path, s: Scene, wrong: bool) -> None:
    """GeneOH's clip of a right hand, with the person's betas and places."""
    s = in_clip(s, "right")
    save(root / "data/grab/source_data/test/14.npy", clip_array(s, "right", wrong))
    save(root / "data/grab/source_data/test/14_meta_data.npy", {"clip_len": s.frames})
    model = mano_model("right").shaped(torch.from_numpy(s.betas["right"]).float())
    pose, wrist = (torch.from_numpy(x["right"]).float() for x in (s.pose, s.wrist))
    fields = {
        "rhand_verts": model.posed(pose, wrist).verts.numpy(),
        "rhand_global_orient": s.pose["right"][:, 0].astype("f4"),
        "rhand_hand_pose": np.zeros((s.frames, 24), "f4"),
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
    longer = np.zeros(s.frames, dtype=clip.dtype.descr[:9] + more)
    for name in clip.dtype.names[:9]:
        longer[name] = clip[name]
    longer["f12"] = True
    save(root / "data/grab/source_data/test/7.npy", longer)
    grab_listing(root, s)


def arctic(root: Path, s: Scene, wrong: bool) -> dict:
    hands = {}
    for side in SIDES:
        mano = s.mano[side]
        hands[side] = {
            "rot": s.pose[side][:, 0],
            "pose": flat(s.pose[side])[:, 3:] - mano.mean,
            "trans": s.origin(side),
            "shape": s.betas[side],
            "fitting_err": 0.001 * (1 + np.arange(s.frames)),
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


def arctic_processed(root: Path, s: Scene, wrong: bool) -> None:
    raw = arctic(root, s, False)
    from_m = np.argsort(ORDERS["mano"].entries)
    params, world = {}, {}
    for side in SIDES:
        for name in ("rot", "pose", "trans"):
            params[f"{name}_{side[0]}"] = raw[side][name].astype("f4")
        params[f"shape_{side[0]}"] = np.tile(raw[side]["shape"], (s.frames, 1)).astype("f4")
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


def oakink2(root: Path, s: Scene, wrong: bool) -> None:
    frames = [100 + 4 * t for t in range(s.frames)]
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


def write_body(path: Path, s: Scene, rest_root: np.ndarray) -> np.ndarray:
    """An SMPL-H model and a body of it, of which the pelvis moves like the object, and the wrists
    stand where hands are: (T, 21, 3) axis-angle of its joints but the pelvis."""
    places = np.random.default_rng(2).normal(0, 0.2, (52, 3))
    places[0] = 0
    body = np.zeros((s.frames, 21, 3))
    for side, joint in (("left", 20), ("right", 21)):
        places[joint] = (s.wrist[side][0] - s.shift[0]) @ s.rotation[0]
        body[:, joint - 1] = vectors(s.rotation[0].T @ turns(s.pose[side][:1, 0]))
    parents = [2**32 - 1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19]
    for wrist, first in ((20, 22), (21, 37)):
        for base in range(first, first + 15, 3):
            parents += [wrist, base, base + 1]
    fields = {
        "v_template": places + rest_root,
        "J_regressor": scipy.sparse.csc_matrix(np.eye(52)),
        "kintree_table": np.array([parents, range(52)], dtype=np.int64),
    }
    dump(path, fields, 2)
    return body


def egoallo(root: Path, s: Scene, wrong: bool) -> None:
    """One sample of a body whose place is that of its pelvis."""
    body = write_body(root / "SMPLH_NEUTRAL.pkl", s, np.array([0.0, -0.2, 0.1]))

    def quaternions(rotvecs: np.ndarray) -> np.ndarray:
        flat = Rotation.from_rotvec(rotvecs.reshape(-1, 3)).as_quat()[:, [3, 0, 1, 2]]
        return flat.reshape(1, *rotvecs.shape[:-1], 4)

    first, second = ("right", "left") if wrong else ("left", "right")
    folder = root / "trajectory/egoallo_outputs"
    folder.mkdir(parents=True)
    np.savez(
        folder / "20260109-220017_0-64.npz",
        Ts_world_cpf=np.zeros((s.frames, 7)),
        Ts_world_root=np.concatenate([quaternions(vectors(s.rotation)), s.shift[None]], axis=-1),
        body_quats=quaternions(body),
        left_hand_quats=quaternions(s.pose[first][:, 1:]),
        right_hand_quats=quaternions(s.pose[second][:, 1:]),
        contacts=np.zeros((1, s.frames, 21)),
        betas=np.zeros((1, s.frames, 16)),
        frame_nums=np.arange(s.frames),
        timestamps_ns=10**12 + np.arange(s.frames) * 10**9 // 30,
    )


def both57m(root: Path, s: Scene, wrong: bool) -> None:
    body = write_body(root / "SMPLH_MALE.pkl", s, np.zeros(3))
    first, second = ("right", "left") if wrong else ("left", "right")
    clip = {
        "trans": s.shift,
        "root_orient": vectors(s.rotation),
        "body_pose": body,
        "hand_pose": np.concatenate([s.pose[first][:, 1:], s.pose[second][:, 1:]], axis=1),
        "seq_len": s.frames,
        "data_path": "somewhere",
        "body_cond": ["stands"],
        "hand_cond": ["waves"],
    }
    dump_joblib(root / "data/ExampleDataset.p", [clip])
