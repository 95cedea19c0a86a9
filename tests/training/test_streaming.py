"""Runs that learn from shards on disk, a batch of which is in memory at a time."""

from dataclasses import replace
from pathlib import Path

import pytest
import torch
from draws import seeded
from safetensors.torch import load_file
from stage_runs import heard_losses, train_stage

from geneoh.bundle import concatenated
from geneoh.errors import InputError
from geneoh.streamed import Streamed
from geneoh.synthesis.data_config import SynthesisConfig
from geneoh.synthesis.draws import Draws
from geneoh.synthesis.motions.motion import Interactions
from geneoh.synthesis.shards import ShardRecord, read_shards, write_clips
from geneoh.training.data import DataSource, evened, training_data
from geneoh.training.stages import data_digest
from geneoh.training.windows import WeightedInteractions, draw_windows

CPU = torch.device("cpu")
STATUS = Path("/proc/self/status")


def write(path: Path, clips: Interactions) -> int:
    """Write clips as a shard, and its size in bytes."""
    path.parent.mkdir(exist_ok=True)
    write_clips(path, clips, ShardRecord(SynthesisConfig(count=1), 0))
    return path.stat().st_size


@pytest.fixture
def folder(tmp_path, clips) -> Path:
    """The clips in three shards to learn from, and one to validate on."""
    for number, rows in enumerate((slice(4), slice(1), slice(1, 3), slice(3, 4))):
        name = f"{'train' if number else 'val'}_{number:05d}.safetensors"
        write(tmp_path / "data" / name, clips.take(rows))
    return tmp_path / "data"


def in_memory(data: Streamed[Interactions]) -> Streamed[Interactions]:
    """The same data with all clips in one bundle."""
    frames = max(shard.wrist.shape[1] for shard in data.shards)
    points = min(shard.points.shape[1] for shard in data.shards)
    one = Streamed.of([concatenated((evened(s, frames, points) for s in data.shards), "B")])
    if isinstance(data, WeightedInteractions):
        return replace(data, shards=one.shards, places=one.places, fitted=None)
    return one


@pytest.mark.parametrize("sources", ["one", "two"])
def test_a_run_on_shards_is_the_run_on_their_clips_in_memory(
    sources, folder, clips, tiny, tmp_path
):
    asked = [DataSource(folder)]
    if sources == "two":
        shorter = clips.shards[0].take(torch.arange(9), "T").take(torch.arange(0, 40, 2), "P")
        for name in ("val_00000", "train_00001"):
            write(tmp_path / "shorter" / f"{name}.safetensors", shorter)
        asked.append(DataSource(tmp_path / "shorter", weight=2.0))
    data = training_data(asked, tmp_path, tiny)
    assert isinstance(data.training, WeightedInteractions) == (sources == "two")
    assert len(data.training.shards) > 2
    short, losses, weights = replace(tiny, steps=2), [], []
    for name, change in (("shards", lambda data: data), ("memory", in_memory)):
        both = change(data.training), change(data.validation)
        with heard_losses() as heard:
            path = train_stage("motion", short, *both, tmp_path / name, device=CPU)
        losses.append(heard)
        weights.append(load_file(path))
    assert losses[0] == losses[1]
    assert all(torch.equal(tensor, weights[1][name]) for name, tensor in weights[0].items())
    assert data_digest(data.training) == data_digest(in_memory(data.training))


def memory() -> int:
    """Bytes that this process holds which are no pages of files."""
    return 1024 * next(
        int(line.split()[1])
        for line in STATUS.read_text().splitlines()
        if line.startswith("RssAnon")
    )


@pytest.mark.skipif(not STATUS.exists(), reason="reads what Linux tells of memory")
def test_memory_does_not_grow_with_the_shards(interactions, tiny, tmp_path):
    large = interactions.take(torch.arange(400) % 4, "B")
    grown, size = [], 0
    for count in (2, 8):
        folder = tmp_path / f"of_{count}"
        for number in range(count):
            size = write(folder / f"{'train' if number else 'val'}_{number:05d}.safetensors", large)
        before = memory()
        data = training_data([DataSource(folder)], tmp_path, tiny)
        for seed in range(5):
            generator = seeded(seed)
            draw_windows(data.training, tiny.windows, Draws(32, generator))
        grown.append(memory() - before)
    assert size > 5e6
    assert grown[1] - grown[0] < 2 * size, "six shards more"


def test_a_shard_of_another_shape_is_refused_at_the_start(folder, clips):
    write(folder / "train_00002.safetensors", clips.take(slice(2)).take(slice(9), "T"))
    told = r"train_00002\.safetensors: holds clips of another shape than train_00001"
    with pytest.raises(InputError, match=told):
        read_shards(folder, "train")
