"""Bodies for tests: a motion that uses every joint, and files of each layout that hold it."""

import json
from pathlib import Path

import numpy as np
import torch
import trimesh
from trees.writers import dump_joblib

from geneoh.body.motion import BodyMotion, pose
from geneoh.body.skeleton import embedded_skeleton
from geneoh.geometry.rotations import axis_angle_to_matrix, matrix_to_axis_angle, turn_up
from geneoh.readers.bodies.base import BodyRecording
from geneoh.readers.bodies.smpl import body_fields
from geneoh.readers.npz.files import save_sequence
from geneoh.sequence.body_hands import hand_tracks
from geneoh.sequence.sequence import ObjectTrack, Sequence


def swaying(frames: int = 8, joints: int = 52, seed: int = 0) -> BodyMotion:
    """A person who stands, y up, and moves all joints a little; the root walks."""
    generator = torch.Generator().manual_seed(seed)
    phase = 6 * torch.rand(joints, 3, generator=generator)
    time = torch.linspace(0, 2, frames)[:, None, None]
    turn = torch.zeros(frames, 52, 3)
    turn[:, :joints] = 0.3 * torch.sin(time + phase)
    turn[:, 0] *= torch.tensor([0.2, 1.0, 0.2])
    walk = torch.tensor([0.3, 0.02, 1.0]) * torch.linspace(0, 1, frames)[:, None]
    return BodyMotion(walk + torch.tensor([0.1, 0.95, 0.0]), axis_angle_to_matrix(turn))


def in_world(motion: BodyMotion, up: str) -> tuple[np.ndarray, np.ndarray]:
    """Axis-angle (T, 52, 3) and places of the pelvis, in a world with another axis up."""
    world = turn_up("y", up)  # pyright: ignore
    turns = motion.rotations.clone()
    turns[:, 0] = world @ turns[:, 0]
    return matrix_to_axis_angle(turns).numpy(), (motion.root @ world.T).numpy()


def smplx_names(path: Path, motion: BodyMotion, up: str = "y", **more) -> Path:
    """The names of the smplx package."""
    turns, root = in_world(motion, up)
    flat = turns.reshape(len(turns), -1)
    fields = {"global_orient": flat[:, :3], "body_pose": flat[:, 3:66], "transl": root}
    fields |= {"left_hand_pose": flat[:, 66:111], "right_hand_pose": flat[:, 111:]}
    fields |= {"fps": 30.0, "betas": np.zeros(10), "flat_hand_mean": True}
    np.savez(path, **fields | more)
    return path


def amass(path: Path, motion: BodyMotion, rate: float = 120.0, split: bool = False) -> Path:
    """AMASS: poses of SMPL-H, or its newer files of SMPL-X in parts; z up."""
    turns, root = in_world(motion, "z")
    flat = turns.reshape(len(turns), -1).astype(np.float64)
    fields = {"trans": root, "gender": np.array("female"), "betas": np.zeros(16)}
    if split:
        fields |= {
            "root_orient": flat[:, :3],
            "pose_body": flat[:, 3:66],
            "pose_hand": flat[:, 66:],
        }
        fields |= {"mocap_frame_rate": np.array(rate), "pose_jaw": np.zeros((len(flat), 3))}
    else:
        fields |= {"poses": flat, "dmpls": np.zeros((len(flat), 8)), "mocap_framerate": rate}
    np.savez(path, **fields)
    return path


def both57m(path: Path, *motions: BodyMotion) -> Path:
    """BOTH57M: a joblib list of dicts; y up, 30 frames a second."""
    clips = []
    for motion in motions:
        turns, root = in_world(motion, "y")
        clips.append(
            {
                "trans": root.astype(np.float64),
                "root_orient": turns[:, 0].astype(np.float64),
                "body_pose": turns[:, 1:22].astype(np.float64),
                "hand_pose": turns[:, 22:].astype(np.float64),
                "seq_len": len(turns),
                "data_path": "somewhere",
                "body_cond": ["the person greets", "an arm is raised", "a greeting"],
                "hand_cond": ["the right hand waves", "fingers spread", "all fingers are straight"],
            }
        )
    dump_joblib(path, clips)
    return path


def motion_x(path: Path, motion: BodyMotion) -> Path:
    """Motion-X: one array of 322 numbers a frame; y up."""
    turns, root = in_world(motion, "y")
    flat, rest = turns.reshape(len(turns), -1), np.zeros((len(turns), 153))
    np.save(path, np.concatenate([flat, rest, root, np.zeros((len(turns), 10))], axis=1))
    return path


def motion_x_tree(root: Path, **motions: BodyMotion) -> Path:
    """Motion-X's folders, by names such as "idea400__wave_clip_1": bodies, faces and texts."""
    for key, motion in motions.items():
        name = key.replace("__", "/")
        for folder in ("motion_data", "face_motion_data"):
            path = root / folder / "smplx_322" / f"{name}.npy"
            path.parent.mkdir(parents=True, exist_ok=True)
            motion_x(path, motion)
        labels = root / "texts" / "semantic_labels" / f"{name}.txt"
        labels.parent.mkdir(parents=True, exist_ok=True)
        labels.write_text(f"A person does {name}.#a/DET person/NOUN#0.0#0.0\n\n")
        hands = root / "texts" / "hand_texts" / f"{name}.json"
        hands.parent.mkdir(parents=True, exist_ok=True)
        frames = {str(n): f"the fingers are bent {n} times" for n in range(len(motion.root))}
        hands.write_text(json.dumps(frames))
    return root


def recording(frames: int = 6, up: str = "y") -> BodyRecording:
    """A body of the embedded skeleton, in a world with that axis up."""
    motion = swaying(frames)
    return BodyRecording(motion, embedded_skeleton(), torch.zeros(3), 30.0, "a body", up)  # pyright: ignore


def held_cylinder(folder: Path, motion: BodyMotion) -> None:
    """mug.obj, a cylinder too deep in the right hand of a body, and poses.npy, where it moves."""
    posed = pose(embedded_skeleton(), motion)
    wrist, turn = posed.positions[:, 21].double(), posed.rotations[:, 21].double()
    trimesh.creation.cylinder(0.035, 0.1, sections=24).export(folder / "mug.obj")
    poses = torch.eye(4, dtype=torch.float64).repeat(len(wrist), 1, 1)
    poses[:, :3, :3] = turn
    poses[:, :3, 3] = wrist + turn @ torch.tensor([-0.09, -0.045, 0.0], dtype=torch.float64)
    np.save(folder / "poses.npy", poses.numpy())


def hands_file(path: Path, body: BodyRecording) -> Path:
    """The hands of a body, and the body beside them, as `geneoh generate --body` writes them."""
    hands = hand_tracks(body.skeleton, body.file_motion)
    sequence = Sequence(hands, ObjectTrack.resting((), body.frames), body.fps, "made")
    save_sequence(sequence, path, extra=body_fields(body))
    return path
