"""The gestures that synthetic bodies make: where a hand goes, how it turns, and its shape.

Places and directions are of the right hand and seen from its own shoulder: outward from the middle
of the body, upward, forward; those of left hands are mirrored. Lengths are of an adult's arm of
0.545 m from shoulder to wrist, and follow other arms.
"""

from dataclasses import dataclass
from typing import Literal

from geneoh.synthesis.gestures.shapes import SHAPES

Vector = tuple[float, float, float]
Course = Literal["still", "swing", "strike", "once"]
Fingering = Literal["along", "grasp", "throw", "taps", "ripple", "steps"]


@dataclass(frozen=True)
class HandPose:
    """Where a hand is, where it points and what it looks like."""

    place: Vector  # of the wrist, metres
    along: Vector  # where the fingers of a flat hand point
    palm: Vector  # where the palm looks
    shape: str = "relaxed"

    def __post_init__(self) -> None:
        """Find names of unknown shapes at once."""
        assert self.shape in SHAPES, f"no shape {self.shape}"


@dataclass(frozen=True)
class Gesture:
    """What one hand does; `says` are English verbal phrases for it, the plainest first."""

    says: tuple[str, ...]
    start: HandPose
    end: HandPose | None = None  # the other end of the stroke; None for a hand that stays
    course: Course = "still"
    """Time of the stroke: to the end and back as a wave ("swing"), in short blows ("strike"), or
    once, with a stay at the end."""
    period: tuple[float, float] = (2.0, 3.5)  # seconds of a stroke there and back
    fingers: Fingering = "along"
    """Fingers go from the first shape to the second with the hand ("along"), close around what is
    not there at the end and open after it ("grasp"), or hold and let go ("throw"); or they tap each
    in its own time, ripple from the index to the pinky, or go through `steps`."""
    steps: tuple[str, ...] = ()  # shapes one after the other, a stroke each
    swivel: float = 0.0  # of the elbow outward from its relaxed place, radians


@dataclass(frozen=True)
class PairGesture:
    """What both hands do together; the left hand mirrors the right one where it has none."""

    right: Gesture
    left: Gesture | None = None
    says: tuple[str, ...] = ()  # of both hands; those of the right one where there are none
    apart: float = 0.0  # of a stroke, by which the left hand is later
    seated: float = 0.3  # share of the people who sit
    cross: float = 0.0  # how far the left hand is lower, metres, where arms cross
    touches: bool = False  # whether the palms meet, as they do in no variant that has them apart

    @property
    def said(self) -> tuple[str, ...]:
        """Phrases of both hands."""
        return self.says or self.right.says


def _raised(shape: str, *says: str, **more: object) -> Gesture:
    """A hand that is held up before the shoulder and shows its shape."""
    pose = HandPose((0.06, -0.12, 0.3), (0.0, 1.0, 0.1), (-0.1, 0.0, 1.0), shape)
    bob = HandPose((0.06, -0.08, 0.31), (0.0, 1.0, 0.2), (-0.1, 0.0, 1.0), shape)
    chosen = {"course": "swing", "period": (0.9, 2.0)} | more
    return Gesture(says, pose, bob, **chosen)  # pyright: ignore


UP, FORWARD = (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
DOWN, INWARD = (0.0, -1.0, 0.0), (-1.0, 0.0, 0.0)
_WAVING = (
    HandPose((0.12, 0.0, 0.22), (-0.4, 1.0, 0.1), (0.0, 0.0, 1.0), "loose"),
    HandPose((0.25, 0.0, 0.2), (0.5, 1.0, 0.1), (0.0, 0.0, 1.0), "open"),
)
_READY = HandPose((0.05, -0.32, 0.28), (-0.2, 0.1, 1.0), (-0.7, -0.7, 0.0), "loose")
_TABLE = HandPose((0.0, -0.36, 0.34), (-0.15, 0.0, 1.0), DOWN, "keys")

RESTS = {
    "side": HandPose((0.07, -0.52, 0.03), (0.0, -1.0, 0.1), INWARD),
    "belly": HandPose((-0.06, -0.36, 0.2), (-1.0, 0.05, 0.15), (0.0, 0.0, -1.0)),
    "hip": HandPose((0.08, -0.36, -0.02), (-0.5, -0.45, 0.7), (-0.8, -0.2, -0.5)),
    "lap": HandPose((0.0, -0.36, 0.3), (-0.2, -0.2, 1.0), DOWN),
}
"""Where hands rest: at the side, on the belly or the hip; those of people who sit, in the lap."""
REST_SAYS = (
    "rest",
    "stay still",
    "do nothing",
    "relax",
    "stay at rest",
    "keep still",
    "hang loose",
)

ONE_HANDED: dict[str, Gesture] = {
    "wave": Gesture(
        ("wave", "wave hello", "wave goodbye", "greet someone", "swing from side to side"),
        *_WAVING,
        "swing",
        (0.45, 0.85),
        swivel=0.2,
    ),
    "wave fingers": Gesture(
        ("wave with the fingers", "bend and stretch the fingers", "say bye with the fingers"),
        HandPose((0.1, -0.08, 0.27), UP, FORWARD, "flat"),
        HandPose((0.1, -0.09, 0.27), (0.0, 1.0, 0.15), FORWARD, "bent"),
        "swing",
        (0.5, 0.9),
    ),
    "point forward": Gesture(
        ("point forward", "point ahead", "point at something", "show the way with the index"),
        _READY,
        HandPose((0.02, -0.04, 0.5), (-0.05, 0.05, 1.0), (-0.5, -0.9, 0.0), "one"),
        "once",
    ),
    "point up": Gesture(
        ("point up", "point at the sky", "point to the ceiling", "raise the index finger"),
        _READY,
        HandPose((0.06, 0.12, 0.28), (0.0, 1.0, 0.1), (-0.6, 0.0, 0.8), "one"),
        "once",
    ),
    "point aside": Gesture(
        ("point to the side", "point sideways", "indicate something at the side"),
        _READY,
        HandPose((0.45, -0.06, 0.22), (1.0, 0.05, 0.35), (0.2, -0.9, 0.6), "one"),
        "once",
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
        period=(0.6, 0.95),
        fingers="steps",
        steps=("fist", "one", "two", "three", "four", "open"),
    ),
    "thumb up": Gesture(
        ("give a thumbs up", "show a thumb up", "raise the thumb", "approve", "like it"),
        HandPose((0.0, -0.26, 0.33), (-0.5, 0.0, 0.85), (-0.85, 0.0, -0.5), "thumb"),
        HandPose((0.0, -0.23, 0.36), (-0.5, 0.1, 0.85), (-0.85, 0.0, -0.5), "thumb"),
        "swing",
        (0.8, 1.8),
    ),
    "thumb down": Gesture(
        ("give a thumbs down", "show a thumb down", "lower the thumb", "disapprove"),
        HandPose((0.02, -0.14, 0.34), (-0.9, -0.05, 0.45), (0.45, 0.1, 0.9), "thumb"),
        HandPose((0.02, -0.19, 0.35), (-0.9, -0.15, 0.45), (0.45, 0.0, 0.9), "thumb"),
        "swing",
        (0.8, 1.8),
        swivel=1.2,
    ),
    "clench": Gesture(
        ("open and close", "clench and open", "squeeze the air", "make a fist repeatedly"),
        HandPose((0.05, -0.24, 0.33), (-0.1, 0.35, 1.0), (-0.5, -0.8, 0.3), "open"),
        HandPose((0.05, -0.25, 0.31), (-0.1, 0.45, 1.0), (-0.5, -0.8, 0.3), "fist"),
        "swing",
        (0.9, 1.7),
    ),
    "stop": Gesture(
        ("say stop", "stop someone", "push back with a flat palm", "signal to halt"),
        HandPose((0.08, -0.18, 0.24), (0.0, 1.0, 0.2), (0.0, -0.1, 1.0), "loose"),
        HandPose((0.02, -0.03, 0.46), (0.0, 1.0, -0.1), FORWARD, "flat"),
        "once",
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
        "once",
        fingers="grasp",
    ),
    "pinch": Gesture(
        ("pinch", "pick something small", "pluck", "take with two fingers", "pick up a crumb"),
        HandPose((0.02, -0.3, 0.28), (-0.2, -0.1, 1.0), (-0.5, -0.9, 0.0), "cup"),
        HandPose((0.0, -0.24, 0.46), (-0.15, -0.3, 1.0), (-0.5, -0.9, 0.0), "pinch"),
        "once",
        fingers="grasp",
    ),
    "beckon": Gesture(
        ("beckon", "call someone over", "say come here", "curl the fingers to call someone"),
        HandPose((0.06, -0.2, 0.36), (-0.1, 0.2, 1.0), (-0.3, 1.0, 0.0), "flat"),
        HandPose((0.06, -0.17, 0.33), (-0.1, 0.5, 1.0), (-0.3, 1.0, -0.3), "wrapped"),
        "swing",
        (0.55, 0.95),
    ),
    "beat": Gesture(
        ("gesture along with speech", "beat while talking", "accompany the words", "gesticulate"),
        HandPose((0.02, -0.3, 0.26), (-0.3, 0.25, 1.0), (-0.8, 0.4, 0.0), "relaxed"),
        HandPose((0.12, -0.37, 0.33), (0.1, -0.05, 1.0), (-0.6, 0.8, 0.0), "loose"),
        "swing",
        (0.7, 1.5),
    ),
    "offer": Gesture(
        ("offer", "present something", "hold out an open palm", "ask for something", "beg"),
        _READY,
        HandPose((0.08, -0.26, 0.44), (0.0, 0.05, 1.0), (-0.1, 1.0, -0.1), "flat"),
        "once",
    ),
    "salute": Gesture(
        ("salute", "give a salute", "greet like a soldier"),
        _READY,
        HandPose((0.09, 0.14, 0.14), (-0.85, 0.45, 0.1), (-0.2, -0.5, 0.75), "flat"),
        "once",
        swivel=0.6,
    ),
    "scratch head": Gesture(
        ("scratch the head", "scratch", "rub the head", "tousle the hair"),
        HandPose((0.04, 0.24, 0.06), (-0.85, 0.45, 0.0), (-0.5, -0.8, 0.0), "claw"),
        HandPose((0.03, 0.26, 0.03), (-0.85, 0.4, -0.1), (-0.5, -0.8, 0.0), "wrapped"),
        "swing",
        (0.3, 0.5),
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
        "strike",
        (0.6, 1.0),
    ),
    "knock": Gesture(
        ("knock", "knock on a door", "rap", "bang on a door", "strike with the knuckles"),
        HandPose((0.04, -0.1, 0.3), (-0.05, 1.0, -0.1), FORWARD, "fist"),
        HandPose((0.04, -0.1, 0.37), (-0.05, 1.0, 0.45), (0.0, -0.2, 1.0), "fist"),
        "strike",
        (0.28, 0.5),
    ),
    "write": Gesture(
        ("write", "write in the air", "scribble", "draw with a pen", "write down something"),
        HandPose((-0.08, -0.33, 0.34), (-0.45, -0.15, 1.0), (-0.75, -0.65, 0.0), "pen"),
        HandPose((-0.03, -0.32, 0.36), (-0.35, -0.05, 1.0), (-0.7, -0.7, 0.0), "pen"),
        "swing",
        (0.3, 0.6),
    ),
    "drink": Gesture(
        ("drink", "drink from a cup", "sip", "lift a glass to the mouth", "take a sip"),
        HandPose((-0.02, -0.28, 0.34), (-0.4, 0.0, 1.0), (-1.0, 0.0, -0.3), "grip"),
        HandPose((-0.06, 0.04, 0.2), (-0.95, 0.3, 0.1), (-0.1, 0.1, -1.0), "grip"),
        "once",
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
        _READY,
        HandPose((0.0, 0.1, 0.13), (-0.35, 0.3, 0.6), (-0.9, 0.1, 0.1), "phone"),
        "once",
        swivel=0.4,
    ),
    "drum fingers": Gesture(
        ("drum on the table", "drum the fingers", "wait with drumming fingers", "tap one by one"),
        _TABLE,
        HandPose((0.0, -0.355, 0.345), (-0.15, 0.06, 1.0), DOWN, "keys"),
        "swing",
        (0.5, 0.9),
        fingers="ripple",
    ),
    "wipe": Gesture(
        ("wipe", "wipe the table", "clean a surface", "stroke", "sweep over the table"),
        HandPose((0.16, -0.34, 0.3), (0.2, 0.0, 1.0), DOWN, "flat"),
        HandPose((-0.14, -0.34, 0.34), (-0.4, 0.0, 1.0), DOWN, "flat"),
        "swing",
        (0.9, 1.8),
    ),
    "throw": Gesture(
        ("throw", "throw a ball", "hurl something", "toss a ball", "fling something away"),
        HandPose((0.25, 0.12, -0.02), (-0.1, 0.9, -0.5), (0.0, 0.5, 0.9), "grip"),
        HandPose((-0.02, -0.06, 0.48), (-0.15, -0.3, 1.0), (-0.2, -1.0, -0.2), "open"),
        "once",
        (1.3, 2.0),
        fingers="throw",
        swivel=0.3,
    ),
    "turn": Gesture(
        ("turn a knob", "turn a key", "twist something", "screw", "turn a dial"),
        HandPose((0.02, -0.2, 0.42), (-0.1, 0.0, 1.0), (-0.3, -0.95, 0.0), "pinch"),
        HandPose((0.02, -0.2, 0.42), (-0.1, 0.0, 1.0), (-0.7, 0.7, 0.0), "pinch"),
        "swing",
        (0.8, 1.6),
    ),
    "swat": Gesture(
        ("swat", "chase away a fly", "brush something aside", "dismiss someone", "shoo"),
        HandPose((-0.05, -0.12, 0.34), (-0.7, 0.4, 0.6), (0.3, -0.4, -0.8), "relaxed"),
        HandPose((0.2, -0.1, 0.36), (0.5, 0.5, 0.7), (0.0, -0.8, 0.5), "open"),
        "strike",
        (0.6, 1.0),
        swivel=0.3,
    ),
}
"""What a hand does alone, while the other one does something else."""

TWO_HANDED: dict[str, PairGesture] = {
    "clap": PairGesture(
        Gesture(
            ("clap", "applaud", "clap along", "give applause", "slap the palms together"),
            HandPose((-0.03, -0.2, 0.32), (-0.1, 0.55, 0.85), (-1.0, 0.0, 0.0), "flat"),
            HandPose((-0.157, -0.2, 0.32), (-0.02, 0.55, 0.85), (-1.0, 0.0, 0.0), "flat"),
            "strike",
            (0.3, 0.65),
        ),
        touches=True,
    ),
    "fold": PairGesture(
        Gesture(
            ("fold the arms", "cross before the chest", "cross the arms"),
            HandPose((-0.22, -0.2, 0.17), (-1.0, 0.1, -0.1), (0.0, -0.1, -1.0), "relaxed"),
        ),
        cross=0.05,
    ),
    "pray": PairGesture(
        Gesture(
            ("pray", "press the palms together", "beg with joined palms", "thank with a bow"),
            HandPose((-0.156, -0.2, 0.25), (-0.02, 1.0, 0.25), (-1.0, 0.0, 0.0), "flat"),
        ),
        touches=True,
    ),
    "type": PairGesture(
        Gesture(
            (
                "type",
                "type on a keyboard",
                "write on a computer",
                "press keys",
                "work at a computer",
            ),
            HandPose((-0.07, -0.36, 0.34), (-0.2, 0.0, 1.0), (-0.1, -1.0, 0.0), "keys"),
            HandPose((-0.07, -0.37, 0.345), (-0.2, -0.06, 1.0), (-0.1, -1.0, 0.0), "keys"),
            "swing",
            (0.35, 0.6),
            fingers="taps",
        ),
        seated=0.9,
    ),
    "piano": PairGesture(
        Gesture(
            ("play the piano", "play a melody on the piano", "play on the keys", "play chords"),
            HandPose((-0.12, -0.3, 0.38), (-0.05, 0.05, 1.0), DOWN, "keys"),
            HandPose((0.14, -0.33, 0.38), (0.05, -0.1, 1.0), DOWN, "cup"),
            "swing",
            (1.2, 2.4),
            fingers="taps",
        ),
        seated=0.95,
    ),
    "guitar": PairGesture(
        Gesture(
            ("strum the guitar", "strum the strings", "pluck the strings"),
            HandPose((-0.02, -0.28, 0.24), (-0.8, -0.1, 0.35), (0.2, -0.3, -0.9), "pinch"),
            HandPose((-0.02, -0.38, 0.24), (-0.7, -0.6, 0.35), (0.1, -0.2, -0.9), "pen"),
            "swing",
            (0.35, 0.7),
            swivel=0.2,
        ),
        Gesture(
            ("hold the chords", "press the strings", "finger the fretboard"),
            HandPose((0.2, -0.14, 0.3), (-0.35, 0.75, 0.4), (-0.2, 0.3, -0.9), "grip"),
            HandPose((0.26, -0.12, 0.32), (-0.35, 0.75, 0.4), (-0.2, 0.3, -0.9), "claw"),
            "swing",
            (1.4, 2.8),
            fingers="taps",
        ),
        ("play the guitar", "play an air guitar", "accompany a song on the guitar"),
        seated=0.4,
    ),
    "flute": PairGesture(
        Gesture(
            ("play the flute", "play a melody on a flute", "play a wind instrument"),
            HandPose((-0.12, -0.04, 0.24), (-0.35, 0.4, 0.45), (-0.6, 0.2, -0.7), "cup"),
            HandPose((-0.12, -0.05, 0.25), (-0.35, 0.4, 0.5), (-0.6, 0.2, -0.7), "cup"),
            "swing",
            (0.5, 0.9),
            fingers="taps",
            swivel=0.3,
        ),
    ),
    "drums": PairGesture(
        Gesture(
            ("play the drums", "drum", "beat a drum with sticks", "swing drumsticks"),
            HandPose((0.0, -0.2, 0.32), (-0.2, 0.7, 0.8), (-0.6, -0.6, 0.3), "wrapped"),
            HandPose((-0.02, -0.34, 0.37), (-0.2, -0.25, 1.0), (-0.6, -0.8, 0.0), "fist"),
            "strike",
            (0.4, 0.75),
        ),
        apart=0.5,
        seated=0.7,
    ),
    "box": PairGesture(
        Gesture(
            ("box", "punch", "throw punches", "fight with the fists", "hit a punching bag"),
            HandPose((-0.04, -0.06, 0.2), (-0.1, 0.75, 0.6), (-0.9, -0.2, -0.2), "fist"),
            HandPose((-0.08, -0.03, 0.5), (-0.1, 0.0, 1.0), (-0.3, -0.9, 0.0), "fist"),
            "strike",
            (0.6, 1.1),
        ),
        apart=0.5,
        seated=0.0,
    ),
    "cheer": PairGesture(
        Gesture(
            ("cheer", "celebrate", "fly up in joy", "rise as fists", "jubilate"),
            HandPose((0.14, 0.22, 0.14), (0.05, 1.0, 0.1), (-0.3, 0.0, 0.9), "fist"),
            HandPose((0.16, 0.36, 0.12), (0.05, 1.0, 0.0), (-0.3, 0.0, 0.9), "fist"),
            "swing",
            (0.5, 0.9),
        ),
        seated=0.2,
    ),
    "surrender": PairGesture(
        Gesture(
            ("surrender", "give up", "go up with open palms", "show empty palms"),
            HandPose((0.16, -0.02, 0.16), (0.05, 1.0, 0.1), FORWARD, "open"),
            HandPose((0.18, 0.02, 0.16), (0.05, 1.0, 0.1), FORWARD, "open"),
            "swing",
            (1.5, 3.0),
        ),
    ),
    "shrug": PairGesture(
        Gesture(
            ("shrug", "ask why", "show that nobody knows", "turn up the palms"),
            _READY,
            HandPose((0.24, -0.24, 0.3), (0.5, 0.0, 0.8), (-0.1, 1.0, 0.1), "open"),
            "once",
        ),
    ),
    "rub": PairGesture(
        Gesture(
            ("rub the palms", "rub each other", "warm up by rubbing", "wash", "rub with soap"),
            HandPose((-0.156, -0.28, 0.26), (-0.25, 0.3, 0.9), (-1.0, -0.1, -0.2), "flat"),
            HandPose((-0.154, -0.26, 0.31), (-0.25, 0.35, 0.9), (-1.0, -0.1, -0.2), "cup"),
            "swing",
            (0.4, 0.8),
        ),
        apart=0.5,
        touches=True,
    ),
    "measure": PairGesture(
        Gesture(
            ("show a size", "show how big it was", "show a length", "measure something large"),
            HandPose((-0.06, -0.22, 0.34), (-0.05, 0.3, 1.0), (-1.0, 0.0, 0.0), "flat"),
            HandPose((0.16, -0.2, 0.36), (0.0, 0.3, 1.0), (-1.0, 0.0, 0.0), "flat"),
            "once",
        ),
    ),
    "hold ball": PairGesture(
        Gesture(
            ("hold a ball", "hold something round", "embrace a large ball", "carry a globe"),
            HandPose((-0.06, -0.26, 0.35), (-0.35, 0.1, 0.95), (-0.95, 0.0, -0.3), "cup"),
            HandPose((-0.05, -0.2, 0.36), (-0.35, 0.2, 0.95), (-0.95, 0.0, -0.3), "cup"),
            "swing",
            (1.2, 2.4),
        ),
    ),
    "steer": PairGesture(
        Gesture(
            ("steer a car", "drive", "turn a steering wheel", "hold a steering wheel"),
            HandPose((0.0, -0.26, 0.42), (-0.2, 0.35, 0.9), (-0.3, -0.8, 0.4), "wrapped"),
            HandPose((-0.04, -0.06, 0.42), (-0.5, 0.5, 0.7), (-0.3, -0.6, 0.6), "fist"),
            "swing",
            (1.6, 3.0),
        ),
        apart=0.5,
        seated=1.0,
    ),
    "pull rope": PairGesture(
        Gesture(
            ("pull a rope", "haul in a rope", "tug at a rope", "draw a rope towards the body"),
            HandPose((-0.1, -0.02, 0.44), (-0.2, 0.3, 0.9), (-0.8, -0.3, 0.2), "open"),
            HandPose((-0.1, -0.24, 0.24), (-0.25, 0.35, 0.9), (-0.9, -0.3, 0.2), "fist"),
            "swing",
            (0.9, 1.6),
        ),
        apart=0.5,
        seated=0.1,
    ),
    "talk": PairGesture(
        Gesture(
            ("gesture in a conversation", "accompany a speech", "underline the words", "explain"),
            HandPose((0.0, -0.3, 0.27), (-0.35, 0.2, 1.0), (-0.9, 0.3, 0.0), "relaxed"),
            HandPose((0.14, -0.33, 0.34), (0.1, 0.05, 1.0), (-0.4, 0.9, 0.0), "open"),
            "swing",
            (0.8, 1.6),
        ),
    ),
}
"""What both hands do together."""

MIRRORED = ("wave", "clench", "raise fist", "stop", "thumb up", "offer", "show five", "beckon")
"""Gestures of one hand that both at times make at once."""


@dataclass(frozen=True)
class Cast:
    """How often bodies do what; shares of all clips."""

    together: float = 0.35  # both hands in one gesture
    mirrored: float = 0.07  # both hands in the same gesture of one hand
    both: float = 0.25  # of the other clips: each hand in a gesture of its own; else one rests
    idle: float = 0.04  # of the other clips: both hands rest
    walking: float = 0.15  # of the people who do not sit
    seated: float = 0.25  # of the people whose gesture does not say
