import torch

from geneoh.body.skeleton import (
    BODY_JOINTS,
    FINGER_JOINTS,
    JOINT_NAMES,
    PARENTS,
    WRISTS,
    embedded_skeleton,
)
from geneoh.geometry.mirror import mirror_points


def test_joints_stand_in_the_order_of_smplh():
    assert len(JOINT_NAMES) == len(PARENTS) == 52
    assert JOINT_NAMES[20:23] == ("left_wrist", "right_wrist", "left_index1")
    assert JOINT_NAMES[36:38] == ("left_thumb3", "right_index1")
    assert JOINT_NAMES[51] == "right_thumb3"
    assert [PARENTS[joint] for joint in (22, 25, 34, 36, 37, 51)] == [20, 20, 20, 35, 21, 50]
    assert all(parent < joint for joint, parent in enumerate(PARENTS))


def test_every_joint_hangs_on_one_of_its_own_side():
    for joint in range(1, 52):
        name, above = JOINT_NAMES[joint], JOINT_NAMES[PARENTS[joint]]
        for side in ("left", "right"):
            if above.startswith(side):
                assert name.startswith(side)


def test_the_embedded_skeleton_is_symmetric_and_faces_z_in_a_t_pose():
    offsets = embedded_skeleton().offsets
    assert offsets.shape == (52, 3)
    assert not offsets[0].any()
    mirror = [JOINT_NAMES.index(_other(name)) for name in JOINT_NAMES]
    torch.testing.assert_close(mirror_points(offsets)[mirror], offsets)
    left_arm = offsets[[18, 20, *FINGER_JOINTS["left"][1:3]]]
    assert bool((left_arm[:, 0] > 0.9 * left_arm.norm(dim=-1)).all())
    assert offsets[10, 2] > 0.1  # feet point forwards
    assert offsets[15, 1] > 0  # the head is up
    assert WRISTS == {"left": 20, "right": 21}
    assert BODY_JOINTS == 22


def _other(name: str) -> str:
    if name.startswith("left"):
        return name.replace("left", "right")
    return name.replace("right", "left")
