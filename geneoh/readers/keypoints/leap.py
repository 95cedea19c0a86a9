"""Frames of the Leap Motion (Ultraleap) service, from its WebSocket or leapjs.

A frame has `hands`, each with an `id`, a side (`type`) and the position of the `wrist`, and
`pointables`: fingers, each with the `handId` of its hand, its number (`type`, 0 for the thumb to 4)
and the positions of its joints. Millimetres, and microseconds in `timestamp`. Source: the
protocol's description, version 6; earlier versions lack the wrist.
"""

from collections.abc import Iterator
from typing import Any

from geneoh.hand.skeleton import KEYPOINT_FINGERS

JOINTS = ("mcpPosition", "pipPosition", "dipPosition", "btipPosition")
"""Fields of a finger's joints, from the palm to the tip. The thumb has no metacarpal: its first
joint is the one at the wrist."""
SEGMENTS = ("proximal", "intermediate", "distal", "tip")
OF_THUMB = ("metacarpal", "proximal", "distal", "tip")
"""OpenXR's names of these joints."""


def is_leap(frame: Any) -> bool:
    """Whether a value is a frame of the service."""
    return isinstance(frame, dict) and all(
        isinstance(frame.get(name), list) for name in ("hands", "pointables")
    )


def hands_of_leap(frame: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """The hands of a frame, each with its points by name, millimetres."""
    fingers = [each for each in frame["pointables"] if isinstance(each, dict)]
    for hand in frame["hands"]:
        if not isinstance(hand, dict):
            continue
        points = {"wrist": hand.get("wrist")}
        for finger in fingers:
            number = finger.get("type")
            if not isinstance(number, int) or not 0 <= number < len(KEYPOINT_FINGERS):
                continue
            if finger.get("handId") != hand.get("id"):
                continue
            for joint, segment in zip(JOINTS, SEGMENTS if number else OF_THUMB, strict=True):
                points[f"{KEYPOINT_FINGERS[number]}_{segment}"] = finger.get(joint)
        yield {
            "side": hand.get("type"),
            "confidence": hand.get("confidence"),
            "points": {name: place for name, place in points.items() if place is not None},
        }
