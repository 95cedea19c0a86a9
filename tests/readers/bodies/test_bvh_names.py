import pytest

from geneoh.readers.bodies.bvh_names import key_of, match_joints

CHAINS = {
    "Biped": ("Bip01 Pelvis", "Bip01 Spine", "Bip01 Neck", "Bip01 {} Clavicle")
    + ("Bip01 {} UpperArm", "Bip01 {} Forearm", "Bip01 {} Hand"),
    "DAZ": ("hip", "abdomen", "neck", "{}Collar", "{}Shldr", "{}ForeArm", "{}Hand"),
    "Rigify": ("spine", "spine.003", "spine.004", "shoulder.{}", "upper_arm.{}", "forearm.{}")
    + ("hand.{}",),
    "CMU": ("Hips", "LowerBack", "Neck", "{}Shoulder", "{}Arm", "{}ForeArm", "{}Hand"),
    "Unreal": ("pelvis", "spine_01", "neck_01", "clavicle_{}", "upperarm_{}", "lowerarm_{}")
    + ("hand_{}",),
    "SMPL": ("m_avg_Pelvis", "m_avg_Spine1", "m_avg_Neck", "m_avg_{}_Collar", "m_avg_{}_Shoulder")
    + ("m_avg_{}_Elbow", "m_avg_{}_Wrist"),
    "mocopi": ("root", "torso_7", "neck_1", "{}_shoulder", "{}_up_arm", "{}_low_arm", "{}_hand"),
    "VRoid": ("J_Bip_C_Hips", "J_Bip_C_Spine", "J_Bip_C_Neck", "J_Bip_{}_Shoulder")
    + ("J_Bip_{}_UpperArm", "J_Bip_{}_LowerArm", "J_Bip_{}_Hand"),
    "Character Creator": ("CC_Base_Hip", "CC_Base_Waist", "CC_Base_NeckTwist01")
    + ("CC_Base_{}_Clavicle", "CC_Base_{}_Upperarm", "CC_Base_{}_Forearm", "CC_Base_{}_Hand"),
    "MotionBuilder": ("Character1_Hips", "Character1_Spine", "Character1_Neck")
    + tuple(f"Character1_{{}}{part}" for part in ("Shoulder", "Arm", "ForeArm", "Hand")),
    "Xsens": ("Hips", "Chest", "Neck", "{}Shoulder", "{}UpperArm", "{}LowerArm", "{}Wrist"),
}
SIDES = {
    **{"Biped": ("L", "R"), "DAZ": ("l", "r"), "Rigify": ("L", "R"), "Unreal": ("l", "r")},
    **{"SMPL": ("L", "R"), "VRoid": ("L", "R"), "Character Creator": ("L", "R")},
    **{"mocopi": ("l", "r")},
}


@pytest.mark.parametrize("program", CHAINS)
def test_arms_are_found_by_the_names_of_common_programs(program):
    pelvis, spine, neck, *arm = CHAINS[program]
    left, right = SIDES.get(program, ("Left", "Right"))
    names = [pelvis, spine, neck, *(n.format(left) for n in arm), *(n.format(right) for n in arm)]
    parents = [-1, 0, 1, 1, 3, 4, 5, 1, 7, 8, 9]
    found = match_joints(names, parents)
    for offset, side in ((3, "left"), (7, "right")):
        for index, part in enumerate(("collar", "shoulder", "elbow", "wrist")):
            assert found[f"{side}_{part}"] == offset + index
    assert (found["pelvis"], found["spine3"]) == (0, 1)


def test_fingers_are_found_where_all_three_joints_are_there():
    names = [
        "Hips",
        "Chest",
        *(f"{s}{part}" for s in ("Left", "Right") for part in ("Arm", "ForeArm", "Hand")),
    ]
    fingers = [f"LeftHandIndex{i}" for i in (1, 2, 3)] + ["RightHandIndex1"]
    found = match_joints([*names, *fingers], [-1, 0, 1, 2, 3, 1, 5, 6, 4, 8, 9, 7])
    assert [found[f"left_index{i}"] for i in (1, 2, 3)] == [8, 9, 10]
    assert "right_index1" not in found


def test_keys_hold_the_side_and_the_plain_name():
    assert key_of("mixamorig:LeftUpLeg") == ("left", "upleg")
    assert key_of("LThumb") == ("left", "thumb")
    assert key_of("hand.R") == ("right", "hand")
    assert key_of("index_01_l") == ("left", "index1")
    assert key_of("CC_Base_L_ToeBase") == ("left", "toe")
    assert match_joints(["root", "l_low_leg"], [-1, 0])["left_knee"] == 1
