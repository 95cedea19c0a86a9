"""Data sets annotated in images: HOI4D, H2O, DexYCB, HO-Cap, HOT3D, HO-3D, OakInk, FPHAB and
more."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
import trimesh
from scipy.spatial.transform import Rotation

from geneoh.readers.joint_orders import ORDERS
from geneoh.readers.sources.fphab import EXTRINSIC
from trees.interaction import Scene, cameras, flat, rigid, turns, vectors
from trees.mano_files import SIDES
from trees.writers import dump, save, text_frames, write_json, write_mesh

HOI_ID = "ZY20210800001/H1/{category}/N12/S55/s02/T1"


def hoi4d_cases(root: Path, s: Scene, wrong: bool) -> None:
    joints = s.joints["right"][:, np.argsort(ORDERS["mano"].entries)]
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
        for t in range(s.frames)
    }
    save(root / "Mug/case3/merged_data.npy", frames)
    flag = {"case_flag": HOI_ID.format(category="C2")}
    save(root / "Mug/case3/meta_data.npy", flag)
    write_mesh(root / "HOI4D_CAD_Model_for_release/rigid/Mug/012.obj", s.verts, s.faces)


def hoi4d_hands(root: Path, s: Scene, name: str, wrong: bool) -> None:
    back = np.linalg.inv(cameras(s.frames))
    for side in SIDES:
        orient = vectors(back[:, :3, :3] @ turns(s.pose[side][:, 0]))
        offset = s.mano[side].wrist_offset(s.betas[side], "as shipped")
        wrist = (back[:, :3, :3] @ s.wrist[side][..., None])[..., 0] + back[:, :3, 3]
        for t in range(s.frames):
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
        for t, block in enumerate(cameras(s.frames))
    ]
    log.write_text("\n".join(rows) + "\n")


def hoi4d_parts(root: Path, name: str, motions: list[np.ndarray]) -> None:
    back = np.linalg.inv(cameras(len(motions[0])))
    for t in range(len(motions[0])):
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


def h2o(root: Path, s: Scene, wrong: bool) -> None:
    folder, back = root / "subject1/h1/0/cam4", np.linalg.inv(cameras(s.frames))
    hands, points = [], []
    for side in ("left", "right"):
        orient = vectors(back[:, :3, :3] @ turns(s.pose[side][:, 0]))
        wrist = (back[:, :3, :3] @ s.wrist[side][..., None])[..., 0] + back[:, :3, 3]
        offset = 0 if wrong else s.mano[side].wrist_offset(s.betas[side], "as shipped")
        flag = np.ones((s.frames, 1))
        betas = np.tile(s.betas[side], (s.frames, 1))
        hands += [flag, wrist - offset, orient, flat(s.pose[side])[:, 3:], betas]
        joints = s.joints[side] @ back[:, :3, :3].transpose(0, 2, 1) + back[:, None, :3, 3]
        points += [flag, joints.reshape(s.frames, 63)]
    text_frames(folder / "hand_pose_mano", np.concatenate(hands, axis=1))
    text_frames(folder / "hand_pose", np.concatenate(points, axis=1))
    placed = (back @ s.matrices()).reshape(s.frames, 16)
    text_frames(folder / "obj_pose_rt", np.concatenate([np.full((s.frames, 1), 5), placed], axis=1))
    text_frames(folder / "cam_pose", cameras(s.frames))
    write_mesh(root / "object/milk/milk.obj", s.verts, s.faces)


def gigahands(root: Path, s: Scene, wrong: bool) -> None:
    session, hands, first = root / "hand_poses/p003-instrument", {}, 40
    for side in SIDES:
        turn, offset = s.pose[side][:, 0], s.mano[side].wrist_offset(s.betas[side])
        fingers = flat(s.pose[side])[:, 3:] - s.mano[side].mean
        hands[side] = {
            "poses": np.concatenate([np.zeros((s.frames, 3)), fingers], axis=1).tolist(),
            "shapes": s.betas[side][None].tolist(),
            "Rh": turn.tolist(),
            "Th": (s.origin(side) if wrong else s.wrist[side] - turns(turn) @ offset).tolist(),
        }
    write_json(session / "params/033.json", hands)
    for side in SIDES:
        chosen = list(range(first, first + s.frames))
        write_json(session / f"keypoints_3d/033/chosen_frames_{side}.json", chosen)
    points = np.concatenate([s.joints["left"], s.joints["right"]], axis=1)
    write_json(session / "keypoints_3d_mano_align/033.json", points.tolist())
    inverse = np.roll(Rotation.from_matrix(s.rotation).inv().as_quat(), 1, axis=1)
    poses = {
        f"{first + t:06d}": {"mesh_translation": [s.shift[t].tolist()], "mesh_rotation": q.tolist()}
        for t, q in enumerate(inverse)
    }
    recording = root / "object_poses/17_instruments/box_scan/p003-instrument_0033"
    write_json(recording / "pose/optimized_pose.json", poses)
    write_mesh(root / "object_meta/17_instruments/box_scan/box.obj", s.verts, s.faces)


def coefficients(s: Scene, side: str) -> np.ndarray:
    """(T, 45) of MANO's components, relative to its mean pose."""
    mano = s.mano[side]
    return np.linalg.solve(mano.components.T, (flat(s.pose[side])[:, 3:] - mano.mean).T).T


def dexycb(root: Path, s: Scene, wrong: bool) -> None:
    folder, serial = root / "20200709-subject-01/20200709_141754", "836212060125"
    trans = s.wrist["right"] if wrong else s.origin("right")
    hand = np.concatenate([s.pose["right"][:, 0], coefficients(s, "right"), trans], axis=1)
    other = np.tile([0.0, 0, 0, 1, 0, 0, 0], (s.frames, 1))
    grasped = np.concatenate([Rotation.from_matrix(s.rotation).as_quat(), s.shift], axis=1)
    folder.mkdir(parents=True)
    np.savez(
        folder / "pose.npz",
        pose_y=np.stack([other, grasped], axis=1).astype("f4"),
        pose_m=hand[:, None].astype("f4"),
    )
    (folder / "meta.yml").write_text(
        f"serials:\n- '{serial}'\nnum_frames: {s.frames}\nextrinsics: '20200702_151821'\n"
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
    for t in range(s.frames):
        joints = s.joints["right"][t] @ back[:3, :3].T + back[:3, 3]
        np.savez(
            folder / serial / f"labels_{t:06d}.npz",
            seg=np.zeros((4, 4), np.uint8),
            joint_3d=joints[None].astype("f4"),
        )
    write_mesh(root / "models/025_mug/textured_simple.obj", s.verts, s.faces)


def of_one_subject(s: Scene) -> Scene:
    """The scene whose left hand has the betas of the right one."""
    betas, left = {side: s.betas["right"] for side in SIDES}, s.mano["left"]
    joints = left.keypoints(s.pose["left"], s.wrist["left"], betas["left"])
    return replace(s, betas=betas, joints={**s.joints, "left": joints})


def hocap(root: Path, s: Scene, wrong: bool) -> None:
    """The object, and another one that stays where it is."""
    folder, s = root / "subject_1/20231025_165502", of_one_subject(s)
    hands = [
        np.concatenate([s.pose[side][:, 0], coefficients(s, side), s.origin(side)], axis=1)
        for side in ("right", "left")
    ]
    moved = np.concatenate([Rotation.from_matrix(s.rotation).as_quat(), s.shift], axis=1)
    save(folder / "poses_m.npy", np.stack(hands).astype("f4"))
    save(folder / "poses_o.npy", np.stack([np.tile(moved[0], (s.frames, 1)), moved]).astype("f4"))
    (folder / "meta.yaml").write_text(
        "extrinsics: extrinsics_20231014.yaml\nhololens:\n  serial: hololens_kv5h72\n"
        f"mano_sides:\n- left\n- right\nnum_frames: {s.frames}\nobject_ids:\n- G01_1\n- G01_2\n"
        "realsense:\n  serials:\n  - '037522251142'\nsubject_id: subject_1\ntask_id: 1\n"
    )
    betas = root / "calibration/mano/subject_1.yaml"
    betas.parent.mkdir(parents=True)
    betas.write_text("betas:\n" + "\n".join(f"- {x:.9f}" for x in s.betas["right"]))
    verts = s.verts * (0.01 if wrong else 1)
    write_mesh(root / "models/G01_2/cleaned_mesh_10000.obj", verts, s.faces)


def of_few_coefficients(s: Scene) -> Scene:
    """The scene with the first 15 coefficients of each pose alone, and mended left hands."""
    pose, joints = {}, {}
    for side in SIDES:
        mano = s.mano[side]
        fingers = coefficients(s, side)[:, :15] @ mano.components[:15] + mano.mean
        pose[side] = np.concatenate([s.pose[side][:, :1], fingers.reshape(-1, 15, 3)], axis=1)
        places = s.wrist[side], s.betas[side]
        joints[side] = mano.keypoints(pose[side], *places, "mirrored")
    return replace(s, pose=pose, joints=joints)


def hot3d(root: Path, s: Scene, wrong: bool) -> None:
    """Moments of two cameras, of which the second one's hands are elsewhere."""
    folder, lines, rows = root / "P0003_c701bd11", [], []
    for t in range(s.frames):
        for camera, late in enumerate((0, 90813)):
            time = 56752108188860 + round(t * 1e9 / 30) + late
            hands = {}
            for side, key in (("left", "0"), ("right", "1")):
                turn = Rotation.from_rotvec(s.pose[side][t, 0]).as_quat()[[3, 0, 1, 2]]
                place = s.origin(side, "mirrored")[t] + camera
                hands[key] = {
                    "pose": coefficients(s, side)[t, :15].tolist(),
                    "wrist_xform": {"t_xyz": place.tolist(), "q_wxyz": turn.tolist()},
                    "betas": s.betas[side].tolist(),
                }
            lines.append(json.dumps({"timestamp_ns": time, "hand_poses": hands}))
            for name, frame in (("37787722328019", 0), ("228358276546933", t)):
                turn = Rotation.from_matrix(s.rotation[frame]).as_quat()[[3, 0, 1, 2]]
                rows.append([name, time, *(s.shift[frame] + camera), *turn])
    folder.mkdir(parents=True)
    (folder / "mano_hand_pose_trajectory.jsonl").write_text("\n".join(lines) + "\n")
    head = "object_uid,timestamp[ns],t_wo_x[m],t_wo_y[m],t_wo_z[m],q_wo_w,q_wo_x,q_wo_y,q_wo_z"
    table = [head, *(",".join(map(str, row)) for row in rows)]
    (folder / "dynamic_objects.csv").write_text("\n".join(table) + "\n")
    verts = s.verts * (0.01 if wrong else 1)
    (root / "assets").mkdir()
    trimesh.Trimesh(verts, s.faces, process=False).export(root / "assets/228358276546933.glb")


def ho3d(root: Path, s: Scene, wrong: bool) -> None:
    write_metas(root, s, wrong, {"right": "hand"})


def h2o3d(root: Path, s: Scene, wrong: bool) -> None:
    """One shape for both hands, in the fields of HO-3D but for their names."""
    write_metas(root, of_one_subject(s), wrong, {"right": "rightHand", "left": "leftHand"})


def write_metas(root: Path, s: Scene, wrong: bool, prefixes: dict[str, str]) -> None:
    """A pickle for each frame, in the axes of OpenGL."""
    gl = np.diag([1.0, -1.0, -1.0])
    for t in range(s.frames):
        fields = {
            "handBeta": s.betas["right"],
            "objRot": vectors(gl @ s.rotation[t])[:, None],
            "objTrans": gl @ s.shift[t],
            "objName": "025_mug",
            "objLabel": 14,
            "camMat": np.eye(3),
        }
        for side, prefix in prefixes.items():
            offset = 0 if wrong else s.mano[side].wrist_offset(s.betas[side], "as shipped")
            orient = vectors(gl @ turns(s.pose[side][t : t + 1, 0]))[0]
            fields |= {
                f"{prefix}Pose": np.concatenate([orient, flat(s.pose[side])[t, 3:]]),
                f"{prefix}Trans": gl @ s.wrist[side][t] - offset,
                f"{prefix}Joints3D": (s.joints[side][t] @ gl)[np.argsort(ORDERS["mano"].entries)],
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
    for t in range(s.frames):
        name = f"A01001_0001_0000__2021-09-26-19-59-58__0__{t}__0.pkl"
        fields = {
            "hand_anno": {
                "hand_pose": torch.from_numpy(quats.reshape(s.frames, 16, 4)[t]).float(),
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


def fphab(root: Path, s: Scene, wrong: bool) -> None:
    way, offset = "Subject_1/open_milk/1", 0
    if not wrong:
        offset = s.mano["right"].wrist_offset(s.betas["right"], "as shipped")
    back = np.linalg.inv(EXTRINSIC)
    scaled = s.matrices()
    scaled[:, :3, 3] *= 1000
    fits = {}
    for t in range(s.frames):
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
    joints = joints[:, np.argsort(ORDERS["fphab"].entries)].reshape(s.frames, 63)
    for folder, file, rows in (
        ("Hand_pose_annotation_v1_1", "skeleton.txt", joints),
        ("Object_6D_pose_annotation_v1_1", "object_pose.txt", (back @ scaled).swapaxes(1, 2)),
    ):
        path = root / folder / way / file
        path.parent.mkdir(parents=True)
        lines = [f"{t} " + " ".join(f"{x:.7f}" for x in row.ravel()) for t, row in enumerate(rows)]
        path.write_text("\n".join(lines))
    write_mesh(root / "Object_models/milk_model/milk_model.ply", s.verts, s.faces)


def taco(root: Path, s: Scene, wrong: bool) -> None:
    name = "(stir, spoon, bowl)/20230917_001"
    for side, role, number in (("right", "tool", "010"), ("left", "target", "022")):
        frames = {
            f"{t:05d}": {
                "hand_pose": torch.from_numpy(flat(s.pose[side])[t]).float(),
                "hand_trans": torch.from_numpy(s.wrist[side][t]).float(),
            }
            for t in range(s.frames)
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
