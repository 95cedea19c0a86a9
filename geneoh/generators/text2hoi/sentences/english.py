"""English words beyond those of synthetic actions: other verbs, everyday things, small words."""


def _words(text: str) -> tuple[str, ...]:
    return tuple(text.split())


OTHER_VERBS: dict[str, tuple[str, ...]] = {
    "use": ("lift", "use", "operate", "handle", "work with"),
    "drink": ("tilt", "drink from", "sip from", "drink"),
    "eat": ("lift", "eat", "bite", "taste"),
    "throw": ("lift", "throw", "toss", "fling", "hurl", "juggle"),
    "hold": ("lift", "hold", "grasp", "grip", "keep", "seize", "catch", "pinch"),
    "write": ("slide", "write with", "draw with", "sketch with"),
    "wipe": ("slide", "wipe", "clean", "scrub", "polish", "dust", "rub"),
    "brush": ("slide", "brush", "sweep", "comb with", "paint with"),
    "cut": ("close", "cut with", "chop with", "slice with", "clip with"),
    "hit": ("press", "hit", "knock", "strike", "beat", "pound", "hammer"),
    "click": ("press", "click", "type on", "type", "switch on", "switch off", "dial"),
    "staple": ("press", "staple with", "stamp with", "stamp", "punch"),
    "spray": ("press", "spray with", "spray", "squirt"),
    "stir": ("rotate", "stir with", "stir", "whisk with", "mix with"),
    "screw": ("rotate", "screw", "unscrew", "tighten", "loosen", "wind", "crank", "roll"),
    "flip": ("rotate", "flip", "turn over", "flip over", "invert", "reverse"),
    "wave": ("shake", "wave", "brandish", "waggle", "flap"),
    "fly": ("carry", "fly", "steer", "drive"),
    "wear": ("lift", "wear", "put on", "try on", "don"),
    "read": ("inspect", "read", "browse", "leaf through", "watch"),
    "call": ("lift", "call with", "phone with", "listen to", "answer"),
    "photograph": ("inspect", "photograph with", "take a picture with", "film with"),
    "peel": ("rotate", "peel", "unwrap", "scrape"),
    "cook": ("carry", "cook with", "fry with", "heat"),
    "toast": ("lift", "toast with", "cheer with", "clink"),
    "play": ("shake", "play", "play with", "toy with"),
    "take out": ("lift", "take out", "remove", "draw out", "extract", "fetch"),
    "put in": ("put down", "put in", "insert", "store", "load", "put away", "drop"),
    "plug": ("slide", "plug in", "attach", "connect", "mount", "fix"),
    "stack": ("put down", "stack", "pile", "arrange", "line up", "position"),
    "stretch": ("open", "stretch", "spread", "extend", "expand", "split"),
    "crush": ("press", "crush", "compress", "crumple", "flatten", "knead"),
    "stroke": ("slide", "stroke", "pet", "caress", "smooth"),
    "hang": ("put down", "hang", "hang up", "suspend"),
    "weigh": ("inspect", "weigh", "measure", "compare", "feel", "show", "present"),
}
"""Verbs without synthetic actions: for each the nearest verb that has some, then its synonyms."""

READ_AS: dict[str, tuple[str, ...]] = {
    "open": ("reopen", "unlatch", "unfasten", "unseal", "unzip"),
    "close": ("reclose", "reseal", "seal", "latch", "fasten", "zip", "zip up"),
    "lift": ("pluck", "heft", "pull up", "scoop up", "snatch up"),
    "put down": ("return", "replace", "release", "park", "drop off", "stand up"),
    "slide": ("nudge", "tug", "yank", "shuffle", "smear"),
    "carry": ("shift", "reposition", "haul", "lug", "deliver"),
    "rotate": ("adjust", "align", "straighten", "tune", "wring"),
    "tilt": ("dip", "tip over"),
    "pour": ("dump", "spill", "sprinkle", "water with"),
    "shake": ("jostle", "jingle", "swish", "ring"),
    "inspect": ("admire", "look into", "look inside", "look through", "peer into", "gaze at"),
    "press": ("pat", "prod", "jab", "pump", "push in"),
    "pass": ("offer", "exchange"),
    "hold": ("clutch", "cradle", "balance", "steady", "wield", "aim", "point", "snatch"),
    "write": ("sign with", "paint", "sew with", "trace with"),
    "wipe": ("erase", "mop", "shave with", "iron with", "sand", "rinse", "wash", "dry"),
    "brush": ("rake",),
    "hit": ("swat", "smack", "slap", "whack", "bang", "chop"),
    "stroke": ("scratch with", "scratch", "swipe"),
    "stir": ("swirl",),
    "stack": ("sort", "count out"),
    "peel": ("sharpen", "grate", "grind", "tear", "rip", "bend", "break", "crack", "tie", "wrap"),
    "cook": ("scoop with", "scoop", "ladle", "ladle with"),
    "play": ("strum",),
}
"""More words for verbs of both kinds, which no training sentence has: sentences are read with them
alone, so that the text encoder's data stay those that it was trained on."""

THINGS = _words("""
    airplane alarm ant anvil apple arrow axe bag bagel balloon banana banknote basket bat
    battery bear bell belt bicycle binoculars bird biscuit blender book boot brick broom
    bucket bulb bun bunny button cabbage cactus cake calculator calendar camera candle
    candy car card carrot cat chain chair chalk cheese cherry clock cloth clothes coffee
    coat comb compass cookie cork corn cow crayon cream crown cube cucumber cushion dice
    dictionary doll donkey donut door doorknob dough drum duck dustpan eggplant elephant
    envelope eraser espresso faucet feather file fish flower flute folder fork frame
    frisbee frog funnel glass glasses glove glue grape grapes grater guitar handle hanger
    hat headphones helmet horn horse hose iron jar jelly jug juice kit kiwi knob ladder
    lamp lantern leaf lemon letter lid lighter lock lotion magazine magnet mango map mask
    mat match medal melon microphone microscope microwave milk mirror mixer money monitor
    monkey mushroom nail napkin needle newspaper nut olive onion oven paddle pan paper
    peach peanut pear pepper perfume photo piano picture pig pillow pin pineapple pipe
    pizza plant plug pot potato printer purse puzzle pyramid rabbit racket radio rag rake
    razor remote ribbon robot rock rope rubber rug ruler salad salt sandwich saw scale
    scanner scarf scoop screw seed shampoo shell shirt shoe shovel sieve sign skateboard
    soap sock soda sponge stamp stapler stick stone stove straw string suitcase syringe
    table tape tea teapot telescope tent thermos thread ticket tie tin tissue toast
    toaster tomato tool toothpaste torus towel toy tray trophy trumpet turtle tube
    umbrella vase vacuum violin waffle waffleiron wallet watch watermelon wheel whistle
    wire wrench xylophone yarn yogurt zipper capsule machine ketchup espressomachine phone
    box notebook knife alarmclock flashlight train
""")
"""Nouns of everyday things, so that words outside the synthetic actions are known as well."""

SMALL_WORDS = frozenset(
    _words("""
    a an the this that these those my your his her its our their one one's with without
    using by from of to in into on onto off out over under up down at and or then while
    for is are be was being gets please can could you i we he she they it someone somebody
    person man woman user both two hands hand left right hander handed other fingers thumb
    palm table desk air place slowly carefully quickly gently firmly briefly once again
    twice all some around along across away back forward through toward towards side sides
    top bottom front
    """)
)
"""Words that hold an English sentence together."""
