"""What estimators and users write: ArcticNet, HaMeR, HaWoR, Dyn-HaMR, Aria, landmarks, arrays."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from scipy.spatial.transform import Rotation

from geneoh.readers.joint_orders import ORDERS
from trees.interaction import Scene, cameras, flat, turns, vectors
from trees.mano_files import FLIP, SIDES
from trees.mocap import arctic
from trees.writers import dump_joblib, write_mesh, write_table


def halved(s: Scene) -> Scene:
    """The scene as it comes out of half precision, in which ArcticNet's predictions are stored."""
    pose, wrist, joints, betas = {}, {}, {}, {}
    for side in SIDES:
        mean = np.concatenate([np.zeros(3), s.mano[side].mean])
        relative = turns((flat(s.pose[side]) - mean).reshape(-1, 3)).astype("f2").astype("f8")
        pose[side] = vectors(relative).reshape(s.frames, 16, 3) + mean.reshape(16, 3)
        betas[side] = s.betas[side].astype("f2").astype("f8")
        origin = s.origin(side).astype("f2").astype("f8")
        wrist[side] = origin + s.mano[side].wrist_offset(betas[side])
        joints[side] = s.mano[side].keypoints(pose[side], wrist[side], betas[side])
    rotation = turns(vectors(s.rotation).astype("f2").astype("f8"))
    shift, angle = (values.astype("f2").astype("f8") for values in (s.shift, s.angle))
    hands = {"pose": pose, "wrist": wrist, "joints": joints, "betas": betas}
    return replace(s, **hands, rotation=rotation, shift=shift, angle=angle)


def arcticnet(root: Path, s: Scene, wrong: bool) -> None:
    arctic(root / "data", s, False)
    folder = root / "eval/s01_box_grab_01_1"
    (folder / "preds").mkdir(parents=True)
    (folder / "meta_info").mkdir()
    names = [f"./images/s01/box_grab_01/1/{t + 33:05d}.jpg" for t in range(s.frames)]
    torch.save(names, folder / "meta_info/meta_info.imgname.pt")

    def put(key: str, values: np.ndarray) -> None:
        padded = np.concatenate([values, values[-1:]])
        torch.save(torch.from_numpy(padded).half(), folder / f"preds/pred.{key}.pt")

    for side in SIDES:
        relative = flat(s.pose[side]) - np.concatenate([np.zeros(3), s.mano[side].mean])
        put(f"mano.pose.{side[0]}", turns(relative.reshape(-1, 3)).reshape(s.frames, 16, 3, 3))
        put(f"mano.beta.{side[0]}", np.tile(s.betas[side], (s.frames, 1)))
        put(f"mano.cam_t.{side[0]}", s.wrist[side] if wrong else s.origin(side))
    put("object.rot", vectors(s.rotation))
    put("object.cam_t", s.shift)
    put("object.radian", s.angle)


def hamer(root: Path, s: Scene, wrong: bool) -> None:
    focal, image, box = 600.0, np.array([640.0, 480.0]), 200.0
    rows: dict[str, list] = {}
    for t in range(s.frames):
        for side in SIDES:
            right, flip = side == "right", np.ones(3) if side == "right" else FLIP
            trans = s.wrist[side][t] + [0.05, 0.02, 0.1]
            centre = image / 2 + [30.0, -20.0]
            spread = 2 * focal / trans[2]
            shift = 2 * (centre - image / 2) / spread
            pose = turns(s.pose[side][t] * (1 if right else -FLIP))
            pose = pose.transpose(0, 2, 1) if wrong else pose
            for name, value in {
                "right": float(right),
                "frame": t,
                "box_center": centre,
                "box_size": box,
                "img_size": image,
                "pred_keypoints_3d": (s.joints[side][t] - trans) * flip,
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
        [np.tile(s.betas[side], (s.frames, 1)) for side in order],
        [np.ones(s.frames) for _ in order],
    ]
    dump_joblib(root / "video/world_space_res.pth", [np.array(f, dtype="f4") for f in fields])
    (root / "video/SLAM").mkdir()
    camera, scale = cameras(s.frames), 2.5
    turns = Rotation.from_matrix(camera[:, :3, :3]).as_quat()
    np.savez(
        root / f"video/SLAM/hawor_slam_w_scale_0_{s.frames}.npz",
        tstamp=np.arange(s.frames),
        traj=np.concatenate([camera[:, :3, 3] / scale, turns], axis=1),
        img_focal=600.0,
        img_center=np.array([320.0, 240.0]),
        scale=scale,
    )


def dynhamr(root: Path, s: Scene, wrong: bool) -> None:
    run, offset, before = root / "logs/video-0", 40, 3
    flip = np.ones(3) if wrong else FLIP
    turn = np.ones(3) if wrong else -FLIP
    trans = np.stack([s.origin("left", "mirrored") * flip, s.origin("right")])
    pose = np.stack([flat(s.pose["left"] * turn), flat(s.pose["right"])])
    back = np.linalg.inv(np.stack([cameras(s.frames)] * 2))
    fields = {
        "trans": trans,
        "root_orient": pose[:, :, :3],
        "pose_body": pose[:, :, 3:],
        "betas": np.stack([s.betas[side] for side in ("left", "right")]),
        "is_right": np.repeat([[0], [1]], s.frames, axis=1),
        "cam_R": back[:, :, :3, :3],
        "cam_t": back[:, :, :3, 3],
        "world_scale": np.ones((1, 1)),
        "intrins": np.array([600.0, 600.0, 320.0, 240.0]),
    }
    single = {name: array.astype("f4") for name, array in fields.items()}
    unfinished = {**single, "trans": single["trans"] + 1}
    for phase, step, values in (
        ("init", "000000_init", unfinished),
        ("smooth_fit", "000300", single),
        ("smooth_fit", "000020", unfinished),
        ("root_fit", "000050", unfinished),
    ):
        (run / phase).mkdir(parents=True, exist_ok=True)
        np.savez(run / phase / f"video_{step}_world_results.npz", **values)
    seen = [False] * before + [True] * s.frames + [False]
    info = {
        "tracks": {str(i): {"index": i, "vis_mask": seen} for i in (0, 1)},
        "meta": {
            "seq_interval": [before, before + s.frames],
            "data_interval": [offset, offset + 20],
        },
    }
    (run / "track_info.json").write_text(json.dumps(info))


def video_to_data(root: Path, s: Scene, wrong: bool) -> None:
    to_world = cameras(s.frames)
    back = np.linalg.inv(to_world)
    fields = {
        "camera_to_world_transform": to_world,
        "camera_is_valid": np.ones(s.frames, bool),
        "camera_intrinsics": np.array([600.0, 600.0, 320.0, 240.0]),
        "object_to_camera_transform": back @ s.matrices(),
        "object_scale": np.array(0.5),
        "object_is_valid": np.ones(s.frames, bool),
    }
    for side in SIDES:
        turn = -FLIP if side == "left" and not wrong else np.ones(3)
        orientation = vectors(back[:, :3, :3] @ turns(s.pose[side][:, 0]))
        wrist = (back[:, :3, :3] @ s.wrist[side][..., None])[..., 0] + back[:, :3, 3]
        offset = s.mano[side].wrist_offset(s.betas[side], "mirrored")
        values = {
            "betas": s.betas[side],
            "wrist_orient_in_camera": orientation * turn,
            "wrist_trans_in_camera": wrist - offset,
            "finger_pose": s.pose[side][:, 1:] * turn,
            "scale": np.ones(s.frames),
            "is_valid": np.ones(s.frames, bool),
        }
        fields |= {f"hand_{side}_{name}": value for name, value in values.items()}
    folder = root / "outputs/result"
    write_mesh(folder / "mesh.obj", 2 * s.verts, s.faces)
    single = {name: v.astype("f4") if v.dtype == "f8" else v for name, v in fields.items()}
    np.savez(folder / "result.npz", **single)


def aria(root: Path, s: Scene, wrong: bool) -> None:
    back, scale = np.linalg.inv(cameras(s.frames)), 1000 if wrong else 1
    head = ["tracking_timestamp_us"]
    columns = [1_000_000 + 100_000 * np.arange(s.frames)]
    for side in ("left", "right"):
        joints = s.joints[side] @ back[:, :3, :3].transpose(0, 2, 1) + back[:, None, :3, 3]
        head.append(f" {side}_tracking_confidence")
        columns.append(np.full(s.frames, 0.9))
        for landmark in range(21):
            entries = ORDERS["aria"].entries
            known = landmark in entries
            place = joints[:, entries.index(landmark)] if known else np.zeros((s.frames, 3))
            head += [f"t{axis}_{side}_landmark_{landmark}_device" for axis in "xyz"]
            columns += list(scale * place.T)
    write_table(root / "hand_tracking/hand_tracking_results.csv", head, columns)
    quats = Rotation.from_matrix(cameras(s.frames)[:, :3, :3]).as_quat()
    head = ["graph_uid", "tracking_timestamp_us"]
    head += [f"t{c}_world_device" for c in "xyz"] + [f"q{c}_world_device" for c in "xyzw"]
    columns = [np.zeros(s.frames), columns[0], *cameras(s.frames)[:, :3, 3].T, *quats.T]
    write_table(root / "slam/closed_loop_trajectory.csv", head, columns)


def landmarks(root: Path, s: Scene, wrong: bool) -> None:
    entries = ORDERS["webxr"].entries
    hands = {}
    for side in SIDES:
        points = np.zeros((s.frames, 25, 3))
        points[:, entries] = s.joints[SIDES[(side == "left") != wrong]]
        hands[side] = [{"points": p.tolist(), "confidence": 0.9} for p in points]
    value = {"format": "geneoh-landmarks", "version": 1, "order": "webxr", "fps": 72}
    (root / "hands.json").write_text(json.dumps({**value, "hands": hands}))


def keypoint_array(root: Path, s: Scene, wrong: bool) -> None:
    order = np.argsort(ORDERS["fphab"].entries)
    np.save(root / "hand.npy", s.joints["right"][:, order[::-1] if wrong else order])


def parameter_array(root: Path, s: Scene, wrong: bool) -> None:
    pose = flat(s.pose["left"]) * (57.3 if wrong else 1)
    np.savez(root / "hand.npz", pose=pose, trans=s.origin("left"), betas=s.betas["left"])
