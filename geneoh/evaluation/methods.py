"""The rows of an evaluation's table: every way of cleaning, ours among them, as one small object.

A row is a frozen value that can be sent to another process. It sees the noisy clip alone; the one
that looks at the ground truth says so in its name.
"""

from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Protocol, runtime_checkable

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from geneoh.baselines.filters import TUNED, FilterKind, On, best_filtered, filtered, usable_on
from geneoh.baselines.library import Baseline, load_baseline
from geneoh.choices import BaselineName, HandSource
from geneoh.errors import InputError, MissingAssetError
from geneoh.evaluation.answers import answer
from geneoh.evaluation.cases import Case
from geneoh.evaluation.external_results import stored_name
from geneoh.fitting.fit import FitConfig, fit_hand, start_from_keypoints
from geneoh.hand.library import hand_of_betas, load_hand
from geneoh.pipeline.denoise import NEAR, Denoised, Options, denoise
from geneoh.pipeline.subject import subject_of
from geneoh.readers.npz_files import load_sequence
from geneoh.sequence.gaps import fill_gaps
from geneoh.sequence.sequence import Sequence

FILTER_NAMES: dict[FilterKind, str] = {
    "savgol": "Savitzky-Golay",
    "gaussian": "Gaussian",
    "one-euro": "One-Euro",
}
BASELINE_NAMES: dict[BaselineName, str] = {
    "toch": "TOCH-style autoencoder",
    "regression": "w/o diffusion (regression)",
}


@dataclass(frozen=True)
class Cleaned:
    """What a row makes of a clip's hand, world frame."""

    joints: Float[Tensor, "T 21 3"]
    verts: Float[Tensor, "T V 3"] | None
    """Of the hand by which rows are judged; None where the row knows keypoints alone: that hand is
    fitted to them."""
    valid: Bool[Tensor, " T"]
    """Frames that are scored."""
    result: Denoised | None = None
    """Our own rows': all that the cleaner has to tell."""

    @property
    def spread(self) -> Float[Tensor, "T 21"] | None:
        """Expected error of the keypoints (`HandTrack.joint_spread`), metres, where it is known."""
        return None if self.result is None else self.result.sequence.hands[0].joint_spread


@runtime_checkable
class Row(Protocol):
    """A way of cleaning."""

    @property
    def name(self) -> str:
        """What the row is called in every table."""
        ...

    def clean(self, case: Case) -> Cleaned | None:
        """The cleaned hand; None where the clip has not what the row needs."""
        ...


@dataclass(frozen=True)
class InputRow:
    """The noisy clip as it is; only its observed frames are scored."""

    name: str = "input"

    def clean(self, case: Case) -> Cleaned:
        """Nothing is done."""
        hand = case.noisy.hands[0]
        return Cleaned(joints_of(case.noisy), None, hand.valid)


@dataclass(frozen=True)
class FilterRow:
    """A filter of the size that was tuned on validation clips."""

    kind: FilterKind
    on: On

    @property
    def name(self) -> str:
        """Filter, and what it runs on."""
        return f"{FILTER_NAMES[self.kind]} on {self.on}"

    def clean(self, case: Case) -> Cleaned | None:
        """The filtered track."""
        hand = case.noisy.hands[0]
        if self.on not in usable_on(hand):
            return None
        joints = filtered(hand, TUNED[self.kind, self.on], self.on, case.noisy.fps)
        return everywhere(joints)


@dataclass(frozen=True)
class BestFilterRow:
    """The generous baseline: of all filters and sizes the best on this very clip."""

    on: On

    @property
    def name(self) -> str:
        """What it runs on, and that it sees what no user has."""
        return f"best filter on {self.on}, told the truth †"

    def clean(self, case: Case) -> Cleaned | None:
        """The filtered track nearest to the ground truth."""
        hand = case.noisy.hands[0]
        if case.clean is None or self.on not in usable_on(hand):
            return None
        return everywhere(best_filtered(hand, joints_of(case.clean), self.on, case.noisy.fps)[1])


@dataclass(frozen=True)
class OptimisedRow:
    """No learning: a tuned filter, then our fit with its terms for contact, depth and calm."""

    source: HandSource = "embedded"
    mano_dir: Path | None = None
    name: str = "optimisation only"

    def clean(self, case: Case) -> Cleaned:
        """The fitted hand."""
        hand, moving = case.noisy.hands[0], case.noisy.object
        on = usable_on(hand)[-1]
        target = filtered(hand, TUNED["savgol", on], on, case.noisy.fps)[None]
        model = load_hand(hand.side, source=self.source, mano_dir=self.mano_dir)
        subject = subject_of(hand, model)
        start = subject.start or start_from_keypoints(target, subject.shaped)
        state = fit_hand(
            target,
            torch.ones_like(target[..., 0]),
            subject.shaped,
            start,
            config=FitConfig(),
            surface=replace(moving.surface(), within=NEAR),
        )
        posed = subject.shaped.verts_from_rotations(state.rotations, state.wrist)
        return everywhere(posed.joints[0], posed.verts[0])


@dataclass(frozen=True)
class BaselineRow:
    """A network that answers at once, trained on the cleaner's own data."""

    baseline: BaselineName
    weights: Path | None = None

    @property
    def name(self) -> str:
        """What the field calls it."""
        return BASELINE_NAMES[self.baseline]

    def clean(self, case: Case) -> Cleaned:
        """The network's keypoints."""
        network = network_of(self.baseline, self.weights)
        return everywhere(answer(network, case.noisy, seed=case.seed))


@cache
def network_of(name: BaselineName, weights: Path | None) -> Baseline:
    """The network, read once in a process."""
    return load_baseline(name, weights)


@dataclass(frozen=True)
class GeneohRow:
    """The cleaner, by its options; the seed is the case's."""

    options: Options

    @property
    def name(self) -> str:
        """Preset, and what was left out of it."""
        less = "".join(f", w/o {part}" for part in self.options.without)
        return f"geneoh {self.options.preset}{less}"

    def clean(self, case: Case) -> Cleaned:
        """The cleaned track with its own mesh."""
        result = denoise(case.noisy, replace(self.options, seed=case.seed))
        hand = result.sequence.hands[0]
        assert hand.pose is not None, "results carry a pose"
        assert hand.wrist is not None, "results carry a wrist"
        assert hand.betas is not None, "results carry betas"
        model = hand_of_betas(hand.side, hand.hand_model, mano_dir=self.options.mano_dir)
        verts = model.shaped(hand.betas).posed(hand.pose, hand.wrist).verts
        return replace(everywhere(joints_of(result.sequence), verts), result=result)


@dataclass(frozen=True)
class PredictionsRow:
    """Somebody else's results: one npz per case in a folder, see `stored_name`."""

    folder: Path

    @property
    def name(self) -> str:
        """The folder's."""
        return self.folder.resolve().name

    def clean(self, case: Case) -> Cleaned:
        """The stored hand's keypoints; the mesh is ours, as for every row of keypoints.

        Raises:
            MissingAssetError: there is no file for the case.
            InputError: it does not fit the clip.
        """
        path = self.folder / stored_name(case.clip, case.noise, case.seed)
        if not path.is_file():
            raise MissingAssetError(
                f"{path}: expected the result for {case.clip} under {case.noise}, seed "
                f"{case.seed}, found no file; --inputs writes what it is to be made from"
            )
        side = case.noisy.hands[0].side
        sequence = load_sequence(path, case.noisy.object.meshes, side=side)
        if sequence.frames != case.noisy.frames:
            raise InputError(
                f"{path}: expected the clip's {case.noisy.frames} frames, got {sequence.frames}; "
                "store a result of the whole clip"
            )
        return Cleaned(joints_of(sequence), None, sequence.hands[0].valid)


def everywhere(
    joints: Float[Tensor, "T 21 3"], verts: Float[Tensor, "T V 3"] | None = None
) -> Cleaned:
    """A result that answers for every frame, observed or not."""
    return Cleaned(joints, verts, torch.ones(len(joints), dtype=torch.bool))


def joints_of(sequence: Sequence) -> Float[Tensor, "T 21 3"]:
    """Keypoints of a sequence's hand, gaps filled; our hand's where it has only a pose."""
    hand = sequence.hands[0]
    joints = fill_gaps(hand).joints
    return subject_of(hand, load_hand(hand.side)).joints if joints is None else joints
