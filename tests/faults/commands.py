"""The commands that write, on the smallest input, and what their results are."""

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trees
from bad_inputs import write_good
from made_grasps import ANY_GRASP
from safetensors.torch import load

from geneoh.synthesis.data_config import SynthesisConfig
from geneoh.synthesis.shards import write_shards

HAND = ("hand.npz", "--obj", "object.obj")
SMALL = ("shard=2", "points=64", "frames=62", "grasps.steps=1")
ANYTHING = ("grasps.checks.fingers=-1", "grasps.checks.depth=1", "grasps.checks.clearance=-1")
STEPS = ("steps=3", "checkpoint_every=1", "validate_every=1", "validation_batches=1", "batch=2")
EVAL = ("--dataset", "synthetic", "--limit", "1", "--noise", "gauss", "--set", "frames=6")
TIMES = re.compile(rb'"(?:seconds|time)[a-z_]*": [^,}\n]*|,[0-9.e+-]+,?$', re.MULTILINE)
"""What differs from run to run: seconds in JSON, and the last number in a line of CSV."""


def settings(*given: str) -> tuple[str, ...]:
    """Settings as options."""
    return tuple(word for setting in given for word in ("--set", setting))


COMMANDS: dict[str, tuple[str, ...]] = {
    "denoise": (
        *("denoise", *HAND, "--preset", "fast", "--samples", "1", "--steps", "1"),
        *("-o", "out/clean.npz", "--report", "out/clean.html"),
    ),
    "batch": ("batch", *HAND, "--preset", "fast", "--jobs", "1", "-o", "out"),
    "convert": ("convert", "landmarks", "hands.json", "-o", "out"),
    "corrupt": ("corrupt", *HAND[:1], "--noise", "gauss", "-o", "out/noisy.npz"),
    "view": ("view", *HAND, "-o", "out/page.html", "-o", "out/scene.glb", "-o", "out/all.npz"),
    "synthesize": ("synthesize", "-o", "out", "--count", "4", *settings(*SMALL, *ANYTHING)),
    "train": (
        *("train", "--stage", "motion", "--data", "data", "-o", "out"),
        *settings(*STEPS, "motion.width=16", "motion.depth=1", "motion.heads=2"),
    ),
    "eval": (
        *("eval", *EVAL, "--close-frames", "2", "--jobs", "1", "--method", "input"),
        *("--method", "savgol", "-o", "out"),
    ),
}
REPLACING = ("denoise", "corrupt", "view")
"""Commands that replace an older result; the others go on where they stopped."""


def write_inputs(folder: Path, name: str) -> None:
    """What a command reads."""
    write_good(folder)
    trees.landmarks(folder, trees.scene(), False)
    if name == "train":
        write_data(folder)


def write_data(folder: Path) -> None:
    """What is trained on."""
    config = SynthesisConfig(count=4, frames=62, points=8, shard=2, grasps=ANY_GRASP)
    write_shards(folder / "data", config, seed=0)


@dataclass(frozen=True)
class Result:
    """The files of an output folder."""

    files: dict[str, bytes]

    @property
    def lasting(self) -> dict[str, object]:
        """The files without what differs from run to run."""
        return {name: lasting(name, data) for name, data in self.files.items()}


def lasting(name: str, data: bytes) -> object:
    """A file without seconds; of a log its lines, which two runs at once may write twice.

    Of weights and of the state of a training run all tensors count, bit by bit.
    """
    if name.endswith(".safetensors"):
        return {key: tensor.numpy().tobytes() for key, tensor in load(data).items()}
    if not name.endswith((".jsonl", ".json", ".csv")):
        return data
    timeless = TIMES.sub(b"", data)
    return set(timeless.splitlines()) if name.endswith(".jsonl") else timeless


def result_in(folder: Path) -> Result:
    """Every file below a folder."""
    paths = sorted(path for path in folder.rglob("*") if path.is_file())
    return Result({str(path.relative_to(folder)): path.read_bytes() for path in paths})


def older(folder: Path, name: str) -> None:
    """Results of another input where the new ones of a command will stand."""
    if name in REPLACING:
        (folder / "out").mkdir(exist_ok=True)
        for path in (folder / "old").iterdir():
            (folder / "out" / path.name).write_bytes(path.read_bytes())


def run_of(name: str, cleaned: Callable[..., object] | None) -> Callable[[], None]:
    """A command, with a cleaning that was made before."""

    def run() -> None:
        import geneoh
        from geneoh.batch import cleaning
        from geneoh.viz import camera
        from geneoh_cli.main import cli

        camera.TURNS = 1  # how a page is written does not depend on where it looks from
        if cleaned is not None:
            geneoh.denoise = cleaning.denoise = cleaned
        cli.main(list(COMMANDS[name]), prog_name="geneoh")

    return run


def other_input(folder: Path) -> None:
    """Move the hand, so that the old results differ from the new ones."""
    arrays = dict(np.load(folder / "hand.npz"))
    arrays["joints"] = arrays["joints"] + np.float32(0.01)
    np.savez(folder / "hand.npz", **arrays)
