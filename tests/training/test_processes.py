"""Runs in several processes, as torchrun starts them, on the CPU."""

import multiprocessing
import os
import signal
import socket
from dataclasses import replace

import pytest
import torch
from stage_runs import heard_losses, train_stage
from torch.distributed.run import parse_args as torchrun

from geneoh.errors import ConfigError
from geneoh.nn.checkpoint import load_checkpoint
from geneoh.training import loop, resume
from geneoh.training.processes import Team, joined
from geneoh_cli.commands.train import train

CPU = torch.device("cpu")
CLEAN = multiprocessing.get_context("forkserver")
"""Starts processes from one that has never computed, as torchrun does: a fork of this one, in whose
threads batches are made, may hang in linear algebra."""
CLEAN.set_forkserver_preload(["geneoh.training.loop", "geneoh.training.stages", "stage_runs"])
NO_GRADIENT = "judge.4.bias"
"""A softmax takes this bias of SpatialDiff out, so that its gradient is rounding alone."""
ROUNDING = 1e-8  # of moments that are zero but for it


def multiply_in_float32(set_attribute=setattr) -> None:
    """As on machines without units for bfloat16, whose rounding depends on the size of a batch."""
    for module in (loop, resume):
        set_attribute(module, "quick_precision", lambda device: torch.float32)


@pytest.fixture(autouse=True)
def _products_in_float32(monkeypatch):
    multiply_in_float32(monkeypatch.setattr)


def test_torchrun_leaves_every_option_of_train_alone():
    ours = [name for option in train.params for name in option.opts]
    given = ["--nproc-per-node", "2", "--no-python", "--", "geneoh", "train", *ours]
    asked = torchrun(given)
    assert (asked.training_script, asked.training_script_args) == ("geneoh", ["train", *ours])
    assert f"torchrun {' '.join(given[:6])}" in " ".join(train.help.split())


def free_port() -> int:
    with socket.socket() as listening:
        listening.bind(("127.0.0.1", 0))
        return listening.getsockname()[1]


def started(rank, count, port, task, arguments, ended):
    """Run a task in a process of a team, and tell its result or its error."""
    multiply_in_float32()
    os.environ.update(
        RANK=str(rank),
        LOCAL_RANK=str(rank),
        WORLD_SIZE=str(count),
        MASTER_ADDR="127.0.0.1",
        MASTER_PORT=str(port),
    )
    try:
        with joined(CPU) as (team, _):
            told = task(team, *arguments)
    except (Exception, KeyboardInterrupt) as error:
        told = (type(error).__name__, str(error), getattr(error, "exit_code", None))
    ended.put((rank, told))


def told_by(count, task, *arguments, tell: int) -> dict:
    """What a task returns or raises in `tell` processes of a team, by their ranks."""
    ended, port = CLEAN.Queue(), free_port()
    processes = [
        CLEAN.Process(target=started, args=(rank, count, port, task, arguments, ended))
        for rank in range(count)
    ]
    for process in processes:
        process.start()
    told = dict(ended.get(timeout=300) for _ in range(tell))
    for process in processes:
        process.join(10)
    return told


def together(count, task, *arguments) -> list:
    """What a task returns or raises in each process of a team."""
    told = told_by(count, task, *arguments, tell=count)
    return [told[rank] for rank in range(count)]


def run(team, stage, config, clips, folder, stop_after=None) -> list[float]:
    """Train, and the losses of the steps; Ctrl-C in the last process after a step, if asked for."""

    def listen(done, total):
        if done == stop_after and team.rank == team.size - 1:
            os.kill(os.getpid(), signal.SIGINT)

    with heard_losses() as (losses, _):
        train_stage(stage, config, clips, clips, folder, device=CPU, on_step=listen, team=team)
    return losses


def assert_alike(first, second, stage):
    """The files of two runs, state and weights, differ by rounding alone.

    Each tensor as a whole: Adam takes steps of full length along single gradients that are hardly
    more than rounding.
    """
    for name in (f"{stage}_state.safetensors", f"{stage}.safetensors"):
        a, b = (load_checkpoint(folder / name) for folder in (first, second))
        assert a.tensors.keys() == b.tensors.keys()
        for key, tensor in a.tensors.items():
            if NO_GRADIENT in key:
                continue
            size, apart = tensor.double().norm(), (tensor.double() - b.tensors[key]).norm()
            assert apart <= 1e-4 * size + ROUNDING * tensor.numel() ** 0.5, key
        assert a.record["step"] == b.record["step"]


def run_each(team, config, clips, folder) -> dict[str, list[float]]:
    """Train one stage after the other, and the losses of each; MotionDiff has a test of its own."""
    stages = ("spatial", "temporal", "latent")
    return {stage: run(team, stage, config, clips, folder / stage) for stage in stages}


@pytest.mark.slow
def test_two_processes_take_the_steps_of_one(tmp_path, clips, tiny):
    """Each has half of the windows: one process with twice the batch of a process."""
    config = replace(tiny, batch=4, steps=2, autoencoder_steps=1, validation_batches=3)
    alone = run_each(Team(), config, clips, tmp_path / "one")
    first, second = together(2, run_each, config, clips, tmp_path / "two")
    assert first == second
    for stage, losses in alone.items():
        assert first[stage] == pytest.approx(losses, rel=1e-5), stage
        assert_alike(tmp_path / "one" / stage, tmp_path / "two" / stage, stage)


@pytest.mark.parametrize("stage", ["spatial", "relations", "toch"])
def test_pieces_of_a_batch_make_the_step_of_the_whole(tmp_path, clips, tiny, stage):
    config = replace(tiny, batch=5)
    whole = run(Team(), stage, config, clips, tmp_path / "whole")
    pieces = run(Team(), stage, replace(config, accumulate=3), clips, tmp_path / "pieces")
    assert pieces == pytest.approx(whole, rel=1e-5)
    assert_alike(tmp_path / "whole", tmp_path / "pieces", stage)


def test_a_run_goes_on_in_another_number_of_processes(tmp_path, clips, tiny):
    config = replace(tiny, batch=3)
    whole = run(Team(), "motion", config, clips, tmp_path / "whole")
    stopped = together(2, run, "motion", config, clips, tmp_path / "cut", 1)
    # The step after the signal still counts: processes agree on the last one.
    assert sorted((name, code) for name, _, code in stopped) == [
        ("EndedElsewhereError", 130),
        ("KeyboardInterrupt", None),
    ]
    state = load_checkpoint(tmp_path / "cut" / "motion_state.safetensors").record
    assert state["step"] == 2
    assert not (tmp_path / "cut" / "motion.safetensors").exists()
    assert run(Team(), "motion", config, clips, tmp_path / "cut") == pytest.approx(
        whole[2:], rel=1e-5
    )
    assert_alike(tmp_path / "whole", tmp_path / "cut", "motion")


def test_ctrl_c_saves_the_step_that_is_under_way(tmp_path, clips, tiny):
    rare, before = replace(tiny, checkpoint_every=100), signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt):
        run(Team(), "motion", rare, clips, tmp_path, stop_after=1)
    assert load_checkpoint(tmp_path / "motion_state.safetensors").record["step"] == 2
    assert signal.getsignal(signal.SIGINT) is before


def failing(team, ranks):
    """An error in some processes while the others wait for them."""
    if team.rank in ranks:
        raise ConfigError("the sentence")
    team.add_up([torch.zeros(3)])


@pytest.mark.parametrize("ranks", [(0,), (1,), (0, 1)])
def test_an_error_ends_all_and_is_told_once(ranks):
    told = together(2, failing, ranks)
    assert sorted((name, code) for name, _, code in told) == [
        ("ConfigError", None),
        ("EndedElsewhereError", 2),
    ]


def leaving(team):
    if team.rank:
        os._exit(9)
    team.add_up([torch.zeros(3)])


def test_a_process_that_is_killed_is_told_of():
    ((rank, (name, words, _)),) = told_by(2, leaving, tell=1).items()
    assert (rank, name) == (0, "GeneOHError")
    assert "ended without an error message" in words


def turns(team, folder):
    """The first process writes, and the other finds what it wrote."""
    with team.first_alone():
        there = (folder / "made").exists()
        (folder / "made").touch()
    return there


def test_the_first_process_makes_the_data_of_all(tmp_path):
    assert together(2, turns, tmp_path) == [False, True]


def test_one_process_needs_no_environment_and_several_all_of_it(monkeypatch):
    monkeypatch.delenv("WORLD_SIZE", raising=False)
    with joined(CPU) as (team, device):
        assert (team.size, device) == (1, CPU)
    monkeypatch.setenv("WORLD_SIZE", "2")
    monkeypatch.delenv("RANK", raising=False)
    with pytest.raises(ConfigError, match=r"expected RANK.*torchrun"), joined(CPU):
        pass


def test_a_batch_is_not_divided_into_more_pieces_than_windows(tmp_path, clips, tiny):
    with pytest.raises(ConfigError, match=r"expected 3 windows or more .* got 2"):
        run(Team(), "motion", replace(tiny, accumulate=3), clips, tmp_path)
