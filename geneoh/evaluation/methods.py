"""The methods that an evaluation compares: geneoh, ablations, baselines and filters.

A method uses only the noisy clip; those that also use the ground truth are marked in their name.
"""

import logging
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import torch
from jaxtyping import Float
from torch import Tensor
from typing_extensions import assert_never

from geneoh.baselines import filters, networks
from geneoh.choices import (
    METHODS,
    ON_REQUEST,
    Ablation,
    BaselineName,
    FilterKind,
    HandSource,
    MethodName,
)
from geneoh.errors import ConfigError, InputError, MissingAssetError
from geneoh.evaluation.cases import Case, check_folder
from geneoh.evaluation.options import EvaluationOptions
from geneoh.fitting.fit import fit_hand, start_from_keypoints
from geneoh.fitting.fit_config import FitConfig
from geneoh.fitting.subject import subject_of
from geneoh.hand.library import hand_of_betas, load_hand
from geneoh.nn.weights import refuse_none_of
from geneoh.pipeline.denoise import cleaned
from geneoh.pipeline.options import NEEDED_TO_REFINE, Options
from geneoh.pipeline.results import Denoised
from geneoh.pipeline.stages.context import stage_context
from geneoh.representation.spatial import encode_spatial
from geneoh.sequence.gaps import fill_gaps
from geneoh.sequence.normalisation import normalised_hands
from geneoh.sequence.sequence import HandTrack, Sequence

LOG = logging.getLogger(__name__)

TITLES = {
    "savgol": "Savitzky-Golay",
    "gaussian": "Gaussian",
    "one-euro": "One-Euro",
    "toch": "TOCH-style autoencoder",
    "regression": "w/o diffusion (regression)",
}
"""Names of filters and baselines in the tables."""
ALL_BUT_MOTION: tuple[Ablation, ...] = ("diffusion", "spatial", "temporal", "fit")
TOLD_THE_TRUTH: tuple[MethodName, ...] = ("best-filter", "best-offset")
OURS: frozenset[MethodName] = frozenset({"one-call", "geneoh"})
DOMAINS: tuple[filters.Domain, ...] = ("keypoints", "parameters")


@dataclass(frozen=True)
class CleanedHand:
    """The result of a method for a clip's hand, world frame, metres; every frame is scored."""

    joints: Float[Tensor, "T 21 3"]
    verts: Float[Tensor, "T V 3"] | None = None  # the method's mesh; None: one is fitted to joints
    result: Denoised | None = None  # geneoh's whole result, for the page in 3D

    @property
    def spread(self) -> Float[Tensor, "T 21"] | None:
        """Expected error of the keypoints (`HandTrack.joint_spread`), metres; None if unknown."""
        return None if self.result is None else self.result.sequence.hands[0].joint_spread


@dataclass(frozen=True)
class Method:
    """A method of cleaning a hand."""

    name: str  # name of the method in every table
    clean: Callable[[Case], CleanedHand]
    """Cleans the hand of a case; `InputError` if the clip lacks a field that the method needs. It
    is picklable: a function of this module, or `functools.partial` of one."""
    has_pages: bool = False  # whether its results can be shown in 3D
    may_change: bool = False  # whether results may change between runs; then scores are not reused


def unchanged(case: Case) -> CleanedHand:
    """The noisy hand itself, with linearly interpolated gaps."""
    return CleanedHand(joints_of(case.noisy))


def filtered_hand(case: Case, kind: FilterKind, domain: filters.Domain) -> CleanedHand:
    """A low-pass filter with the size that was tuned on validation clips."""
    hand = hand_with(case, domain)
    fps = case.noisy.fps
    return CleanedHand(filters.filtered(hand, filters.tuned_at(kind, domain, fps), domain, fps))


def best_filtered_hand(case: Case, domain: filters.Domain) -> CleanedHand:
    """The filter and size with the smallest error on this clip, chosen with the ground truth."""
    truth, hand = truth_of(case), hand_with(case, domain)
    return CleanedHand(filters.best_filtered(hand, truth, domain, case.noisy.fps))


def hand_with(case: Case, domain: filters.Domain) -> HandTrack:
    """The noisy hand; `InputError` if it cannot be filtered in this domain."""
    hand = case.noisy.hands[0]
    if domain not in filters.domains_of(hand):
        raise InputError("filters on parameters need a pose, which the clips' hands do not have")
    return hand


def truth_of(case: Case) -> Float[Tensor, "T 21 3"]:
    """Keypoints of the ground truth; `InputError` if there is none."""
    if case.clean is None:
        raise InputError(f"needs the ground truth, which clips with noise {case.noise} do not have")
    return joints_of(case.clean)


def centroid_hand(case: Case) -> CleanedHand:
    """The hand moved with its smoothed centroid; see `filters.smoothed_centroid`."""
    return CleanedHand(filters.smoothed_centroid(case.noisy.hands[0], case.noisy.fps))


def best_offset_hand(case: Case) -> CleanedHand:
    """The filter and constant offset with the smallest error, chosen with the ground truth."""
    moved = filters.best_filtered_and_moved(case.noisy.hands[0], truth_of(case), case.noisy.fps)
    return CleanedHand(moved)


def optimised_hand(
    case: Case, source: HandSource = "embedded", mano_dir: Path | None = None
) -> CleanedHand:
    """Optimisation only: a tuned filter, then our fit with its contact and smoothness terms."""
    hand, motion = case.noisy.hands[0], case.noisy.object
    domain = filters.domains_of(hand)[-1]
    smoother = filters.tuned_at("savgol", domain, case.noisy.fps)
    target = filters.filtered(hand, smoother, domain, case.noisy.fps)[None]
    model = hand_of_betas(hand.side, hand.hand_model, asked=source, mano_dir=mano_dir)
    subject = subject_of(hand, model)
    state = fit_hand(
        target,
        torch.ones_like(target[..., 0]),
        subject.shaped,
        subject.start or start_from_keypoints(target, subject.shaped),
        config=FitConfig(),
        surface=motion.surface(),
    )
    posed = subject.shaped.verts_from_rotations(state.rotations, state.wrist)
    return CleanedHand(posed.joints[0], posed.verts[0])


def predicted_hand(case: Case, baseline: BaselineName, weights: Path | None = None) -> CleanedHand:
    """The prediction of a baseline network, trained on the cleaner's data, in one call."""
    network = networks.load_baseline(baseline, weights)
    return CleanedHand(predicted_joints(network, case.noisy, seed=case.seed))


@torch.no_grad()
def predicted_joints(
    network: networks.Baseline, sequence: Sequence, *, seed: int
) -> Float[Tensor, "T 21 3"]:
    """Keypoints that a baseline predicts for the first hand of a sequence, world frame, metres.

    As in the cleaner, left hands are mirrored, other frame rates resampled, and windows blended.
    `seed` seeds the sampling of points on the object's surface.
    """
    hand = normalised_hands(sequence)[0]
    subject = subject_of(hand.track, load_hand("right"))
    generator = torch.Generator().manual_seed(seed)
    context = stage_context(hand.object.surface(), subject, hand.fps, generator=generator)
    joints = subject.joints[None]
    region = context.region(joints)
    windows, trust = context.windows(joints), context.cut(context.trust, 0)
    observation = networks.Observation(region.to_canon(windows), trust)
    relations = encode_spatial(observation.joints, region)
    predicted = network.to(joints.device)(observation, relations)
    world = context.blend(region.to_world(predicted))[0]
    track = HandTrack("right", torch.ones_like(hand.track.valid), joints=world)
    back = hand.track_to_user(track).joints
    assert back is not None, "it had joints"
    return back


def denoised_hand(case: Case, options: Options) -> CleanedHand:
    """The track cleaned by geneoh with the seed of the case, and the mesh of the result."""
    result = cleaned(case.noisy, replace(options, seed=case.seed), tell=LOG.debug)
    hand = result.sequence.hands[0]
    assert hand.pose is not None, "results carry a pose"
    assert hand.wrist is not None, "results carry a wrist"
    assert hand.betas is not None, "results carry betas"
    model = hand_of_betas(hand.side, hand.hand_model, mano_dir=options.mano_dir)
    verts = model.to(hand.betas.device).shaped(hand.betas).posed(hand.pose, hand.wrist).verts
    return CleanedHand(joints_of(result.sequence), verts, result)


def stored_hand(case: Case, folder: Path) -> CleanedHand:
    """The result of another method, from a folder with one file per case (`Case.file_name`).

    Raises:
        MissingAssetError: the file is missing.
        InputError: it cannot be read, or lacks frames in which the input was observed: otherwise a
            method could leave out difficult frames.
    """
    path = folder / case.file_name
    if not path.is_file():
        raise MissingAssetError(
            f"{path}: expected the result for {case.clip.name} under {case.noise}, seed "
            f"{case.seed}, found no file; --inputs writes what it is to be made from"
        )
    sequence = case.read_stored(path)
    lost = int((case.noisy.hands[0].valid & ~sequence.hands[0].valid).sum())
    if lost:
        raise InputError(
            f"{path}: expected a hand in every frame in which the input was observed, got none in "
            f"{lost} of them by 'valid'; store a result for these frames too"
        )
    return CleanedHand(joints_of(sequence))


def joints_of(sequence: Sequence) -> Float[Tensor, "T 21 3"]:
    """Keypoints of a sequence's hand, gaps filled; computed with our hand if it has only a pose."""
    hand = sequence.hands[0]
    joints = fill_gaps(hand).joints
    return subject_of(hand, load_hand(hand.side)).joints if joints is None else joints


def methods_of(options: EvaluationOptions) -> tuple[tuple[Method, ...], tuple[str, ...]]:
    """The methods in the order of the table, and notes on default methods that are left out.

    `CheckpointError` if only baselines are to have the weights of a folder that has none of them.
    """
    methods: list[Method] = []
    notes: list[str] = []
    noises = options.noises or options.defaults.noises
    baselines = [name for name in options.methods if name in networks.BASELINES]
    if baselines and OURS.isdisjoint(options.methods):  # which need their own weights there
        refuse_none_of(baselines, options.cleaner.weights)
    for name in options.methods or METHODS:
        if name in ON_REQUEST and not options.methods:
            continue
        if name in TOLD_THE_TRUTH and not options.methods and set(noises) == {"recorded"}:
            notes.append(f"{name} is left out: it needs the ground truth, which nobody recorded")
            continue
        if name in networks.BASELINES and not options.methods:
            path = networks.baseline_weights(name, options.cleaner.weights)
            if not path.is_file():
                made_by = f"`geneoh train --stage {name}` makes them"
                notes.append(f"{name} is left out: its weights are missing; {made_by}")
                continue
        methods += methods_named(name, options)
    for folder in options.predictions:
        check_folder(folder, "--predictions")
        name, clean = folder.resolve().name, partial(stored_hand, folder=folder)
        methods.append(Method(name, clean, may_change=True))
    names = [method.name for method in methods]
    if twice := {name for name in names if names.count(name) > 1}:
        raise ConfigError(
            f"methods need names of their own, got {', '.join(sorted(twice))} more than once; drop "
            "one, or rename its folder"
        )
    return tuple(methods), tuple(notes)


def methods_named(name: MethodName, options: EvaluationOptions) -> Iterator[Method]:
    """The methods that one name of the option `methods` stands for."""
    cleaner = options.cleaner
    match name:
        case "input":
            yield Method("input", unchanged)
        case "savgol" | "gaussian" | "one-euro":
            for domain in DOMAINS:
                clean = partial(filtered_hand, kind=name, domain=domain)
                yield Method(f"{TITLES[name]} on {domain}", clean)
        case "best-filter":
            for domain in DOMAINS:
                title = f"best filter on {domain}, told the truth †"
                yield Method(title, partial(best_filtered_hand, domain=domain))
        case "centroid":
            yield Method("Gaussian on the hand's middle", centroid_hand)
        case "best-offset":
            yield Method("best filter and best offset, told the truth †", best_offset_hand)
        case "optimisation":
            clean = partial(optimised_hand, source=cleaner.hand, mano_dir=cleaner.mano_dir)
            yield Method("optimisation only", clean)
        case "toch" | "regression":
            weights = networks.baseline_weights(name, cleaner.weights).parent
            yield Method(TITLES[name], partial(predicted_hand, baseline=name, weights=weights))
        case "one-call":
            alone = replace(cleaner, preset="default", samples=1, without=ALL_BUT_MOTION)
            yield Method("MotionDiff in one call", partial(denoised_hand, options=alone))
        case "geneoh":
            for preset in options.presets:
                yield geneoh_method(replace(cleaner, preset=preset))
            for part in options.ablations:
                refine = cleaner.refine_object and part not in NEEDED_TO_REFINE
                less = replace(cleaner, without=(part,), refine_object=refine)
                yield geneoh_method(replace(less, preset=options.presets[0]))
        case _:
            assert_never(name)


def geneoh_method(options: Options) -> Method:
    """Geneoh with these options, named by its preset and the ablated part."""
    less = "".join(f", w/o {part}" for part in options.without)
    name = f"geneoh {options.preset}{less}"
    return Method(name, partial(denoised_hand, options=options), has_pages=True)
