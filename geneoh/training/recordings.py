"""Training clips cut out of recordings where the hand is near the object, as shards on disk.

Every file or folder that a reader takes as one clip becomes one shard, with a record of the files
it was made from. An interrupted run resumes after the last complete shard.
"""

import hashlib
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import ClassVar

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from geneoh.config import Limited, Limits
from geneoh.denoisers.surface_points import surface_points
from geneoh.errors import InputError
from geneoh.files.tensors import opened_tensors
from geneoh.fitting.subject import subject_of
from geneoh.geometry.distance import MovingSurface
from geneoh.geometry.mesh import Mesh
from geneoh.geometry.mesh_files import MESH_SUFFIXES
from geneoh.geometry.sampling import PartSamples, sample_surface
from geneoh.hand.library import load_hand
from geneoh.objects.camera_motion import in_steady_world
from geneoh.objects.carrying import with_held_part_first
from geneoh.progress import OnStep
from geneoh.readers.base import ReaderOptions, Recording, SourceClip, clip_name, paths_matching
from geneoh.readers.meshes import mesh_beside
from geneoh.readers.npz.files import load
from geneoh.readers.recordings import find_clips, read_clip, source_named, with_distinct_names
from geneoh.representation.region import ObjectSurface
from geneoh.seeds import seeded_generator
from geneoh.sequence.normalisation import NormalisedHand, normalised_hands
from geneoh.sequence.validation import check_sequence
from geneoh.sequence.windows import runs
from geneoh.synthesis.shapes.solids import PARTS
from geneoh.training.kept_shards import Contents, files_of_clip, kept_shards

FORMAT = 1  # of the shards; raised where the same files give other clips
SEQUENCES = "sequences"  # the source that is a folder of npz files, as `geneoh convert` writes


@dataclass(frozen=True)
class ClipConfig(Limited):
    """How clips are cut out of recordings; saved in every shard."""

    LIMITS: ClassVar[Limits] = dict.fromkeys(("shortest", "longest"), (2, Limited.LARGEST))

    shortest: int = 60  # shortest clip, frames at 30 a second: the length of a window
    longest: int = 120  # longest clip, frames; longer stretches are cut into equal clips
    points: int = 512  # surface points kept of each object
    reach: float = 0.15  # largest distance from the wrist to the object, metres


@dataclass(frozen=True)
class ClipRecord:
    """Name and origin of a clip, by which clips are split into training and validation."""

    name: str
    object: str  # fingerprint of the mesh
    person: str  # fingerprint of the betas; empty if the source has none
    length: int  # frames without the padding, which repeats the last one


@dataclass(frozen=True)
class RecordedShard:
    """What the record of a shard says of its clips."""

    clips: tuple[ClipRecord, ...]
    left_out: dict[str, int]  # numbers of unused frames, by reason


def _clips_of(source: str, path: Path) -> list[SourceClip]:
    """The clips of a source below a path; `InputError` if it does not exist or holds none."""
    if source != SEQUENCES:
        return find_clips(source_named(source), [path])
    found = [SourceClip(clip_name(file, 2), file) for file in paths_matching(path, "*.npz")]
    if not found:
        raise InputError(f"{path}: expected npz files of sequences at or below it, got none")
    return with_distinct_names(found)


def read_recordings(source: str, clip: SourceClip, options: ReaderOptions) -> list[Recording]:
    """The recordings in a clip, checked to be interactions with an object mesh."""
    if source != SEQUENCES:
        found = read_clip(source_named(source), clip, options)
        for recording in found:
            check_sequence(recording.sequence, recording.name)
        return found
    sequence = load(clip.path, mano_dir=options.mano_dir)
    if not sequence.object.meshes:
        files = clip.path.parent.iterdir()
        alone = [file for file in files if file.suffix.lower() in MESH_SUFFIXES]
        beside = mesh_beside(clip.path) or alone
        if len(beside) != 1:
            raise InputError(
                f"{clip.path}: names no mesh, expected one of its name or a single one in the same "
                f"folder, got {len(beside)} of other names; put it there, or write the sequence "
                "with its mesh"
            )
        sequence = load(clip.path, obj=beside[0], mano_dir=options.mano_dir)
    return [Recording(clip.name, sequence)]


def make_shards(
    source: str,
    path: Path,
    folder: Path,
    config: ClipConfig,
    options: ReaderOptions,
    *,
    on_step: OnStep | None = None,
) -> tuple[list[Path], list[str]]:
    """The shards of the clips of a source; results and errors are those of `kept_shards`."""
    return kept_shards(
        _clips_of(source, path),
        folder,
        {"config": asdict(config), "format": FORMAT},
        lambda clip: files_of_clip(clip, options),
        lambda clip: cut_clip(source, clip, config, options),
        on_step,
    )


def cut_clip(source: str, clip: SourceClip, config: ClipConfig, options: ReaderOptions) -> Contents:
    """What the shard of one clip of a source holds; see `RecordedShard`."""
    cuts: list[tuple[ClipRecord, dict[str, Tensor]]] = []
    left_out: Counter[str] = Counter()
    for recording in read_recordings(source, clip, options):
        parts = len(recording.sequence.object.meshes)
        if not 1 <= parts <= PARTS:
            raise InputError(
                f"{recording.name}: expected an object of 1 to {PARTS} meshes, got {parts}; "
                "leave it out, or convert it with `geneoh convert --obj` and learn from the result "
                f"as {SEQUENCES}=FOLDER"
            )
        for hand in normalised_hands(in_steady_world(recording.sequence)):
            cuts += cut_hand(recording, hand, config, left_out)
    names = cuts[0][1] if cuts else ()
    tensors = {name: torch.stack([cut[name] for _, cut in cuts]) for name in names}
    return tensors, asdict(RecordedShard(tuple(cut for cut, _ in cuts), dict(left_out)))


def cut_hand(
    recording: Recording, hand: NormalisedHand, config: ClipConfig, left_out: Counter[str]
) -> Iterator[tuple[ClipRecord, dict[str, Tensor]]]:
    """The clips of one right or mirrored hand at 30 frames a second; `left_out` counts the rest.

    The part of the object that the hand holds comes first, as in cleaning.
    """
    generator = seeded_generator("surface", recording.name, hand.side)
    subject = subject_of(hand.track, load_hand("right"))
    held = with_held_part_first(subject.joints, hand.object.surface())
    surface = reached_surface(held, subject.joints, config.points, generator=generator)
    motion = {"rotation": held.rotation, "translation": held.translation}
    world, _ = ObjectSurface(**vars(surface), **motion).in_world()
    near = torch.cdist(subject.joints[:, :1], world).amin((1, 2)) <= config.reach
    seen = hand.track.observed
    left_out["far from the object"] += int((~near).sum())
    left_out["without the hand"] += int((near & ~seen).sum())
    if (known := hand.object.valid) is not None:
        left_out["without the object"] += int((near & seen & ~known.all(1)).sum())
        seen = seen & known.all(1)
    state = subject.parameters()
    if len(held.fields) < PARTS:  # as synthetic objects, where rigid ones have equal parts
        motion = {name: values.repeat_interleave(PARTS, dim=1) for name, values in motion.items()}
    motion |= {"pose": state.pose[0], "wrist": state.wrist[0]}
    fixed = vars(surface) | {"offsets": subject.offsets[0]}
    for start, length in spans(near & seen, config, left_out):
        frames = start + torch.arange(config.longest).clamp(max=length - 1)
        name = f"{recording.name}_{hand.side}_{start:05d}"
        whose = identity(hand.track.betas)
        mesh = recording.sequence.object.meshes[0].sha256
        moving = {key: values[frames].clone() for key, values in motion.items()}
        yield ClipRecord(name, mesh[:16], whose, length), moving | fixed


def spans(
    kept: Bool[Tensor, " T"], config: ClipConfig, left_out: Counter[str]
) -> Iterator[tuple[int, int]]:
    """First frame and length of the clips: long enough runs of kept frames, in equal pieces."""
    for run in runs(kept.numpy()):
        frames = run.stop - run.start
        if frames < config.shortest:
            left_out[f"in stretches of less than {config.shortest}"] += frames
            continue
        pieces = -(-frames // config.longest)
        if frames < pieces * config.shortest:
            pieces = frames // config.shortest
        edges = torch.linspace(run.start, run.stop, pieces + 1).round().long().tolist()
        for start, stop in pairwise(edges):
            length = min(stop - start, config.longest)
            left_out["beyond the longest clip"] += stop - start - length
            yield start, length


def reached_surface(
    surface: MovingSurface,
    joints: Float[Tensor, "T 21 3"],
    count: int,
    *,
    generator: torch.Generator,
) -> PartSamples:
    """`count` points of the object, drawn as in cleaning."""
    drawn = PartSamples.of(surface_points(surface, joints, generator=generator, count=count))
    # their number is rounded for each part
    kept = torch.linspace(0, len(drawn.part) - 1, count, dtype=torch.float64).round().long()
    return drawn.take(kept, "P")


def drawn_surface(
    meshes: tuple[Mesh, ...], count: int, *, generator: torch.Generator
) -> PartSamples:
    """`count` points of the object, in proportion to the parts' areas."""
    areas = torch.stack([mesh.face_vectors().norm(dim=-1).sum() for mesh in meshes])
    edges = (count * areas.cumsum(0) / areas.sum()).round().long().tolist()
    counts = [stop - start for start, stop in pairwise([0, *edges])]
    drawn = [
        sample_surface(mesh, each, generator=generator)
        for mesh, each in zip(meshes, counts, strict=True)
        if each
    ]
    part = torch.arange(len(meshes)).repeat_interleave(torch.tensor(counts))
    return replace(PartSamples.of(drawn), part=part)


def identity(betas: Float[Tensor, " S"] | None) -> str:
    """A fingerprint of a person's betas; empty without betas."""
    if betas is None:
        return ""
    text = ",".join(f"{value:.3f}" for value in betas.tolist())
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def recorded_shard(shard: Path) -> RecordedShard:
    """What the record of a shard that `make_shards` has checked or made says of its clips."""
    with opened_tensors(shard) as (_, found):
        return RecordedShard(
            tuple(ClipRecord(**clip) for clip in found["clips"]), found["left_out"]
        )
