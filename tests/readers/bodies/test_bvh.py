import re
from pathlib import Path

import bodies
import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from geneoh.body.motion import pose
from geneoh.body.skeleton import JOINT_NAMES, PARENTS, Skeleton, embedded_skeleton
from geneoh.errors import InputError
from geneoh.geometry.rotations import turn_up
from geneoh.readers.bodies.bvh import bvh_text, euler_angles, read_bvh

SWAYING = bodies.swaying()
MIXAMO = {
    **{"pelvis": "Hips", "spine1": "Spine", "spine2": "Spine1", "spine3": "Spine2"},
    **{"neck": "Neck", "head": "Head"},
    **{
        f"{side}_{ours}": f"{side.title()}{name}"
        for side in ("left", "right")
        for ours, name in {
            **{"hip": "UpLeg", "knee": "Leg", "ankle": "Foot", "foot": "ToeBase"},
            **{"collar": "Shoulder", "shoulder": "Arm", "elbow": "ForeArm", "wrist": "Hand"},
        }.items()
    },
}


def children(joint: int, names: list[str]) -> list[int]:
    return [child for child in range(52) if PARENTS[child] == joint and JOINT_NAMES[child] in names]


def foreign_bvh(motion, names: dict[str, str], rest: dict[str, Rotation], up: str = "y") -> str:
    """The same motion as another program writes it: other names, axes and rest pose, 6 channels.

    `rest` turns joints, with all that hangs on them, out of the T-pose into the file's rest pose.
    """
    world = turn_up("y", up).double().numpy()
    skeleton, posed = embedded_skeleton(), pose(embedded_skeleton(), motion)
    turned = [world]
    for joint in range(1, 52):
        own = rest.get(JOINT_NAMES[joint], Rotation.identity()).as_matrix()
        turned.append(turned[PARENTS[joint]] @ own)
    goal = world @ posed.rotations.double().numpy() @ np.stack(turned).transpose(0, 2, 1)
    lines, columns = ["HIERARCHY"], []

    def write(joint: int, depth: int) -> None:
        above = PARENTS[joint]
        offset = turned[above] @ skeleton.offsets[joint].double().numpy() if joint else np.zeros(3)
        lines.append(f"{'JOINT' if joint else 'ROOT'} mixamorig:{names[JOINT_NAMES[joint]]}")
        lines.append("{\nOFFSET " + " ".join(f"{100 * x:.8f}" for x in offset))
        lines.append("CHANNELS 6 Xposition Yposition Zposition Yrotation Xrotation Zrotation")
        local = goal[:, joint] if not joint else goal[:, above].transpose(0, 2, 1) @ goal[:, joint]
        angles = Rotation.from_matrix(local).as_euler("YXZ", degrees=True)
        place = (
            motion.root.double().numpy() @ world.T
            if not joint
            else offset[None].repeat(len(local), 0)
        )
        columns.extend([100 * place, angles])
        below = children(joint, list(names))
        for child in below:
            write(child, depth + 1)
        if not below:
            lines.append("End Site\n{\nOFFSET 0 1 0\n}")
        lines.append("}")

    write(0, 0)
    rows = np.concatenate(columns, axis=1)
    lines += [f"MOTION\nFrames: {len(rows)}\nFrame Time: 0.0166667"]
    return "\n".join([*lines, *(" ".join(f"{x:.8f}" for x in row) for row in rows)])


def test_a_body_that_was_written_is_read_back(tmp_path):
    skeleton = Skeleton(0.9 * embedded_skeleton().offsets)
    (tmp_path / "a.bvh").write_text(bvh_text(skeleton, SWAYING, 30.0))
    body = read_bvh(tmp_path / "a.bvh")
    torch.testing.assert_close(body.skeleton.offsets, skeleton.offsets, atol=1e-6, rtol=0)
    torch.testing.assert_close(body.motion.root, SWAYING.root, atol=1e-6, rtol=0)
    torch.testing.assert_close(body.motion.rotations, SWAYING.rotations, atol=1e-4, rtol=0)
    assert body.fps == pytest.approx(30)
    assert body.has_fingers


DOWN = {"left_shoulder": Rotation.from_euler("z", -80, degrees=True)}
DOWN |= {"right_shoulder": Rotation.from_euler("z", 80, degrees=True)}


@pytest.mark.parametrize("up", ["y", "z"])
@pytest.mark.parametrize("rest", [{}, DOWN], ids=["T-pose", "arms down"])
def test_joints_of_another_program_stay_where_they_are(tmp_path, rest, up):
    (tmp_path / "a.bvh").write_text(foreign_bvh(SWAYING, MIXAMO, rest, up))
    body = read_bvh(tmp_path / "a.bvh")
    assert body.up == up
    assert body.fps == pytest.approx(60, rel=1e-4)
    assert not body.has_fingers
    found, wanted = pose(body.skeleton, body.motion), pose(embedded_skeleton(), SWAYING)
    torch.testing.assert_close(found.positions[:, :22], wanted.positions[:, :22], atol=1e-4, rtol=0)
    torch.testing.assert_close(found.rotations[:, :22], wanted.rotations[:, :22], atol=0.07, rtol=0)


def test_a_spine_with_fewer_joints_is_filled_up(tmp_path):
    still = {name: f"m_{name}" for name in JOINT_NAMES[:22] if name not in ("spine1", "spine2")}
    stiff = SWAYING.rotations.clone()
    stiff[:, [3, 6]] = torch.eye(3)
    motion = type(SWAYING)(SWAYING.root, stiff)
    text = foreign_bvh(motion, {**still, "spine1": "Lower", "spine2": "Upper"}, {})
    (tmp_path / "a.bvh").write_text(text)
    body = read_bvh(tmp_path / "a.bvh")
    found, wanted = pose(body.skeleton, body.motion), pose(embedded_skeleton(), motion)
    chosen = [JOINT_NAMES.index(name) for name in still]
    torch.testing.assert_close(
        found.positions[:, chosen], wanted.positions[:, chosen], atol=1e-4, rtol=0
    )


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda text: text.replace("LeftHand", "LeftX"), "got none for left_wrist among"),
        (lambda text: text[:400], "expected HIERARCHY and MOTION"),
        (lambda text: text[: text.rindex("\n")], "got 924 numbers in all"),
        (lambda text: text.replace("Frame Time: 0.0166667", "Frame Time: 0"), "in seconds"),
        (lambda text: text.replace("Frame Time: 0.0166667", "Frame Time: 60"), "must be 1 to 1000"),
        (lambda text: text + " spam", "expected numbers only"),
        (lambda text: text.replace("OFFSET 0", "OFFSET one", 1), "three finite numbers"),
        (lambda text: text.replace("}\nMOTION", "MOTION"), "one that is cut"),
        (lambda text: text.replace("Xposition Y", "Wposition Y"), "names of channels"),
        (lambda text: f"{text[: text.rindex(' ')]} nan", "got NaN or infinity in 1"),
        (
            lambda text: text.replace("MOTION", "ROOT Prop\n{\n}\nMOTION"),
            "no prop or body beside it",
        ),
        (lambda text: re.sub("OFFSET .*", "OFFSET 0 0 0", text), "shows no front"),
        (lambda text: "ROOT " * 9, "expected HIERARCHY and MOTION"),
    ],
)
def test_what_is_no_body_is_refused_in_a_sentence(tmp_path, change, said):
    (tmp_path / "a.bvh").write_text(change(foreign_bvh(SWAYING, MIXAMO, {})))
    with pytest.raises(InputError, match=said):
        read_bvh(tmp_path / "a.bvh")


def test_a_file_that_says_one_rate_refuses_another(tmp_path):
    (tmp_path / "a.bvh").write_text(foreign_bvh(SWAYING, MIXAMO, {}))
    with pytest.raises(InputError, match="--fps 24"):
        read_bvh(Path(tmp_path / "a.bvh"), fps=24.0)
    assert read_bvh(tmp_path / "a.bvh", fps=60.0).fps == pytest.approx(60, rel=1e-4)


@pytest.mark.parametrize("metres", [1.0, 0.01, 0.0254])
def test_the_unit_is_told_by_the_legs(tmp_path, metres):
    skeleton = Skeleton(embedded_skeleton().offsets * 0.01 / metres)
    root = SWAYING.root * 0.01 / metres
    (tmp_path / "a.bvh").write_text(
        bvh_text(skeleton, type(SWAYING)(root, SWAYING.rotations), 30.0)
    )
    body = read_bvh(tmp_path / "a.bvh")
    torch.testing.assert_close(
        body.skeleton.offsets, embedded_skeleton().offsets, atol=1e-5, rtol=0
    )
    torch.testing.assert_close(body.motion.root, SWAYING.root, atol=1e-5, rtol=0)


def test_euler_angles_are_scipys_and_exist_in_gimbal_lock():
    turns = Rotation.random(50, random_state=0)
    found = euler_angles(turns.as_matrix())
    np.testing.assert_allclose(found, turns.as_euler("ZYX", degrees=True), atol=1e-9)
    locked = Rotation.from_euler("ZYX", [[20, 90, 50], [-70, -90, 10]], degrees=True).as_matrix()
    angles = euler_angles(locked)
    assert (angles[:, 2] == 0).all()
    again = Rotation.from_euler("ZYX", angles, degrees=True).as_matrix()
    np.testing.assert_allclose(again, locked, atol=1e-6)
