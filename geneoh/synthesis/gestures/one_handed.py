"""The table of gestures of one hand, with phrases for them.

See `geneoh.synthesis.gestures.repertoire` for the axes of places.
"""

from dataclasses import replace
from typing import Any

from geneoh.synthesis.gestures.repertoire import (
    DOWN,
    FORWARD,
    READY,
    UP,
    Gesture,
    HandPose,
    Strokes,
)


def _raised(shape: str, *says: str, **more: Any) -> Gesture:
    """A hand that is held up before the shoulder and shows its shape."""
    pose = HandPose((0.06, -0.12, 0.3), (0.0, 1.0, 0.1), (-0.1, 0.0, 1.0), shape)
    bob = HandPose((0.06, -0.08, 0.31), (0.0, 1.0, 0.2), (-0.1, 0.0, 1.0), shape)
    return replace(Gesture(says, pose, bob, Strokes("swing", 0.9, 2.0)), **more)


ONE_HANDED: dict[str, Gesture] = {
    "wave": Gesture(
        ("wave", "wave hello", "wave goodbye", "greet someone", "swing from side to side"),
        HandPose((0.12, 0.0, 0.22), (-0.4, 1.0, 0.1), (0.0, 0.0, 1.0), "loose"),
        HandPose((0.25, 0.0, 0.2), (0.5, 1.0, 0.1), (0.0, 0.0, 1.0), "open"),
        Strokes("swing", 0.45, 0.85),
        swivel=0.2,
    ),
    "wave fingers": Gesture(
        ("wave with the fingers", "bend and stretch the fingers", "say bye with the fingers"),
        HandPose((0.1, -0.08, 0.27), UP, FORWARD, "flat"),
        HandPose((0.1, -0.09, 0.27), (0.0, 1.0, 0.15), FORWARD, "bent"),
        Strokes("swing", 0.5, 0.9),
    ),
    "point forward": Gesture(
        ("point forward", "point ahead", "point at something", "show the way with the index"),
        READY,
        HandPose((0.02, -0.04, 0.5), (-0.05, 0.05, 1.0), (-0.5, -0.9, 0.0), "one"),
        Strokes("once"),
    ),
    "point up": Gesture(
        ("point up", "point at the sky", "point to the ceiling", "raise the index finger"),
        READY,
        HandPose((0.06, 0.12, 0.28), (0.0, 1.0, 0.1), (-0.6, 0.0, 0.8), "one"),
        Strokes("once"),
    ),
    "point aside": Gesture(
        ("point to the side", "point sideways", "indicate something at the side"),
        READY,
        HandPose((0.45, -0.06, 0.22), (1.0, 0.05, 0.35), (0.2, -0.9, 0.6), "one"),
        Strokes("once"),
        swivel=0.2,
    ),
    "show one": _raised("one", "show one", "show one finger", "show the number one"),
    "show two": _raised(
        "two", "show two", "show two fingers", "make a peace sign", "make a victory sign"
    ),
    "show three": _raised("three", "show three", "show three fingers", "show the number three"),
    "show four": _raised("four", "show four", "show four fingers", "show the number four"),
    "show five": _raised("open", "show five", "show five fingers", "spread all fingers"),
    "ok": _raised("ring", "make an ok sign", "show that it is fine", "form a ring", "say okay"),
    "horns": _raised("horns", "make horns", "make the sign of the horns", "rock"),
    "raise fist": _raised("fist", "raise a fist", "show a fist", "make a fist", "hold up a fist"),
    "count": _raised(
        "fist",
        *("count", "count to five", "count on the fingers", "count up", "number the fingers"),
        strokes=Strokes("swing", 0.6, 0.95),
        fingers="steps",
        steps=("fist", "one", "two", "three", "four", "open"),
    ),
    "thumb up": Gesture(
        ("give a thumbs up", "show a thumb up", "raise the thumb", "approve", "like it"),
        HandPose((0.0, -0.26, 0.33), (-0.5, 0.0, 0.85), (-0.85, 0.0, -0.5), "thumb"),
        HandPose((0.0, -0.23, 0.36), (-0.5, 0.1, 0.85), (-0.85, 0.0, -0.5), "thumb"),
        Strokes("swing", 0.8, 1.8),
    ),
    "thumb down": Gesture(
        ("give a thumbs down", "show a thumb down", "lower the thumb", "disapprove"),
        HandPose((0.02, -0.14, 0.34), (-0.9, -0.05, 0.45), (0.45, 0.1, 0.9), "thumb"),
        HandPose((0.02, -0.19, 0.35), (-0.9, -0.15, 0.45), (0.45, 0.0, 0.9), "thumb"),
        Strokes("swing", 0.8, 1.8),
        swivel=1.2,
    ),
    "clench": Gesture(
        ("open and close", "clench and open", "squeeze the air", "make a fist repeatedly"),
        HandPose((0.05, -0.24, 0.33), (-0.1, 0.35, 1.0), (-0.5, -0.8, 0.3), "open"),
        HandPose((0.05, -0.25, 0.31), (-0.1, 0.45, 1.0), (-0.5, -0.8, 0.3), "fist"),
        Strokes("swing", 0.9, 1.7),
    ),
    "stop": Gesture(
        ("say stop", "stop someone", "push back with a flat palm", "signal to halt"),
        HandPose((0.08, -0.18, 0.24), (0.0, 1.0, 0.2), (0.0, -0.1, 1.0), "loose"),
        HandPose((0.02, -0.03, 0.46), (0.0, 1.0, -0.1), FORWARD, "flat"),
        Strokes("once"),
    ),
    "grasp": Gesture(
        (
            "grasp and release",
            "grab something in the air",
            "reach out and take",
            "catch and let go",
        ),
        HandPose((0.02, -0.28, 0.27), (-0.2, 0.1, 1.0), (-0.8, -0.5, 0.0), "open"),
        HandPose((0.03, -0.12, 0.48), (-0.1, 0.1, 1.0), (-0.8, -0.5, 0.0), "wrapped"),
        Strokes("once"),
        fingers="grasp",
    ),
    "pinch": Gesture(
        ("pinch", "pick something small", "pluck", "take with two fingers", "pick up a crumb"),
        HandPose((0.02, -0.3, 0.28), (-0.2, -0.1, 1.0), (-0.5, -0.9, 0.0), "cup"),
        HandPose((0.0, -0.24, 0.46), (-0.15, -0.3, 1.0), (-0.5, -0.9, 0.0), "pinch"),
        Strokes("once"),
        fingers="grasp",
    ),
    "beckon": Gesture(
        ("beckon", "call someone over", "say come here", "curl the fingers to call someone"),
        HandPose((0.06, -0.2, 0.36), (-0.1, 0.2, 1.0), (-0.3, 1.0, 0.0), "flat"),
        HandPose((0.06, -0.17, 0.33), (-0.1, 0.5, 1.0), (-0.3, 1.0, -0.3), "wrapped"),
        Strokes("swing", 0.55, 0.95),
    ),
    "beat": Gesture(
        ("gesture along with speech", "beat while talking", "accompany the words", "gesticulate"),
        HandPose((0.02, -0.3, 0.26), (-0.3, 0.25, 1.0), (-0.8, 0.4, 0.0), "relaxed"),
        HandPose((0.12, -0.37, 0.33), (0.1, -0.05, 1.0), (-0.6, 0.8, 0.0), "loose"),
        Strokes("swing", 0.7, 1.5),
    ),
    "offer": Gesture(
        ("offer", "present something", "hold out an open palm", "ask for something", "beg"),
        READY,
        HandPose((0.08, -0.26, 0.44), (0.0, 0.05, 1.0), (-0.1, 1.0, -0.1), "flat"),
        Strokes("once"),
    ),
    "salute": Gesture(
        ("salute", "give a salute", "greet like a soldier"),
        READY,
        HandPose((0.09, 0.14, 0.14), (-0.85, 0.45, 0.1), (-0.2, -0.5, 0.75), "flat"),
        Strokes("once"),
        swivel=0.6,
    ),
    "scratch head": Gesture(
        ("scratch the head", "scratch", "rub the head", "tousle the hair"),
        HandPose((0.04, 0.24, 0.06), (-0.85, 0.45, 0.0), (-0.5, -0.8, 0.0), "claw"),
        HandPose((0.03, 0.26, 0.03), (-0.85, 0.4, -0.1), (-0.5, -0.8, 0.0), "wrapped"),
        Strokes("swing", 0.3, 0.5),
        swivel=0.5,
    ),
    "snap": Gesture(
        (
            "snap the fingers",
            "snap",
            "click the fingers",
            "flick the thumb against the middle finger",
        ),
        HandPose((0.1, -0.18, 0.32), (-0.2, 0.8, 0.6), (-0.7, 0.3, 0.2), "snapping"),
        HandPose((0.1, -0.2, 0.33), (-0.1, 0.6, 0.8), (-0.7, 0.3, 0.2), "snapped"),
        Strokes("strike", 0.6, 1.0),
    ),
    "knock": Gesture(
        ("knock", "knock on a door", "rap", "bang on a door", "strike with the knuckles"),
        HandPose((0.04, -0.1, 0.3), (-0.05, 1.0, -0.1), FORWARD, "fist"),
        HandPose((0.04, -0.1, 0.37), (-0.05, 1.0, 0.45), (0.0, -0.2, 1.0), "fist"),
        Strokes("strike", 0.28, 0.5),
    ),
    "write": Gesture(
        ("write", "write in the air", "scribble", "draw with a pen", "write down something"),
        HandPose((-0.08, -0.33, 0.34), (-0.45, -0.15, 1.0), (-0.75, -0.65, 0.0), "pen"),
        HandPose((-0.03, -0.32, 0.36), (-0.35, -0.05, 1.0), (-0.7, -0.7, 0.0), "pen"),
        Strokes("swing", 0.3, 0.6),
    ),
    "drink": Gesture(
        ("drink", "drink from a cup", "sip", "lift a glass to the mouth", "take a sip"),
        HandPose((-0.02, -0.28, 0.34), (-0.4, 0.0, 1.0), (-1.0, 0.0, -0.3), "grip"),
        HandPose((-0.06, 0.04, 0.2), (-0.95, 0.3, 0.1), (-0.1, 0.1, -1.0), "grip"),
        Strokes("once"),
        swivel=0.5,
    ),
    "phone": Gesture(
        (
            "call",
            "make a phone call",
            "hold a phone to the ear",
            "say call me",
            "listen to a phone",
        ),
        READY,
        HandPose((0.0, 0.1, 0.13), (-0.35, 0.3, 0.6), (-0.9, 0.1, 0.1), "phone"),
        Strokes("once"),
        swivel=0.4,
    ),
    "drum fingers": Gesture(
        ("drum on the table", "drum the fingers", "wait with drumming fingers", "tap one by one"),
        HandPose((0.0, -0.36, 0.34), (-0.15, 0.0, 1.0), DOWN, "keys"),
        HandPose((0.0, -0.355, 0.345), (-0.15, 0.06, 1.0), DOWN, "keys"),
        Strokes("swing", 0.5, 0.9),
        fingers="ripple",
    ),
    "wipe": Gesture(
        ("wipe", "wipe the table", "clean a surface", "stroke", "sweep over the table"),
        HandPose((0.16, -0.34, 0.3), (0.2, 0.0, 1.0), DOWN, "flat"),
        HandPose((-0.14, -0.34, 0.34), (-0.4, 0.0, 1.0), DOWN, "flat"),
        Strokes("swing", 0.9, 1.8),
    ),
    "throw": Gesture(
        ("throw", "throw a ball", "hurl something", "toss a ball", "fling something away"),
        HandPose((0.25, 0.12, -0.02), (-0.1, 0.9, -0.5), (0.0, 0.5, 0.9), "grip"),
        HandPose((-0.02, -0.06, 0.48), (-0.15, -0.3, 1.0), (-0.2, -1.0, -0.2), "open"),
        Strokes("once", 1.3, 2.0),
        fingers="throw",
        swivel=0.3,
    ),
    "turn": Gesture(
        ("turn a knob", "turn a key", "twist something", "screw", "turn a dial"),
        HandPose((0.02, -0.2, 0.42), (-0.1, 0.0, 1.0), (-0.3, -0.95, 0.0), "pinch"),
        HandPose((0.02, -0.2, 0.42), (-0.1, 0.0, 1.0), (-0.7, 0.7, 0.0), "pinch"),
        Strokes("swing", 0.8, 1.6),
    ),
    "swat": Gesture(
        ("swat", "chase away a fly", "brush something aside", "dismiss someone", "shoo"),
        HandPose((-0.05, -0.12, 0.34), (-0.7, 0.4, 0.6), (0.3, -0.4, -0.8), "relaxed"),
        HandPose((0.2, -0.1, 0.36), (0.5, 0.5, 0.7), (0.0, -0.8, 0.5), "open"),
        Strokes("strike", 0.6, 1.0),
        swivel=0.3,
    ),
}
"""What a hand does alone, while the other one does something else."""

MIRRORED = ("wave", "clench", "raise fist", "stop", "thumb up", "offer", "show five", "beckon")
"""Gestures of one hand that both hands can also make at once, mirrored."""
