"""Where a run's data comes from: shares of sources, what is held out, and what is made first."""

import shutil
from dataclasses import fields, replace
from pathlib import Path

import pytest
import torch
from draws import seeded
from made_grasps import ANY_GRASP

from geneoh.errors import ConfigError, InputError
from geneoh.streamed import Streamed
from geneoh.synthesis.data_config import SynthesisConfig
from geneoh.synthesis.draws import Draws
from geneoh.synthesis.motions.motion import Interactions
from geneoh.synthesis.shards import shard_record, write_shards
from geneoh.training.data import (
    DataSource,
    Portion,
    mixed,
    parsed_source,
    training_data,
    whole,
)
from geneoh.training.held_out import held_out
from geneoh.training.recordings import ClipRecord
from geneoh.training.windows import WeightedInteractions, WindowConfig, draw_windows

FEW = SynthesisConfig(count=2, shard=1, points=16, frames=8, grasps=ANY_GRASP)


@pytest.mark.parametrize(
    ("text", "source"),
    [
        ("runs/data", DataSource(Path("runs/data"))),
        ("runs/data:2", DataSource(Path("runs/data"), "", 2.0)),
        ("taco=/data/TACO", DataSource(Path("/data/TACO"), "taco")),
        ("taco=/data/TACO:0.5", DataSource(Path("/data/TACO"), "taco", 0.5)),
        ("sequences=C:/mine", DataSource(Path("C:/mine"), "sequences")),
        ("sequences=C:/mine:3", DataSource(Path("C:/mine"), "sequences", 3.0)),
    ],
)
def test_a_source_is_a_reader_a_path_and_a_weight(text, source):
    assert parsed_source(text) == source


@pytest.mark.parametrize(
    "text", ["tacco=/data", "taco=/data:0", "taco=/data:-1", "x:inf", "", "taco="]
)
def test_an_unknown_source_or_a_weight_of_nothing_is_refused(text):
    with pytest.raises(ConfigError, match=f"--data {text}: "):
        parsed_source(text)


def test_a_weight_that_is_no_number_is_refused_unless_the_colon_belongs_to_the_path(tmp_path):
    folder, text = tmp_path / "data", f"{tmp_path / 'data'}:abc"
    assert parsed_source(text).path == Path(text)
    folder.mkdir()
    with pytest.raises(ConfigError, match="expected a weight after ':', got abc"):
        parsed_source(text)
    Path(text).mkdir()
    assert parsed_source(text).path == Path(text)


def records(objects: str, people: str) -> list[ClipRecord]:
    """A clip for each pair of letters."""
    return [ClipRecord("a", o, p, 60) for o, p in zip(objects, people, strict=True)]


def test_whole_objects_are_held_out():
    letters = "aaaabbbbbbccccccccdd"
    ((held, words),) = held_out([records(letters, "p" * 20)])
    chosen = {letter for letter, out in zip(letters, held, strict=True) if out}
    assert 2 <= int(held.sum()) < 20
    assert all(bool(out) == (letter in chosen) for letter, out in zip(letters, held, strict=True))
    assert "held out for validation" in words


def test_of_one_object_whole_people_are_held_out():
    ((held, words),) = held_out([records("aaaa", "ppqq")])
    assert held.tolist() in ([True, True, False, False], [False, False, True, True])
    assert words.startswith("2 of one person held out")


def test_one_person_with_one_object_is_validated_on_itself():
    ((held, words),) = held_out([records("aa", "pp")])
    assert not bool(held.any())
    assert "no other object" in words


def test_no_source_learns_from_an_object_that_another_one_holds_out():
    sets = ["ab", "bc", "cd", "de", "ea", "a", "abcde", "fffffffffg"]
    splits = held_out([records(objects, "p" * len(objects)) for objects in sets])
    learned, validated = set[str](), set[str]()
    for objects, (held, _) in zip(sets, splits, strict=True):
        kept = {letter for letter, out in zip(objects, held, strict=True) if not out}
        assert kept, "each source has something to learn from"
        learned |= kept
        validated |= set(objects) - kept
    assert validated
    assert not learned & validated
    assert "a" in learned, "it is all that one source has"


def test_made_interactions_alone_stay_as_they_are(clips):
    assert mixed([whole(clips, 0.3)]) is clips


def portion(clips: Interactions, number: float, lengths: list[int], weight: float) -> Portion:
    """Clips whose wrist says whose they are, and whose padded frames are NaN."""
    wrist = torch.full_like(clips.wrist, number)
    for one, length in zip(wrist, lengths, strict=True):
        one[length:] = torch.nan
    return Portion(Streamed.of([replace(clips, wrist=wrist)]), torch.tensor(lengths), weight)


def test_windows_are_drawn_in_the_shares_asked_for_and_never_of_the_padding(clips):
    some = clips.take(slice(3))
    frames = some.wrist.shape[1]
    longer = portion(some, 1.0, [frames] * 3, 3.0)
    shorter = portion(clips.take(slice(1)), 2.0, [6], 1.0)
    both = mixed([longer, shorter])
    assert isinstance(both, WeightedInteractions)
    generator = seeded()
    config = WindowConfig(frames=6, fast_share=0.5)
    wrists = [draw_windows(both, config, Draws(50, generator)).hand.wrist for _ in range(20)]
    assert all(bool(wrist.isfinite().all()) for wrist in wrists)
    share = torch.cat([wrist[:, 0, 0] == 2 for wrist in wrists]).float().mean()
    assert float(share) == pytest.approx(0.25, abs=0.05)


def test_windows_of_two_frames_can_be_drawn(clips):
    config = WindowConfig(frames=2, short_share=1.0)
    drawn = draw_windows(clips, config, Draws(3, seeded()))
    assert drawn.hand.wrist.shape == (3, 2, 3)


def test_clips_of_other_lengths_and_numbers_of_points_fit_together(clips):
    (shard,) = clips.shards
    short = shard.take(torch.arange(5), "T").take(torch.arange(20), "P")
    both = mixed([whole(clips, 1.0), whole(Streamed.of([short]), 1.0)]).take(slice(None))
    assert both.wrist.shape == (8, shard.wrist.shape[1], 3)
    assert both.points.shape == (8, 20, 3)
    assert both.wrist[4:, 5:].equal(short.wrist[:, 4:5].expand(4, both.wrist.shape[1] - 5, 3))
    for field in fields(Interactions):
        assert len(getattr(both, field.name)) == 8


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> Path:
    """A folder with the two shards of `FEW`."""
    folder = tmp_path_factory.mktemp("made") / "data"
    write_shards(folder, FEW, seed=0)
    return folder


def test_an_empty_folder_is_filled_first_and_an_interrupted_one_completed(made, tmp_path, tiny):
    config, told = replace(tiny, synthesis=FEW), []
    data = training_data(
        [DataSource(tmp_path / "new")], tmp_path, config, on_progress=lambda *now: told.append(now)
    )
    names = sorted(path.name for path in made.iterdir())
    assert sorted(path.name for path in (tmp_path / "new").iterdir()) == names
    assert told == [("interactions", 1, 2), ("interactions", 2, 2)]
    (clip,) = data.training.take(slice(None)).wrist
    assert clip.shape == (8, 3)
    whole_one = (made / names[0]).read_bytes()
    (tmp_path / "new" / names[0]).unlink()
    again = training_data([DataSource(tmp_path / "new")], tmp_path, config)
    assert (tmp_path / "new" / names[0]).read_bytes() == whole_one
    assert again.training.take(slice(None)).wrist[0].equal(clip)


def test_interactions_are_not_made_among_other_files(tmp_path, tiny):
    file = tmp_path / "mine" / "walk.npz"
    file.parent.mkdir()
    file.touch()
    for path in (file.parent, file):
        with pytest.raises(InputError, match=rf"got walk\.npz; .* such as sequences={path}, or"):
            training_data([DataSource(path)], tmp_path, tiny)
    assert list(file.parent.iterdir()) == [file]


def test_interactions_of_other_settings_are_taken_as_they_are(made, tmp_path, tiny):
    before = sorted(path.stat().st_mtime_ns for path in made.iterdir())
    data = training_data([DataSource(made)], tmp_path, tiny)
    assert sorted(path.stat().st_mtime_ns for path in made.iterdir()) == before
    assert data.record["config"]["count"] == 2
    assert shard_record(next(made.iterdir())).config == FEW


def test_a_folder_that_lacks_shards_of_other_settings_is_taken_with_a_word(made, tmp_path, tiny):
    more = tmp_path / "more"
    config = replace(FEW, count=3)
    write_shards(more, config, seed=1)
    (more / "train_00002.safetensors").unlink()
    data = training_data([DataSource(more)], tmp_path, tiny)
    assert data.notes == (
        f"{more}: 2 of 3 shards are there; `geneoh synthesize` with the same options makes the "
        "others",
    )
    assert training_data([DataSource(made)], tmp_path, tiny).notes == ()


def test_a_folder_that_was_begun_with_scanned_objects_is_not_filled_without(tmp_path, tiny):
    (tmp_path / "scans.safetensors").touch()
    with pytest.raises(InputError, match=r"expected train_\*\.safetensors, found none"):
        training_data([DataSource(tmp_path)], tmp_path, replace(tiny, synthesis=FEW))


def test_a_source_with_no_stretch_that_is_long_enough_says_what_was_left_out(tmp_path, tiny):
    examples = Path(__file__).parents[2] / "examples"
    config = replace(tiny, clips=replace(tiny.clips, shortest=150))
    source = DataSource(examples / "taco_clean.npz", "sequences")
    with pytest.raises(InputError, match="in stretches of less than 150"):
        training_data([source], tmp_path, config)


def test_a_source_with_nothing_to_learn_from_names_a_clip_that_could_not_be_read(tmp_path, tiny):
    examples = Path(__file__).parents[2] / "examples"
    shutil.copy(examples / "taco_clean.npz", tmp_path)
    shutil.copy(examples / "taco_object.obj", tmp_path)
    (tmp_path / "broken.npz").write_bytes(b"no archive")
    config = replace(tiny, clips=replace(tiny.clips, shortest=150))
    with pytest.raises(InputError, match=r"; 1 clip could not be read, such as .*broken: not read"):
        training_data([DataSource(tmp_path, "sequences")], tmp_path / "cut", config)
