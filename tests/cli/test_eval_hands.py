"""`geneoh eval --generator both2hands` on a very small scale, and its refusals."""

import json

import pytest
from made_gestures import made_gestures, write_gesture_shards

from geneoh.choices import BODY_STAGES

EVAL = ("eval", "--generator", "both2hands", "--dataset", "synthetic", "--root", "data")
FEW = ("steps=1", "batch=3", "validation_batches=1", "text_hands.words.pieces=60")
SMALL = tuple(
    f"{stage}.{name}={size}"
    for stage in BODY_STAGES
    for name, size in (("width", 16), ("depth", 1), ("heads", 2))
)
QUICK = (
    "repetitions=2",
    "steps=1",
    "prompts=2",
    "answers=2",
    "encoder.steps=2",
    "encoder.width=16",
)


@pytest.mark.slow
def test_rows_are_printed_and_everything_is_written(geneoh, tmp_path):
    write_gesture_shards(tmp_path / "data", val=made_gestures(8, seed=1), train=made_gestures(6))
    (tmp_path / "small.toml").write_text("\n".join((*FEW, *SMALL)))
    run = ("--data", "data", "-o", "weights", "--threads", "1", "--config", "small.toml")
    for stage in BODY_STAGES:
        geneoh("train", "--stage", stage, *run)
    done = geneoh(*EVAL, "--weights", "weights", "-o", "out", settings=QUICK)
    whole = json.loads((tmp_path / "out" / "generation.json").read_text())
    rows = list(whole["table"])
    assert rows[:4] == ["real", "shuffled hands", "mean pose", "nearest training body"]
    assert rows[4:] == ["body only", "text only", "blended"]
    assert all(row in done.stdout for row in rows)
    assert whole["settings"]["encoder"]["hash"] in (tmp_path / "out" / "generation.md").read_text()
    geneoh(*EVAL, "--weights", "weights", "-o", "out", settings=QUICK)
    assert json.loads((tmp_path / "out" / "generation.json").read_text()) == whole


def test_what_does_not_go_with_the_generator_of_hands_is_refused(geneoh):
    for words, told in (
        ((*EVAL, "--refine", "geneoh"), "--refine: expected none with --generator both2hands"),
        ((*EVAL, "--jobs", 2), "--jobs: expected none with --generator both2hands"),
        ((*EVAL, "--mano", "mine"), "--mano is for recordings"),
        (EVAL, "data: expected train_*.safetensors, found none"),
        (EVAL[:-2], "make one with `geneoh synthesize --bodies -o FOLDER`"),
    ):
        refused = geneoh(*words, code=2)
        assert told in refused.stderr
