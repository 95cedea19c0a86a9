"""Verbs for what hands do, and nouns for the objects they hold, with synonyms."""

import re

VERB_WORDS: dict[str, tuple[str, ...]] = {
    "lift": (
        *("lift", "pick up", "raise", "lift up", "take up", "hoist", "elevate", "grab", "hold up"),
    ),
    "put down": ("put down", "set down", "place", "lay down", "lower", "put back", "deposit"),
    "carry": ("carry", "move", "bring", "transport", "take", "convey", "relocate", "carry away"),
    "slide": ("slide", "push", "drag", "pull", "shove", "glide", "slide over", "push along"),
    "rotate": ("rotate", "turn", "spin", "twist", "turn around", "swivel", "revolve", "pivot"),
    "pour": ("pour from", "empty", "pour out of", "tip out", "decant", "serve from", "drain"),
    "tilt": ("tilt", "tip", "lean", "incline", "slant", "tilt over", "angle", "cant"),
    "shake": ("shake", "rattle", "jiggle", "wiggle", "shake up", "agitate", "swing", "wobble"),
    "inspect": ("inspect", "look at", "examine", "check", "study", "view", "observe", "scan"),
    "press": ("press", "push down", "press on", "tap", "touch", "press down", "poke", "squeeze"),
    "open": ("open", "open up", "uncover", "unfold", "pull open", "unclose", "unlock", "uncap"),
    "close": ("close", "shut", "fold", "close up", "push shut", "cover", "lock", "fold up"),
    "pass": ("pass", "hand over", "transfer", "pass over", "switch", "swap", "hand", "give"),
}
"""Synonyms of each verb of synthetic actions; the first one is the paper's phrasing. Data and
weights refer to verbs by their place here, so that new ones are added at the end."""

PARTICLES = frozenset({"up", "down", "over", "out", "around", "back", "open", "shut", "away"})
"""Last words of phrasal verbs that may follow the object: "pick the mug up"."""

NOUN_WORDS: dict[str, tuple[str, ...]] = {
    "apple": ("apple", "fruit"),
    "ball": ("ball", "sphere", "toy ball"),
    "bar": ("bar", "rod", "stick"),
    "block": ("block", "wooden block", "toy block"),
    "board": ("board", "panel", "tile", "slab"),
    "bottle": ("bottle", "flask", "water bottle"),
    "bowl": ("bowl", "dish", "basin"),
    "box": ("box", "case", "packet", "package"),
    "brush": ("brush", "toothbrush", "hairbrush"),
    "can": ("can", "tin", "soda can"),
    "carton": ("carton", "box", "cardboard box", "parcel"),
    "chest": ("chest", "box with a lid", "treasure chest", "lidded box"),
    "clamp": ("clamp", "clip"),
    "coin": ("coin", "token", "disc"),
    "cup": ("cup", "beaker", "mug"),
    "cylinder": ("cylinder", "can", "tube", "roll"),
    "drawer": ("drawer", "drawer unit", "cabinet"),
    "drill": ("drill", "power tool"),
    "egg": ("egg", "stone", "pebble", "lemon"),
    "figure": ("figure", "figurine", "statue", "toy"),
    "flashlight": ("flashlight", "torch", "lamp"),
    "hammer": ("hammer", "mallet"),
    "kettle": ("kettle", "teapot", "tea kettle", "jug"),
    "knife": ("knife", "kitchen knife", "blade"),
    "laptop": ("laptop", "notebook", "computer", "notebook computer"),
    "matchbox": ("matchbox", "box with a tray", "slide box"),
    "mouse": ("mouse", "computer mouse"),
    "mug": ("mug", "cup", "coffee mug"),
    "pan": ("pan", "frying pan", "saucepan", "skillet"),
    "pen": ("pen", "pencil", "marker"),
    "phone": ("phone", "smartphone", "mobile", "cellphone"),
    "plate": ("plate", "dish", "saucer"),
    "pliers": ("pliers", "tongs", "pincers"),
    "plunger": ("plunger", "coffee press", "pump"),
    "ring": ("ring", "hoop", "bracelet", "donut"),
    "scissors": ("scissors", "shears"),
    "screwdriver": ("screwdriver", "tool"),
    "shears": ("shears", "scissors", "tool"),
    "spoon": ("spoon", "tablespoon", "ladle"),
    "spray bottle": ("spray bottle", "spray", "sprayer"),
    "stick": ("stick", "rod", "candle", "tube"),
    "toy": ("toy", "object", "thing", "gadget"),
    "wine glass": ("wine glass", "glass", "goblet"),
}
"""Synonyms of each noun for a held object; a noun that is not listed has none but itself."""

PLURAL = frozenset(
    {"scissors", "shears", "pliers", "tongs", "pincers", "eyeglasses", "glasses", "binoculars"}
    | {"headphones", "grapes", "chips"}
)
"""Nouns that take no "a", and "are" in the passive."""
MASS = frozenset({"milk", "cocoa", "lotion", "ketchup", "toothpaste"})
"""Mass nouns, which take no "a" either."""

_NOUNS = {
    "bleach_cleanser": "bottle",
    "butterfinger_chocolate": "bar",
    "c_clamp": "clamp",
    "capsule": "stick",
    "cluster": "toy",
    "colored_wood_blocks": "block",
    "ellipsoid": "egg",
    "foam_brick": "block",
    "hard_drive": "hard drive",
    "lego_duplo": "block",
    "loop_tool": "shears",
    "magnifying_glass": "magnifying glass",
    "can_opener": "can opener",
    "nine_hole_peg_test": "board",
    "nintendo_3ds": "game console",
    "skillet": "pan",
    "skillet_lid": "lid",
    "spatula_with_purple_head": "spatula",
    "spray": "spray bottle",
    "toy_airplane": "toy airplane",
    "toy_school_bus": "toy bus",
    "toy_train": "toy train",
    "windex_bottle": "spray bottle",
    "wine_glass": "wine glass",
}
"""Nouns for object names whose last word is not the noun."""
_SINGULAR = {"cups": "cup", "baseball": "ball", "softball": "ball", "racquetball": "ball"}


def noun_of(name: str) -> str:
    """The noun for an object family ("wine_glass") or a scanned object ("gso_black_razer_mouse").

    For a name that is not in the table the last word is the noun, and "object" if there is none.
    """
    words = words_of_name(name)
    last = words[-1] if words else "object"
    return _NOUNS.get("_".join(words)) or _SINGULAR.get(last, last)


def words_of_name(name: str) -> list[str]:
    """The words of an object's name without its source and numbers."""
    plain = re.sub(r"^(gso|ycb)_", "", name.lower())
    plain = re.sub(r"^\d+(-[a-z])?_", "", plain)
    return [word for word in plain.split("_") if word.strip("0123456789")]


def with_article(noun: str) -> str:
    """ "a mug", "an apple", "scissors", "milk"."""
    if noun.split()[-1] in PLURAL | MASS:
        return noun
    return f"{'an' if noun[0] in 'aeiou' else 'a'} {noun}"
