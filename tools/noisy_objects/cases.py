"""One case: a clip with a noisy hand and a noisy object, cleaned and measured.

Rows are appended to a file as soon as they are measured, one JSON object a line, and those that
stand there already are not measured again: a run that was stopped goes on where it was.
"""

import json
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.baselines.filters import TUNED, filtered
from geneoh.choices import PresetName
from geneoh.objects.cleaning import clean_object
from geneoh.objects.palms import palm_of
from geneoh.objects.symmetry import Symmetry
from geneoh.pipeline.denoise import denoise
from geneoh.pipeline.options import Options
from geneoh.sequence.gaps import fill_gaps
from geneoh.sequence.sequence import ObjectTrack, Sequence
from tools.noisy_objects.clips import (
    HandNoise,
    ObjectKind,
    clip_of,
    symmetry_of,
    with_noisy_hand,
    with_noisy_object,
)

Scores = dict[str, float]


@dataclass(frozen=True)
class Case:
    """What is cleaned, and how."""

    clip: str
    noise: HandNoise
    kind: ObjectKind
    seed: int
    preset: PresetName = "fast"
    trusted: bool = False
    """Whether the object's poses are taken as they are."""
    alone: bool = False
    """Whether the hand is cleaned without its object."""


def measured(case: Case) -> Scores:
    """Every score of a case: errors in mm, accelerations in mm per frame squared."""
    clean, symmetry = clip_of(case.clip), symmetry_of(case.clip)
    noisy = with_noisy_hand(clean, case.noise, case.seed)
    noisy = with_noisy_object(noisy, case.kind, case.seed, symmetry)
    result = denoise(
        noisy,
        Options(
            preset=case.preset,
            seed=case.seed,
            refine_object=not (case.trusted or case.alone),
            trust_object=case.trusted,
            without=("mesh",) if case.alone else (),
        ),
    ).sequence
    hand = noisy.hands[0]
    joints = {
        "input": fill_gaps(hand).joints,
        "filter": filtered(hand, TUNED["savgol", "parameters"], "parameters", noisy.fps),
        "result": result.hands[0].joints,
    }
    scores: Scores = {}
    for name, values in joints.items():
        scores[name], scores[f"{name} acceleration"] = hand_scores(values, clean)
    if case.kind == "exact" or case.trusted:
        return scores
    return scores | object_scores(clean, noisy, result, symmetry)


def hand_scores(joints: Float[Tensor, "T 21 3"] | None, clean: Sequence) -> tuple[float, float]:
    """Mean error, and mean acceleration, of the keypoints."""
    truth = clean.hands[0].joints
    assert joints is not None, "every result has joints"
    assert truth is not None, "every clip has joints"
    lengths = [v.norm(dim=-1).mean() for v in (joints - truth, joints.diff(n=2, dim=0))]
    return 1e3 * float(lengths[0]), 1e3 * float(lengths[1])


def object_scores(clean: Sequence, noisy: Sequence, result: Sequence, symmetry: Symmetry) -> Scores:
    """Errors of the object, and of the hand in the object frame, up to symmetry of the mesh."""
    smooth, _ = clean_object(noisy.object, noisy.fps, tuple(map(palm_of, noisy.hands)))
    seen = noisy.object.valid
    lost = torch.zeros(noisy.frames, dtype=torch.bool) if seen is None else ~seen[:, 0].bool()
    scores: Scores = {}
    for name, track in (
        ("object input", noisy.object),
        ("object smooth", smooth),
        ("object refined", result.object),
    ):
        far = off(track, clean.object, symmetry)
        scores[name] = float(far[~lost].mean())
        if lost.any():
            scores[f"{name} lost"] = float(far[lost].mean())
    truth = at_object(clean, clean.object)
    for name, sequence in (("relative input", noisy), ("relative refined", result)):
        turned = turned_back(sequence.object, clean.object, symmetry)
        apart = (at_object(sequence, turned) - truth).norm(dim=-1)
        scores[name] = 1e3 * float(apart[~lost].nanmean())
    return scores


def turned_back(motion: ObjectTrack, truth: ObjectTrack, symmetry: Symmetry) -> ObjectTrack:
    """The poses, composed with the symmetry of the mesh that brings them nearest to the truth."""
    turns = motion.rotation[:, 0].double().cpu().numpy()
    wanted = truth.rotation[:, 0].double().cpu().numpy()
    onto = np.stack(
        [symmetry.nearest(a, b[None])[0][0] for a, b in zip(turns, wanted, strict=True)]
    )
    if np.allclose(onto, np.eye(3)):
        return motion
    shift = np.einsum("tij,tj->ti", turns, symmetry.center - onto @ symmetry.center)
    return replace(
        motion,
        rotation=torch.from_numpy(turns @ onto).to(motion.rotation)[:, None],
        translation=motion.translation + torch.from_numpy(shift).to(motion.translation)[:, None],
    )


def off(motion: ObjectTrack, truth: ObjectTrack, symmetry: Symmetry) -> Float[Tensor, " T"]:
    """Mean distance in mm of an object's vertices from where they truly are, up to symmetry."""
    verts = truth.meshes[0].verts
    tracks = turned_back(motion, truth, symmetry), truth
    places = [t.rotation[:, 0] @ verts.T + t.translation[:, 0, :, None] for t in tracks]
    return 1e3 * (places[0] - places[1]).norm(dim=1).mean(-1)


def at_object(sequence: Sequence, motion: ObjectTrack) -> Float[Tensor, "T 21 3"]:
    """The hand's keypoints in the frame of the object's first part."""
    joints = sequence.hands[0].joints
    assert joints is not None, "every clip has joints"
    return motion.seen_from(0, joints)


def rows(cases: Iterable[Case], path: Path) -> Iterator[tuple[Case, Scores]]:
    """Every case with its scores, measured where the file does not have it yet."""
    known = {}
    if path.exists():
        for line in path.read_text("utf-8").splitlines():
            found = json.loads(line)
            known[Case(**found["case"])] = found["scores"]
    path.parent.mkdir(parents=True, exist_ok=True)
    for case in cases:
        if case not in known:
            known[case] = measured(case)
            with path.open("a", encoding="utf-8") as file:
                file.write(json.dumps({"case": asdict(case), "scores": known[case]}) + "\n")
        yield case, known[case]
