"""Noise on test clips: the paper's noise of each data set, and the other kinds.

The paper adds noise to MANO's translation, rotation and pose, and its text does not say in which
parameters the pose is. Ours is in the coefficients of the first 24 pose components, as in the
released code for GRAB; that for ARCTIC has poses of 45 angles. The noise depends only on the seed,
the data set, the clip and the kind, so that order, limits and worker processes do not change it.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Literal

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.choices import CaseNoise, Dataset, Side
from geneoh.errors import ConfigError, MissingAssetError
from geneoh.evaluation.options import ProtocolOptions
from geneoh.hand.mano import mano_folder
from geneoh.readers.mano import read_mano
from geneoh.seeds import seeded_generator
from geneoh.sequence.noise import Sizes, corrupt_sequence, draw_beta, perturbed
from geneoh.sequence.object_noise import corrupt_object
from geneoh.sequence.sequence import Sequence

COMPONENTS = 24  # number of pose components of GRAB's hands in the released code
Law = Literal["gauss", "beta"]  # distribution: standard normal, or Beta(8, 2)


@dataclass(frozen=True)
class PaperNoise:
    """Noise that is independent in every frame and parameter."""

    law: Law
    sizes: Sizes  # factors of the draws; on pose components, `fingers` has no unit
    translation_law: Law | None = None  # distribution of the translation noise, if it differs


PAPER: dict[tuple[Dataset, str], PaperNoise] = {
    ("grab", "paper"): PaperNoise("gauss", Sizes(0.01, 0.1, 0.5)),
    ("grab-beta", "paper"): PaperNoise("beta", Sizes(0.01, 0.05, 0.3)),
    ("arctic", "paper"): PaperNoise("gauss", Sizes(0.01, 0.05, 0.3)),
    ("grab", "code"): PaperNoise("gauss", Sizes(0.01, 0.05, 0.4)),
    ("grab-beta", "code"): PaperNoise("beta", Sizes(0.01, 0.05, 0.4), translation_law="gauss"),
    ("arctic", "code"): PaperNoise("gauss", Sizes(0.001, 0.05, 0.3)),
}
"""Noise by data set and origin: C.1 of the paper, or the data loaders of the released code."""


def check_noise(dataset: Dataset, noise: CaseNoise, options: ProtocolOptions) -> None:
    """Raise `ConfigError` or `MissingAssetError` for a noise that cannot be drawn."""
    if noise != "paper":
        return
    if (dataset, options.noise_sizes) not in PAPER:
        known = ", ".join(dict.fromkeys(name for name, _ in PAPER))
        raise ConfigError(
            f"{dataset}: the noise 'paper' is that of {known}, and the paper puts none on "
            f"{dataset}; choose another noise"
        )
    if options.finger_noise == "components" and mano_folder(options.mano_dir) is None:
        raise MissingAssetError(
            f"{dataset}: expected the folder of MANO_RIGHT.pkl and MANO_LEFT.pkl, on whose pose "
            "components this noise is drawn, got none; register at https://mano.is.tue.mpg.de"
            ", download the models, and name their folder with --mano or GENEOH_MANO_DIR"
        )


def refuse_idle_settings(
    noises: Iterable[CaseNoise], options: ProtocolOptions, *, stored: bool = False
) -> None:
    """Refuse settings of noise that is not drawn: they would be ignored. With `stored`, none is."""
    plain, names = ProtocolOptions(), ("noise_sizes", "finger_noise")
    why = "without --noise paper, which alone depends on it"
    if stored:
        names, why = (*names, "object_noise"), "with --twins, whose clips have their noise"
    elif "paper" in noises:
        return
    for name in names:
        if (value := getattr(options, name)) != getattr(plain, name):
            raise ConfigError(f"--set {name}: expected none {why}, got {value}; leave it out")


def noisy_input(
    clean: Sequence,
    dataset: Dataset,
    clip: str,
    noise: CaseNoise,
    seed: int,
    options: ProtocolOptions,
) -> Sequence:
    """The noisy clip, the input of every method; deterministic in the arguments."""
    if (object_noise := options.object_noise) is not None:
        generator = seeded_generator(object_noise, seed, dataset, clip)
        clean = corrupt_object(clean, object_noise, generator=generator)
    if noise in ("clean", "recorded"):
        return clean
    generator = seeded_generator("case", seed, dataset, clip, noise)
    if noise != "paper":
        return corrupt_sequence(clean, noise, generator=generator)
    chosen = PAPER[dataset, options.noise_sizes]
    hands = []
    for hand in clean.hands:
        offsets = draw_paper_noise(chosen, hand.frames, hand.side, options, generator)
        hands.append(perturbed(hand, offsets, torch.ones_like(hand.valid)))
    source = f"the {options.noise_sizes}'s noise of {dataset}, seed {seed}, on {clean.source}"
    return replace(clean, hands=tuple(hands), source=source)


def draw_paper_noise(
    noise: PaperNoise, frames: int, side: Side, options: ProtocolOptions, generator: torch.Generator
) -> Float[Tensor, "T 51"]:
    """Noise on translation (metres), global rotation and 45 finger angles (radians)."""
    by_components = options.finger_noise == "components"
    fingers = COMPONENTS if by_components else 45

    def draw(law: Law, count: int) -> Float[Tensor, "T C"]:
        if law == "gauss":
            return torch.randn(frames, count, generator=generator)
        return draw_beta((frames, count), generator=generator)

    shift = noise.sizes.translation * draw(noise.translation_law or noise.law, 3)
    turn = noise.sizes.orientation * draw(noise.law, 3)
    bend = noise.sizes.fingers * draw(noise.law, fingers)
    if by_components:
        folder = mano_folder(options.mano_dir)
        assert folder is not None, "checked before any clip was read"
        rows = read_mano(folder, side).components[:COMPONENTS]
        bend = bend @ torch.from_numpy(rows).float()
    return torch.cat([shift, turn, bend], dim=-1)
