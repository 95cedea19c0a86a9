"""What holds for the training of every network of the generators."""

from dataclasses import replace

import made_gestures
import made_networks
import pytest
import torch
from made_tasks import ALL_STAGES, made_task

from geneoh.choices import ACTION_STAGES
from geneoh.config import as_dict
from geneoh.nn.checkpoint import load_checkpoint
from geneoh.training.loop import train

CPU = torch.device("cpu")


@pytest.mark.parametrize("stage", ALL_STAGES)
def test_a_resumed_run_is_the_run_that_was_not_interrupted(tmp_path, stage):
    task = made_task(stage)

    def stop(done, total):
        if done == task.config.steps // 2:
            raise KeyboardInterrupt

    whole = load_checkpoint(train(task, tmp_path / "whole", device=CPU))
    with pytest.raises(KeyboardInterrupt):
        train(made_task(stage), tmp_path / "cut", device=CPU, on_step=stop)
    resumed = load_checkpoint(train(made_task(stage), tmp_path / "cut", device=CPU))
    assert whole.tensors.keys() == resumed.tensors.keys()
    assert all(torch.equal(t, resumed.tensors[n]) for n, t in whole.tensors.items())
    assert whole.record["stage"] == stage
    assert whole.record["config"] == as_dict(task.config)
    assert whole.record.get("sequences", 6) == 6


@pytest.mark.parametrize(
    ("stage", "share"),
    [
        *(("contact", 0.95), ("interaction", 0.9)),
        *(("body_hands", 0.9), ("text_hands", 0.9), ("blend", 0.95)),
    ],
)
def test_the_loss_falls(tmp_path, stage, share):
    made = made_networks if stage in ACTION_STAGES else made_gestures
    few = {"steps": 40, "rate": 1e-2, "validate_every": 40, "checkpoint_every": 40}
    task = made.tiny_task(stage, replace(made.TINY, **few))
    untrained, count = task.network().eval(), task.config.validation_batches
    before = sum(float(task.validate(untrained, index)) for index in range(count)) / count
    path = train(task, tmp_path, device=CPU)
    assert load_checkpoint(path).record["error_left"] < share * before
