"""The table of gestures of both hands, with phrases for them.

See `geneoh.synthesis.gestures.repertoire` for the axes of places.
"""

from geneoh.synthesis.gestures.repertoire import (
    DOWN,
    FORWARD,
    READY,
    Gesture,
    HandPose,
    PairGesture,
    Strokes,
)

TWO_HANDED: dict[str, PairGesture] = {
    "clap": PairGesture(
        ("clap", "applaud", "clap along", "give applause", "slap the palms together"),
        HandPose((-0.03, -0.2, 0.32), (-0.1, 0.55, 0.85), (-1.0, 0.0, 0.0), "flat"),
        HandPose((-0.157, -0.2, 0.32), (-0.02, 0.55, 0.85), (-1.0, 0.0, 0.0), "flat"),
        Strokes("strike", 0.3, 0.65),
        touches=True,
    ),
    "fold": PairGesture(
        ("fold the arms", "cross before the chest", "cross the arms"),
        HandPose((-0.22, -0.2, 0.17), (-1.0, 0.1, -0.1), (0.0, -0.1, -1.0), "relaxed"),
        cross=0.05,
    ),
    "pray": PairGesture(
        ("pray", "press the palms together", "beg with joined palms", "thank with a bow"),
        HandPose((-0.156, -0.2, 0.25), (-0.02, 1.0, 0.25), (-1.0, 0.0, 0.0), "flat"),
        touches=True,
    ),
    "type": PairGesture(
        ("type", "type on a keyboard", "write on a computer", "press keys", "work at a computer"),
        HandPose((-0.07, -0.36, 0.34), (-0.2, 0.0, 1.0), (-0.1, -1.0, 0.0), "keys"),
        HandPose((-0.07, -0.37, 0.345), (-0.2, -0.06, 1.0), (-0.1, -1.0, 0.0), "keys"),
        Strokes("swing", 0.35, 0.6),
        fingers="taps",
        seated=0.9,
    ),
    "piano": PairGesture(
        ("play the piano", "play a melody on the piano", "play on the keys", "play chords"),
        HandPose((-0.12, -0.3, 0.38), (-0.05, 0.05, 1.0), DOWN, "keys"),
        HandPose((0.14, -0.33, 0.38), (0.05, -0.1, 1.0), DOWN, "cup"),
        Strokes("swing", 1.2, 2.4),
        fingers="taps",
        seated=0.95,
    ),
    "guitar": PairGesture(
        ("play the guitar", "play an air guitar", "accompany a song on the guitar"),
        HandPose((-0.02, -0.28, 0.24), (-0.8, -0.1, 0.35), (0.2, -0.3, -0.9), "pinch"),
        HandPose((-0.02, -0.38, 0.24), (-0.7, -0.6, 0.35), (0.1, -0.2, -0.9), "pen"),
        Strokes("swing", 0.35, 0.7),
        swivel=0.2,
        left=Gesture(
            ("hold the chords",),
            HandPose((0.2, -0.14, 0.3), (-0.35, 0.75, 0.4), (-0.2, 0.3, -0.9), "grip"),
            HandPose((0.26, -0.12, 0.32), (-0.35, 0.75, 0.4), (-0.2, 0.3, -0.9), "claw"),
            Strokes("swing", 1.4, 2.8),
            fingers="taps",
        ),
        seated=0.4,
    ),
    "flute": PairGesture(
        ("play the flute", "play a melody on a flute", "play a wind instrument"),
        HandPose((-0.12, -0.04, 0.24), (-0.35, 0.4, 0.45), (-0.6, 0.2, -0.7), "cup"),
        HandPose((-0.12, -0.05, 0.25), (-0.35, 0.4, 0.5), (-0.6, 0.2, -0.7), "cup"),
        Strokes("swing", 0.5, 0.9),
        fingers="taps",
        swivel=0.3,
    ),
    "drums": PairGesture(
        ("play the drums", "drum", "beat a drum with sticks", "swing drumsticks"),
        HandPose((0.0, -0.2, 0.32), (-0.2, 0.7, 0.8), (-0.6, -0.6, 0.3), "wrapped"),
        HandPose((-0.02, -0.34, 0.37), (-0.2, -0.25, 1.0), (-0.6, -0.8, 0.0), "fist"),
        Strokes("strike", 0.4, 0.75),
        apart=0.5,
        seated=0.7,
    ),
    "box": PairGesture(
        ("box", "punch", "throw punches", "fight with the fists", "hit a punching bag"),
        HandPose((-0.04, -0.06, 0.2), (-0.1, 0.75, 0.6), (-0.9, -0.2, -0.2), "fist"),
        HandPose((-0.08, -0.03, 0.5), (-0.1, 0.0, 1.0), (-0.3, -0.9, 0.0), "fist"),
        Strokes("strike", 0.6, 1.1),
        apart=0.5,
        seated=0.0,
    ),
    "cheer": PairGesture(
        ("cheer", "celebrate", "fly up in joy", "rise as fists", "jubilate"),
        HandPose((0.14, 0.22, 0.14), (0.05, 1.0, 0.1), (-0.3, 0.0, 0.9), "fist"),
        HandPose((0.16, 0.36, 0.12), (0.05, 1.0, 0.0), (-0.3, 0.0, 0.9), "fist"),
        Strokes("swing", 0.5, 0.9),
        seated=0.2,
    ),
    "surrender": PairGesture(
        ("surrender", "give up", "go up with open palms", "show empty palms"),
        HandPose((0.16, -0.02, 0.16), (0.05, 1.0, 0.1), FORWARD, "open"),
        HandPose((0.18, 0.02, 0.16), (0.05, 1.0, 0.1), FORWARD, "open"),
        Strokes("swing", 1.5, 3.0),
    ),
    "shrug": PairGesture(
        ("shrug", "ask why", "show that nobody knows", "turn up the palms"),
        READY,
        HandPose((0.24, -0.24, 0.3), (0.5, 0.0, 0.8), (-0.1, 1.0, 0.1), "open"),
        Strokes("once"),
    ),
    "rub": PairGesture(
        ("rub the palms", "rub each other", "warm up by rubbing", "wash", "rub with soap"),
        HandPose((-0.156, -0.28, 0.26), (-0.25, 0.3, 0.9), (-1.0, -0.1, -0.2), "flat"),
        HandPose((-0.154, -0.26, 0.31), (-0.25, 0.35, 0.9), (-1.0, -0.1, -0.2), "cup"),
        Strokes("swing", 0.4, 0.8),
        apart=0.5,
        touches=True,
    ),
    "measure": PairGesture(
        ("show a size", "show how big it was", "show a length", "measure something large"),
        HandPose((-0.06, -0.22, 0.34), (-0.05, 0.3, 1.0), (-1.0, 0.0, 0.0), "flat"),
        HandPose((0.16, -0.2, 0.36), (0.0, 0.3, 1.0), (-1.0, 0.0, 0.0), "flat"),
        Strokes("once"),
    ),
    "hold ball": PairGesture(
        ("hold a ball", "hold something round", "embrace a large ball", "carry a globe"),
        HandPose((-0.06, -0.26, 0.35), (-0.35, 0.1, 0.95), (-0.95, 0.0, -0.3), "cup"),
        HandPose((-0.05, -0.2, 0.36), (-0.35, 0.2, 0.95), (-0.95, 0.0, -0.3), "cup"),
        Strokes("swing", 1.2, 2.4),
    ),
    "steer": PairGesture(
        ("steer a car", "drive", "turn a steering wheel", "hold a steering wheel"),
        HandPose((0.0, -0.26, 0.42), (-0.2, 0.35, 0.9), (-0.3, -0.8, 0.4), "wrapped"),
        HandPose((-0.04, -0.06, 0.42), (-0.5, 0.5, 0.7), (-0.3, -0.6, 0.6), "fist"),
        Strokes("swing", 1.6, 3.0),
        apart=0.5,
        seated=1.0,
    ),
    "pull rope": PairGesture(
        ("pull a rope", "haul in a rope", "tug at a rope", "draw a rope towards the body"),
        HandPose((-0.1, -0.02, 0.44), (-0.2, 0.3, 0.9), (-0.8, -0.3, 0.2), "open"),
        HandPose((-0.1, -0.24, 0.24), (-0.25, 0.35, 0.9), (-0.9, -0.3, 0.2), "fist"),
        Strokes("swing", 0.9, 1.6),
        apart=0.5,
        seated=0.1,
    ),
    "talk": PairGesture(
        ("gesture in a conversation", "accompany a speech", "underline the words", "explain"),
        HandPose((0.0, -0.3, 0.27), (-0.35, 0.2, 1.0), (-0.9, 0.3, 0.0), "relaxed"),
        HandPose((0.14, -0.33, 0.34), (0.1, 0.05, 1.0), (-0.4, 0.9, 0.0), "open"),
        Strokes("swing", 0.8, 1.6),
    ),
}
"""What both hands do together."""
