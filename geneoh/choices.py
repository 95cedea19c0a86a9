"""The choices that options offer, each written once.

This module imports no torch, so that `geneoh --help` can show the choices at once.
"""

from typing import Literal, get_args

Side = Literal["left", "right"]
SIDES: tuple[Side, ...] = get_args(Side)
OTHER_SIDE: dict[Side, Side] = {"left": "right", "right": "left"}

HandsName = Literal["left hand", "right hand", "both hands"]  # hands that a sentence asks for
HANDS: tuple[HandsName, ...] = get_args(HandsName)
TAKING_PART: dict[HandsName, tuple[bool, bool]] = {
    "left hand": (True, False),
    "right hand": (False, True),
    "both hands": (True, True),
}
"""Whether the left hand takes part, and whether the right one."""

Unit = Literal["mm", "cm", "m"]
"""Units of length that a file may be in; everything in memory is in metres."""
UNITS: tuple[Unit, ...] = get_args(Unit)

HandSource = Literal["embedded", "mano", "mano-as-shipped"]
"""Where a hand model comes from; see `geneoh.hand.library.load_hand`."""
HAND_SOURCES: tuple[HandSource, ...] = get_args(HandSource)
RESULT_HANDS: tuple[HandSource, ...] = ("embedded", "mano")
"""Hand models that a user can choose for a result."""

PresetName = Literal["default", "paper", "fast"]
PRESETS: tuple[PresetName, ...] = get_args(PresetName)

Selection = Literal["closest", "mean"]
"""Which sample becomes the result: the one closest to the input, or the mean of all samples."""
SELECTIONS: tuple[Selection, ...] = get_args(Selection)

Ablation = Literal[
    "motion",
    "spatial",
    "temporal",
    "sliding",
    "canonical",
    "diffusion",
    "fit",
    "object",
    "mesh",
    "camera",
    "told-camera",
]
"""Parts that an ablation leaves out, with the same weights.

"motion", "spatial", "temporal": one stage. "sliding": SpatialDiff does not use sliding of the hand
over its object as evidence of errors, lasting or drifting. "canonical": the canonical frame stands
still in the world instead of moving with the object. "diffusion": each stage
calls its denoiser once instead of running a diffusion chain. "fit": the hand fit sees keypoints
only, neither the object nor time. "object": the poses of the object are taken as they are, neither
examined nor cleaned. "mesh": the hand is cleaned by the motion prior alone, as if it had no object.
"camera": the viewing ray is neither passed nor estimated. "told-camera": it is not passed, but may
be estimated from the noise.
"""
ABLATIONS: tuple[Ablation, ...] = get_args(Ablation)

BaselineName = Literal["toch", "regression"]
FilterKind = Literal["savgol", "gaussian", "one-euro"]
"""Low-pass filters; see `geneoh.baselines.filters`."""
MethodName = Literal[
    "input",
    FilterKind,
    "centroid",
    "best-filter",
    "best-offset",
    "optimisation",
    BaselineName,
    "one-call",
    "geneoh",
]
"""Methods that `geneoh eval` compares, besides users' own predictions."""
METHODS: tuple[MethodName, ...] = get_args(MethodName)
ON_REQUEST: tuple[MethodName, ...] = ("gaussian", "one-euro")
"""Methods that are not compared by default: they are among the candidates of best-filter."""

Dataset = Literal["synthetic", "taco", "grab", "grab-beta", "hoi4d", "arctic"]
"""Evaluation protocols, named by the data set that they score on."""
DATASETS: tuple[Dataset, ...] = get_args(Dataset)

AnnotatedSource = Literal["h2o", "grab", "arctic"]
"""Data sets whose recordings come with labels of actions."""
ANNOTATED: tuple[AnnotatedSource, ...] = get_args(AnnotatedSource)

ActionDataset = Literal["synthetic", AnnotatedSource]
"""Sources of the actions on which a generator of interactions is scored."""
ACTION_DATASETS: tuple[ActionDataset, ...] = get_args(ActionDataset)

GeneratorName = Literal["text2hoi", "both2hands"]  # generators that `geneoh eval` scores
GENERATORS: tuple[GeneratorName, ...] = get_args(GeneratorName)

StageName = Literal[
    "motion", "spatial", "temporal", "trajectory", "relations", "latent", "toch", "regression"
]
"""Networks that `geneoh train` trains: the three stages; "trajectory", "relations" and "latent",
which are MotionDiff, SpatialDiff and TemporalDiff in the form of the paper; and the baselines
"toch" and "regression"."""
STAGES: tuple[StageName, ...] = get_args(StageName)

ActionStage = Literal["contact", "interaction", "refiner"]
"""Networks of the generator Text2HOI that learn from actions."""
ACTION_STAGES: tuple[ActionStage, ...] = get_args(ActionStage)
GeneratorStage = Literal["text", "length", ActionStage]
"""Networks of the generator Text2HOI that `geneoh train` trains."""
GENERATOR_STAGES: tuple[GeneratorStage, ...] = get_args(GeneratorStage)
BodyStage = Literal["body_hands", "text_hands", "blend"]
"""Networks of the generator BOTH2Hands that `geneoh train` trains."""
BODY_STAGES: tuple[BodyStage, ...] = get_args(BodyStage)
BodySource = Literal["both57m", "motionx", "amass"]
"""Data sets of recorded bodies with fingers that the BOTH2Hands networks learn from."""
BODY_SOURCES: tuple[BodySource, ...] = get_args(BodySource)

Noise = Literal["gauss", "gauss_strong", "beta", "bias", "drift", "burst", "drop", "camera"]
"""Kinds of noise that `geneoh corrupt` adds; `geneoh.sequence.noise` defines each."""
NOISES: tuple[Noise, ...] = get_args(Noise)

ObjectNoise = Literal["shaky_2", "shaky_10", "flips", "lost"]
"""Noise on the poses of an object; see `geneoh.sequence.object_noise`."""
OBJECT_NOISES: tuple[ObjectNoise, ...] = get_args(ObjectNoise)

CaseNoise = Literal[Noise, "paper", "recorded", "clean"]
"""Noise on the clips of an evaluation: a `Noise`; "paper", the one that the paper defines for a
data set; "recorded", none, because the recording itself is noisy and has no ground truth; or
"clean", none, with the recording as the ground truth."""
CASE_NOISES: tuple[CaseNoise, ...] = get_args(CaseNoise)

JointOrder = Literal["openpose", "mano", "mano16", "fphab", "aria", "webxr", "openxr"]
"""Orders of the keypoints of one hand; see `geneoh.readers.joint_orders`."""
JOINT_ORDERS: tuple[JointOrder, ...] = get_args(JointOrder)

Translation = Literal["wrist", "origin"]
"""The point that the translation of MANO parameters places: the wrist joint (convention W), or the
origin of the model (convention O). See the page on conventions."""
TRANSLATIONS: tuple[Translation, ...] = get_args(Translation)

PoseFrame = Literal["world", "camera"]
"""The frame that a caller's poses of an object lead to: the hands' world, or the camera's frame at
each time."""
POSE_FRAMES: tuple[PoseFrame, ...] = get_args(PoseFrame)

OF_SOURCES = (
    *("objects", "body", "object_pose_frame", "translation", "swap_parts", "mean_pose", "focal"),
    "image_size",
)
"""Reading options that apply only where the source of a file is named."""

Colouring = Literal["penetration", "contact", "spread", "plain"]
"""The quantity that the colour of a hand shows in pictures and films."""
COLOURINGS: tuple[Colouring, ...] = get_args(Colouring)
STRIP_CELL = 260  # side of one picture in a filmstrip, pixels
CELL_LIMITS = (64, 2048)  # the least and the largest one

Refiner = Literal["geneoh", "paper", "none"]
"""Refinement of the hands of a generated interaction: by the cleaner of `geneoh denoise`, by the
refiner of Text2HOI, or none."""
REFINERS: tuple[Refiner, ...] = get_args(Refiner)

SEED_LIMITS = (0, 2**63 - 1)  # the least and the largest seed of random draws

CLEANING: dict[str, tuple[int, int]] = {
    "seed": SEED_LIMITS,
    "hand_delay": (-1_000_000, 1_000_000),
}
"""The least and the largest value of each number that `geneoh denoise` takes; 1 and more for whole
numbers that are not listed."""

GENERATION: dict[str, tuple[int, int]] = {
    "frames": (2, 150),  # as many as the longest clips that networks learn from
    "steps": (1, 1000),  # as many as there are noise levels
    "guidance": (0, 10),
    "draws": (1, 64),
    "seed": SEED_LIMITS,
}
"""The least and the largest value of each number that `geneoh generate` takes."""
STEPS, GUIDANCE, DRAWS = 12, 2.0, 8
"""Default denoising steps (also for bodies), guidance and number of draws of `geneoh generate`."""

Axis = Literal["x", "y", "z", "-x", "-y", "-z"]
AXES: tuple[Axis, ...] = get_args(Axis)  # signed axes of the world, to say which one points up
