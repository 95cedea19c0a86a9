"""The choices that options offer, each named once; the command line reads them without torch."""

from typing import Literal, get_args

Side = Literal["left", "right"]
SIDES: tuple[Side, ...] = get_args(Side)

HandSource = Literal["embedded", "mano", "mano-as-shipped"]
"""Where a hand model comes from; see `geneoh.hand.library.load_hand`."""

PresetName = Literal["default", "paper", "fast"]
PRESETS: tuple[PresetName, ...] = get_args(PresetName)

Selection = Literal["closest", "mean"]
"""Which sample is kept: the one closest to the input, or the mean of all."""
SELECTIONS: tuple[Selection, ...] = get_args(Selection)

Ablation = Literal["motion", "spatial", "temporal", "canonical", "diffusion", "fit"]
"""What can be left out, with the same weights: a stage; the canonical frame, for one that stands
still in the world; the diffusion, for one denoiser call a stage; the fit's knowledge of the object
and of time, for one on keypoints alone."""
ABLATIONS: tuple[Ablation, ...] = get_args(Ablation)

BaselineName = Literal["toch", "regression"]
FilterName = Literal["savgol", "gaussian", "one-euro", "best-filter"]
MethodName = Literal["input", FilterName, "optimisation", "toch", "regression", "geneoh"]
"""Ways of cleaning that `geneoh eval` compares."""
METHODS: tuple[MethodName, ...] = get_args(MethodName)

Dataset = Literal["synthetic", "taco", "grab", "grab-beta", "hoi4d", "arctic"]
"""Evaluation protocols by the data set that they score on."""
DATASETS: tuple[Dataset, ...] = get_args(Dataset)

StageName = Literal["motion", "spatial", "temporal", "trajectory", "toch", "regression"]
"""Networks that can be trained: the three stages, MotionDiff as the paper has it, two baselines."""
STAGES: tuple[StageName, ...] = get_args(StageName)

Noise = Literal["gauss", "gauss_strong", "beta", "bias", "drift", "burst", "drop"]
NOISES: tuple[Noise, ...] = get_args(Noise)

CaseNoise = Literal[Noise, "paper", "recorded", "clean"]
"""A noise of `geneoh corrupt`; the one that the paper puts on a data set; the recording itself as
the noisy input, without ground truth; or the recording as input and as ground truth."""
CASE_NOISES: tuple[CaseNoise, ...] = get_args(CaseNoise)

JointOrder = Literal["openpose", "mano", "fphab", "aria", "webxr", "openxr"]
"""Orders of 21 or more keypoints; see `geneoh.readers.joint_orders`."""
JOINT_ORDERS: tuple[JointOrder, ...] = get_args(JointOrder)

Translation = Literal["wrist", "origin"]
"""What the translation of MANO parameters moves: the wrist joint, or the origin of the model."""
TRANSLATIONS: tuple[Translation, ...] = get_args(Translation)

Colouring = Literal["penetration", "contact", "spread", "plain"]
"""What the colour of a hand shows in pictures, films and pages."""
COLOURINGS: tuple[Colouring, ...] = get_args(Colouring)
