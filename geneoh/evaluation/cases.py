"""Test cases: a clip with one kind of noise and one seed, read from disk only when needed."""

import logging
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

from geneoh.choices import CaseNoise, Dataset
from geneoh.errors import InputError, MissingAssetError
from geneoh.evaluation.options import EvaluationOptions, ProtocolOptions
from geneoh.evaluation.protocols.clips import Clip
from geneoh.evaluation.protocols.datasets import clips_by_file, spread_over_groups
from geneoh.evaluation.protocols.noise import check_noise, noisy_input, refuse_idle_settings
from geneoh.files.atomic import make_folder, write_whole
from geneoh.files.outputs import keep_others
from geneoh.fitting.subject import subject_of
from geneoh.geometry.mesh import Mesh
from geneoh.hand.library import hand_of_betas
from geneoh.objects.camera_motion import in_steady_world
from geneoh.readers.clock import TIME_NAMES
from geneoh.readers.meshes import obj_text
from geneoh.readers.npz.files import load, save_sequence
from geneoh.readers.npz.layouts import OBJECT_FIELDS, read_fields
from geneoh.sequence.sequence import Sequence

LOG = logging.getLogger(__name__)

CaseKey = tuple[str, str, str, int]  # data set, clip, noise and seed
OF_RATE = ("fps", *TIME_NAMES)
"""Fields of a file from which its frame rate follows."""


@dataclass(frozen=True)
class Case:
    """A clip with one noise and seed; small until it is read, so that it can go to a worker."""

    dataset: Dataset
    clip: Clip
    noise: CaseNoise
    seed: int  # seed of the noise, and of the methods that sample
    protocol: ProtocolOptions = field(default_factory=ProtocolOptions)
    stored: Path | None = None  # folder of noisy clips that are read instead of drawing noise

    @property
    def key(self) -> CaseKey:
        """Unique key of this case."""
        return self.dataset, self.clip.name, self.noise, self.seed

    @property
    def file_name(self) -> str:
        """Name of the case's file in a folder of inputs or predictions."""
        return f"{self.clip.name}_{self.noise}_{self.seed}.npz"

    @cached_property
    def recording(self) -> Sequence:
        """The clip as it was recorded or synthesized."""
        return self.clip.read()

    @property
    def clean(self) -> Sequence | None:
        """The ground truth; None where the recording itself is the noisy input."""
        return None if self.noise == "recorded" else self.recording

    @cached_property
    def noisy(self) -> Sequence:
        """The noisy clip, the input of every method."""
        if self.stored is None:
            return noisy_input(
                self.recording, self.dataset, self.clip.name, self.noise, self.seed, self.protocol
            )
        names = (self.file_name, f"{self.noise}_{self.seed}.npz")
        for name in names:
            if (path := self.stored / name).is_file():
                return self.read_stored(path)
        raise MissingAssetError(
            f"{self.stored}: expected {names[0]} or {names[1]}, found neither; "
            "`geneoh eval --inputs DIR` writes such a folder"
        )

    def read_stored(self, path: Path) -> Sequence:
        """Read a noisy input or a prediction for this clip from a file, with the clip's meshes.

        A file without object poses or frame rate gets those of the clip. For a hand with pose
        parameters only, keypoints are computed with the user's MANO if the betas are MANO's, else
        with our hand, which is logged.
        """
        side, mano_dir = self.recording.hands[0].side, self.protocol.mano_dir
        fields = read_fields(path)
        meshes = self.recording.object.meshes if any(n in fields for n in OBJECT_FIELDS) else None
        fps = None if any(name in fields for name in OF_RATE) else self.recording.fps
        try:
            found = load(path, obj=meshes, side=side, fps=fps, mano_dir=mano_dir)
            found = in_steady_world(found)
        except InputError as error:
            said, _, cure = str(error).rpartition("; ")
            if "--" not in cure:
                raise
            # options of other commands, which this one lacks
            raise InputError(f"{said}; store the clip's {side} hand as a sequence") from error
        if found.frames != self.recording.frames:
            raise InputError(
                f"{path}: expected the clip's {self.recording.frames} frames, got {found.frames}; "
                "store a version of the whole clip"
            )
        if meshes is None:
            found = replace(found, object=self.recording.object)
        hand = found.hands[0]
        if hand.joints is None:
            own = None if mano_dir is None else hand.hand_model
            subject = subject_of(hand, hand_of_betas(side, own, mano_dir=mano_dir))
            for note in subject.notes:
                told, *_ = note.split(" (--")  # another option than that of an evaluation
                LOG.warning("%s: %s; --mano takes betas of MANO", path, told)
            found = replace(found, hands=(replace(hand, joints=subject.joints),))
        return found


def find_cases(options: EvaluationOptions) -> list[Case]:
    """The cases of an evaluation, sorted by clip name: each clip with every noise and seed."""
    # A missing data set is reported first, because without it no other option matters.
    by_file = clips_by_file(options.dataset, options.root, options.protocol)
    if options.noisy_inputs is not None:
        check_folder(options.noisy_inputs, "--twins")
    noises = options.noises or options.defaults.noises
    refuse_idle_settings(noises, options.protocol, stored=options.noisy_inputs is not None)
    for noise in noises:
        check_noise(options.dataset, noise, options.protocol)
    clips = spread_over_groups(by_file, options.limit)
    if not clips:
        raise InputError(
            f"{options.dataset}: expected clips of at least {options.protocol.frames} frames that "
            "the protocol keeps, got none; check that the copy is whole, or ask for fewer frames"
        )
    if (error := clips[0].error) is not None and all(clip.error for clip in clips):
        raise error
    return [
        Case(options.dataset, clip, noise, seed, options.protocol, options.noisy_inputs)
        for clip in sorted(clips, key=lambda clip: clip.name)
        for noise in noises
        for seed in options.seeds or options.defaults.seeds
    ]


def check_folder(folder: Path, option: str) -> None:
    """`MissingAssetError` if the folder of case files that an option names does not exist."""
    if not folder.is_dir():
        raise MissingAssetError(
            f"{option} {folder}: expected a folder of files CLIP_NOISE_SEED.npz, found none; "
            "--inputs DIR writes one of noisy clips"
        )


def write_inputs(cases: list[Case], folder: Path) -> int:
    """Write every case's noisy input, for other methods to clean; returns the number of files.

    The files are named as `--predictions` and `--twins` expect them. The meshes are in `objects/`,
    one per part of each clip. Nothing is written if a file of the data set cannot be read.
    """
    for error in (case.clip.error for case in cases):
        if error is not None:
            raise error
    for case in cases:
        path = folder / case.file_name
        keep_others(path)
        make_folder(path.parent)
        written: list[Mesh] = []
        for part, mesh in enumerate(case.noisy.object.meshes):
            place, text = folder / "objects" / f"{case.clip.name}_{part}.obj", obj_text(mesh)
            if place.exists() and place.read_text(errors="replace") != text:
                raise InputError(f"{place}: holds another mesh already; choose another folder")
            write_whole(place, text, parents=True)
            written.append(replace(mesh, source=place))
        motion = replace(case.noisy.object, meshes=tuple(written))
        save_sequence(replace(case.noisy, object=motion), path)
    return len(cases)
