"""Labelled actions in recordings of H2O, GRAB and ARCTIC.

Source: Text2HOI, supplement, "Text prompt annotation": the rules for clips and words. Labels are
read as distributed: H2O has one number a frame (action_label, of camera 4 only), GRAB one intent a
sequence, and for ARCTIC the authors of Text2HOI wrote description.txt for each sequence.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

import numpy as np

from geneoh.choices import HANDS, AnnotatedSource, HandsName
from geneoh.errors import InputError
from geneoh.readers.base import SourceClip, ancestor
from geneoh.readers.foreign_files import numbered_files, read_numbers, read_record, read_text
from geneoh.readers.sources.grab import contact_labels

SHORTEST_CLIP = 20  # frames, at 30 a second, of the shortest clip (the paper's code)

_H2O_VERBS = {
    "grab": "book espresso lotion spray milk cocoa chips cappuccino",
    "place": "book espresso lotion spray milk cocoa chips cappuccino",
    "open": "lotion milk chips",
    "close": "lotion milk chips",
    "pour": "milk",
    "take out": "espresso cocoa chips cappuccino",
    "put in": "espresso cocoa cappuccino",
    "apply": "lotion spray",
    "read": "book espresso",
    "spray": "spray",
    "squeeze": "lotion",
}
H2O_LABELS = [(verb, noun) for verb, nouns in _H2O_VERBS.items() for noun in nouns.split()]
"""Verb and object of the labels 1 to 36; 0 is no action."""

_GRAB_VERBS = {"offhand": "hand over", "switchON": "switch on", "takepicture": "photograph"}
"""Verbs for intents of GRAB that are not plain ones; "take picture" takes no further object."""
_COMPOUNDS = (
    *("alarm clock", "coffee mug", "frying pan", "game controller", "light bulb", "piggy bank"),
    *("rubber duck", "water bottle", "wine glass", "wrist watch"),  # of GRAB
    *("capsule machine", "espresso machine", "waffle iron"),  # of ARCTIC
)
_NOUNS = {noun.replace(" ", ""): noun for noun in _COMPOUNDS}
_NOUNS |= {"cubemiddle": "cube", "stanfordbunny": "bunny"}
"""Nouns for objects whose names in the data sets are no nouns."""
_LEFT_OUT = {("write", "notebook"), ("operate", "waffleiron"), ("push", "capsulemachine")}
"""Actions on objects of ARCTIC that the paper's code leaves out: too few clips."""
_TYPOS = {"grabing": "grab", "openning": "open", "labtop": "laptop", "graps": "grasp"}
_LINE = re.compile(r"(\d+)\s*-\s*(\d+)\s+(\w+)\s*,?\s+(left|right|both)(?:\s+(\w+))?,?")


@dataclass(frozen=True)
class Label:
    """The action in a stretch of a recording."""

    verb: str
    noun: str
    object: str  # name of the object in the data set
    frames: slice  # of the recording, at its own rate
    hands: HandsName | None = None  # None where the label names none
    subject: str = ""  # the person


def labels_of(source: AnnotatedSource, clip: SourceClip) -> list[Label]:
    """The labelled stretches of a clip; `InputError` where labels are missing or damaged."""
    return _READERS[source](clip)


def has_labels(source: AnnotatedSource, clip: SourceClip) -> bool:
    """Whether a clip has labels: in H2O only that of camera 4 has."""
    return source != "h2o" or (clip.path / "action_label").is_dir()


def label_files(source: AnnotatedSource, clip: SourceClip) -> list[Path]:
    """The files that labels of a clip are read from, besides those of its hands and object."""
    return [description_of(clip.path)] if source == "arctic" else []


def h2o_labels(clip: SourceClip) -> list[Label]:
    """Stretches of consecutive frames with one label, of more than 20 frames."""
    files = numbered_files(clip.path / "action_label", "*.txt")
    by_frame = sorted((frame, label_in(path)) for frame, path in files.items())
    found: list[Label] = []
    subject = ancestor(clip.path, 3).name
    for (number, _), run in groupby(
        enumerate(by_frame), key=lambda each: (each[1][1], each[1][0] - each[0])
    ):
        frames = [frame for _, (frame, _) in run]
        if number and len(frames) > SHORTEST_CLIP:
            verb, noun = H2O_LABELS[number - 1]
            stretch = slice(frames[0], frames[-1] + 1)
            found.append(Label(verb, noun, noun, stretch, subject=subject))
    return found


def label_in(path: Path) -> int:
    """The label of the action in a frame, 0 for none."""
    value = read_numbers(path, 1).ravel()
    if len(value) != 1 or value[0] not in range(len(H2O_LABELS) + 1):
        raise InputError(
            f"{path}: expected one label from 0 to {len(H2O_LABELS)}, got {value.tolist()[:3]}; "
            "copy it again"
        )
    return int(value[0])


def grab_labels(clip: SourceClip) -> list[Label]:
    """The frames from the first to the last contact, with the sequence's intent as the verb."""
    record = read_record(clip.path)
    name, intent = record.text("obj_name"), record.text("motion_intent")
    touched = np.flatnonzero(contact_labels(record).any(axis=1))
    if not len(touched):
        return []
    verb = _GRAB_VERBS.get(intent, intent)
    stretch = slice(int(touched[0]), int(touched[-1]) + 1)
    return [Label(verb, grab_noun(name), name, stretch, subject=clip.path.parent.name)]


def grab_noun(name: str) -> str:
    """The words for an object of GRAB: without its size, in several words where it is compound."""
    plain = re.sub(r"(large|medium|small)$", "", name)
    return _NOUNS.get(plain, plain)


def arctic_labels(clip: SourceClip) -> list[Label]:
    """The stretches of description.txt: "start-end verb hands object", counted from 1."""
    path = description_of(clip.path)
    name = clip.path.name.split("_")[0]
    found: list[Label] = []
    for number, line in enumerate(read_text(path).splitlines(), start=1):
        if not line.strip():
            continue
        match = _LINE.fullmatch(line.strip())
        start, stop = (int(match[1]), int(match[2])) if match else (0, 0)
        if match is None or not 1 <= start <= stop:
            raise InputError(
                f"{path}, line {number}: expected 'start-end verb left|right|both object' with "
                f"frames from 1 on, got '{line.strip()[:60]}'; correct it"
            )
        verb = _TYPOS.get(match[3].lower(), match[3].lower())
        hands = HANDS[("left", "right", "both").index(match[4])]
        if (verb, name) in _LEFT_OUT or stop - start + 1 < SHORTEST_CLIP:
            continue
        noun = _NOUNS.get(name, name)
        stretch = slice(start - 1, stop)
        found.append(Label(verb, noun, name, stretch, hands, clip.path.parent.name))
    return found


def description_of(path: Path) -> Path:
    """Where the description of an ARCTIC sequence is: {sid}/{seq}/description.txt in one of the
    folders description, descriptions and text of the data set, or beside the sequence."""
    stem, root = path.name.removesuffix(".mano.npy"), ancestor(path, 3)
    places = [root / name for name in ("description", "descriptions", "text")]
    files = [each / path.parent.name / stem / "description.txt" for each in places]
    files.append(path.parent / stem / "description.txt")
    found = next((file for file in files if file.is_file()), None)
    if found is None:
        raise InputError(
            f"{path}: expected its actions in {files[0]}, found no file; put the text descriptions "
            "for ARCTIC of Text2HOI there"
        )
    return found


_READERS: dict[AnnotatedSource, Callable[[SourceClip], list[Label]]] = {
    "h2o": h2o_labels,
    "grab": grab_labels,
    "arctic": arctic_labels,
}
