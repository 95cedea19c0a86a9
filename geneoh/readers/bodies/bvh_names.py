"""Match the joints of a BVH with those of the body, by the names that common programs use:

Mixamo, MotionBuilder, CMU, Blender (Rigify), Biped, DAZ, Xsens, Rokoko, mocopi, VRoid, Character
Creator, Unreal and SMPL.
"""

import re
from collections.abc import Sequence

from geneoh.choices import SIDES

WORDS = re.compile(r"[A-Z]+(?=[A-Z][a-z])|[A-Z]?[a-z]+|[A-Z]+|\d+")
LEFT, RIGHT = {"left", "l", "lft"}, {"right", "r", "rgt"}
EMPTY = {"mixamorig", "bip", "b", "j", "jnt", "joint", "def", "bone", "bn", "m", "f", "avg", "ctrl"}
EMPTY |= {"character", "cc", "base", "c"}
"""Words in names that do not identify the joint."""

STEMS: dict[str, tuple[str, ...]] = {
    "hip": ("upleg", "thigh", "upperleg", "thighbend", "hip"),
    "knee": ("knee", "leg", "shin", "calf", "lowerleg", "lowleg"),
    "ankle": ("ankle", "foot"),
    "foot": ("toebase", "toe", "toes", "ball", "foot"),
    "shoulder": ("arm", "upperarm", "uparm", "shldr", "shldrbend", "shoulder"),
    "collar": ("collar", "clavicle", "collarbone", "shoulder"),
    "elbow": ("elbow", "forearm", "lowerarm", "forearmbend", "loarm", "lowarm"),
    "wrist": ("wrist", "hand"),
}
"""Names of paired joints, the least ambiguous first: "LeftShoulder" is the shoulder joint only if
no other joint is, and the collar otherwise."""
MIDDLE: dict[str, tuple[str, ...]] = {
    "pelvis": ("pelvis", "hips", "hip"),
    "neck": ("neck", "neck1", "neck0"),
    "head": ("head",),
}
FINGER_WORDS = {
    "index": ("index", "handindex", "findex", "fingerindex"),
    "middle": ("middle", "handmiddle", "fmiddle", "mid", "handmid", "fingermiddle"),
    "pinky": ("pinky", "handpinky", "fpinky", "little", "pinkie", "fingerpinky"),
    "ring": ("ring", "handring", "fring", "fingerring"),
    "thumb": ("thumb", "handthumb", "fingerthumb"),
}
NEEDED = tuple(f"{side}_{part}" for side in SIDES for part in ("shoulder", "elbow", "wrist"))
"""Joints without which there is no arm for a hand."""


def match_joints(names: Sequence[str], parents: Sequence[int]) -> dict[str, int]:
    """The index in a file of each body joint that the file has."""
    keys = [key_of(name) for name in names]
    by_key: dict[tuple[str, str], int] = {}
    for index, key in enumerate(keys):
        by_key.setdefault(key, index)
    found: dict[str, int] = {}
    for side in SIDES:
        for part, stems in STEMS.items():
            taken = set(found.values())
            there = (by_key.get((side, stem)) for stem in stems)
            index = next((i for i in there if i is not None and i not in taken), None)
            if index is not None:
                found[f"{side}_{part}"] = index
        found |= fingers(side, by_key)
    for joint, stems in MIDDLE.items():
        index = next((by_key["", stem] for stem in stems if ("", stem) in by_key), None)
        if index is not None:
            found[joint] = index
    found.setdefault("pelvis", 0)
    return found | spine(found, parents)


def key_of(name: str) -> tuple[str, str]:
    """The side in a joint's name, or "", and the rest of the name in lower case."""
    words = [word.lower() for word in WORDS.findall(name.rsplit(":", 1)[-1])]
    side = next((word for word in words if word in LEFT | RIGHT), "")
    rest = [word for word in words if word != side and word not in EMPTY]
    if len(rest) > 1 and rest[0].isdecimal():  # as in "Bip01 L Hand"
        rest = rest[1:]
    where = "left" if side in LEFT else "right" if side in RIGHT else ""
    return where, "".join(str(int(word)) if word.isdecimal() else word for word in rest)


def fingers(side: str, by_key: dict[tuple[str, str], int]) -> dict[str, int]:
    """The finger joints of one side, for fingers with all three of them."""
    found = {}
    for finger, words in FINGER_WORDS.items():
        for word in words:
            chain = [by_key.get((side, f"{word}{i}")) for i in (1, 2, 3)]
            if None not in chain:
                found |= {f"{side}_{finger}{i + 1}": joint for i, joint in enumerate(chain)}
                break
    return found


def spine(found: dict[str, int], parents: Sequence[int]) -> dict[str, int]:
    """The joints between pelvis and arms: spine1, spine2, and spine3, where the arms branch off."""
    pelvis = found["pelvis"]
    shoulders = [found[f"{side}_shoulder"] for side in SIDES if f"{side}_shoulder" in found]
    arms = [above(shoulder, parents) for shoulder in shoulders]
    if len(arms) < 2 or any(pelvis not in chain for chain in arms):
        return {}
    chest = next(joint for joint in arms[0] if joint in arms[1])
    chain = above(chest, parents)
    chain = chain[: chain.index(pelvis)][::-1] if pelvis in chain else []
    made = {"spine3": chest}
    if len(chain) > 1:
        made["spine1"] = chain[0]
    if len(chain) > 2:
        made["spine2"] = chain[-2]
    return made


def above(joint: int, parents: Sequence[int]) -> list[int]:
    """The joint and its ancestors, up to the root."""
    chain = [joint]
    while parents[chain[-1]] >= 0:
        chain.append(parents[chain[-1]])
    return chain
