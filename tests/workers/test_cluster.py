"""Work on a Ray cluster of two nodes on this machine."""

import json
import os
import socket
import subprocess
import sys
import threading
import time
from importlib.util import find_spec
from multiprocessing import Pipe, get_context
from pathlib import Path

import chores
import fake_cleaning
import pytest

from geneoh.batch import run
from geneoh.batch.cleaning import BatchOptions
from geneoh.batch.clips import find_batch_clips
from geneoh.errors import ConfigError, GeneOHError
from geneoh.files.journal import CLEANED
from geneoh.workers import cluster as cluster_module
from geneoh.workers.cluster import on_cluster

needs_ray = pytest.mark.skipif(find_spec("ray") is None, reason="needs ray (extra cluster)")
with_ray = [needs_ray, pytest.mark.slow, pytest.mark.filterwarnings("ignore")]

COMMAND = """
import fake_cleaning
from geneoh.batch import run
from geneoh_cli.main import cli

if __name__ == "__main__":
    run.clean_clip = fake_cleaning.clean_clip
    cli()
"""
HEAD = {"num_cpus": 1, "include_dashboard": False}  # its ten processes are not needed
PATIENCE = 300
"""Seconds for what takes ten on a machine that has nothing else to do."""


def lost(item, why):
    return f"{item[0]}: {why}"


@pytest.fixture
def cluster(monkeypatch, request):
    """A head and another node, with one processor each; a parameter slows cleaning by seconds."""
    from ray.cluster_utils import Cluster

    support = str(Path(chores.__file__).parent)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([support, os.environ.get("PYTHONPATH", "")]))
    monkeypatch.setenv(fake_cleaning.PAUSE, getattr(request, "param", "0"))
    made = Cluster(initialize_head=True, head_node_args=HEAD)
    made.other = made.add_node(num_cpus=1)
    yield made
    made.shutdown()


def test_without_ray_a_sentence_says_how_to_get_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(ConfigError, match=r"pip install 'geneoh\[cluster\]'"):
        next(on_cluster([1], chores.doubled, address="local", lost=lost))


def test_a_process_that_ends_while_it_tells_is_told():
    pipe, far = Pipe()
    os.write(far.fileno(), b"\0\0\0\x09half")  # of 9 bytes
    far.close()
    process = get_context("spawn").Process(target=os.getpid)
    process.start()
    with pytest.raises(GeneOHError, match=r"ended with exit code 0; run the same again"):
        cluster_module.next_message(process, pipe, "local")


@needs_ray
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("address", ["127.0.0.1:1", "ray://127.0.0.1:1", "127.0.0.1:99999"])
def test_an_address_without_a_cluster_is_told(address):
    with pytest.raises(ConfigError, match=f"--ray {address}: no cluster answers"):
        cluster_module.connect_to_cluster(pytest.importorskip("ray"), address)


@needs_ray
@pytest.mark.filterwarnings("ignore")
def test_the_cluster_of_this_machine_is_told_where_it_does_not_answer(monkeypatch):
    monkeypatch.setenv("RAY_ADDRESS", "127.0.0.1:1")
    with pytest.raises(ConfigError, match="--ray auto: no cluster answers"):
        next(on_cluster([1], chores.doubled, address="auto", lost=lost))


def test_a_connection_to_a_head_is_renewed_until_the_head_ends_it(monkeypatch):
    monkeypatch.setattr(cluster_module, "RENEWAL_SECONDS", 0.05)
    codes = list[int]()
    monkeypatch.setattr(cluster_module.os, "_exit", codes.append)
    with socket.create_server(("127.0.0.1", 0)) as head:
        place = head.getsockname()
        began = cluster_module.ask(place)
        watch = threading.Thread(target=cluster_module.end_with_head, args=(place, began))
        watch.start()
        head.settimeout(PATIENCE)
        lines = [head.accept()[0] for _ in range(3)]  # three are made, one after the other
        assert (watch.is_alive(), codes) == (True, [])
        lines += [head.accept()[0]]
        head.close()  # no other one can be made
        watch.join(PATIENCE)
    assert codes == [cluster_module.HEAD_LOST]
    for line in lines:
        line.close()


def test_a_head_that_ends_the_connection_is_lost_though_it_answers_again(monkeypatch):
    codes = list[int]()
    monkeypatch.setattr(cluster_module.os, "_exit", codes.append)
    with socket.create_server(("127.0.0.1", 0)) as head:
        place = head.getsockname()
        began = cluster_module.ask(place)
        head.accept()[0].close()
        cluster_module.end_with_head(place, began)
        cluster_module.ask(place).close()
    assert codes == [cluster_module.HEAD_LOST]


class TestCluster:
    pytestmark = with_ray

    def test_a_killed_worker_and_a_removed_node_lose_no_item(self, cluster, tmp_path):
        once, ever = tmp_path / "once", tmp_path / "ever"
        once.write_text("1")
        ever.write_text("1234567")
        work = [(1, ""), (2, str(once)), (3, str(ever))]
        made = list(on_cluster(work, chores.doubled_or_killed, address=cluster.address, lost=lost))
        assert sorted(each for each in made if isinstance(each, int)) == [2, 4]
        (words,) = (each for each in made if isinstance(each, str))
        assert words.startswith("3: the workers that worked on this clip were lost")
        doing = on_cluster(range(12), chores.slowly_doubled, address=cluster.address, lost=lost)
        made = [next(doing), next(doing)]
        cluster.remove_node(cluster.other)
        assert sorted([*made, *doing]) == [2 * item for item in range(12)]
        failing = on_cluster([2, 1], chores.doubled_unless_odd, address=cluster.address, lost=lost)
        with pytest.raises(ValueError, match="1 is odd"):
            list(failing)

    def test_a_batch_on_a_cluster_has_the_bits_of_one_process(self, cluster, tmp_path, monkeypatch):
        fake_cleaning.write_clips(tmp_path / "in", 6)
        monkeypatch.setattr(run, "clean_clip", fake_cleaning.clean_clip)
        monkeypatch.setattr("geneoh.batch.cleaning.denoise", fake_cleaning.denoise)
        began, found = time.monotonic(), {}
        for name, address in (("here", None), ("there", cluster.address)):
            batch = BatchOptions(tmp_path / name)
            clips = find_batch_clips([tmp_path / "in"], None, batch.folder)
            assert run.clean_batch(clips, batch, ray=address).failed == []
            found[name] = {p.name: p.read_bytes() for p in batch.folder.iterdir()}
        assert found["here"] == found["there"], time.monotonic() - began
        assert len(found["here"]) == 9

    @pytest.mark.parametrize("cluster", ["1"], indirect=True)
    def test_a_batch_that_loses_its_head_says_so_and_goes_on_at_a_new_one(self, cluster, tmp_path):
        fake_cleaning.write_clips(tmp_path / "in", 8)
        (tmp_path / "command.py").write_text(COMMAND)
        assert ended(begun(tmp_path, "here", "--jobs", "1"))[0] == 0
        here = {path.name: path.read_bytes() for path in (tmp_path / "here").iterdir()}
        process = begun(tmp_path, "there", "--ray", cluster.address)
        until_done(tmp_path / "there" / CLEANED, 2, process)
        address = cluster.address
        port = int(address.rpartition(":")[2])
        cluster.remove_node(cluster.head_node, allow_graceful=False)
        killed = time.monotonic()
        code, said = ended(process)
        assert code == 2, said
        assert time.monotonic() - killed < 30
        assert "Traceback" not in said
        assert said.splitlines()[-1].startswith(
            f"Error: --ray {address}: the head of the cluster was lost; start one again with"
        )
        done = names_done(tmp_path / "there" / CLEANED)
        assert 2 <= len(done) < 8
        for name in done:
            assert (tmp_path / "there" / f"{name}.npz").read_bytes() == here[f"{name}.npz"]
        cluster.add_node(**HEAD, gcs_server_port=port)
        code, said = ended(begun(tmp_path, "there", "--ray", cluster.address))
        assert code == 0, said
        assert f"8 clips done, {len(done)} of them before, 0 failed" in said
        there = {path.name: path.read_bytes() for path in (tmp_path / "there").iterdir()}
        assert there == here
        assert len(there) == 11


def begun(folder, out, *how):
    """The command that cleans the clips of a folder, as a process."""
    return subprocess.Popen(
        [sys.executable, "command.py", "batch", "in", "-o", out, *how],
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )


def ended(process):
    """Exit code and output of a command."""
    try:
        said, _ = process.communicate(timeout=PATIENCE)
    finally:
        process.kill()
    return process.returncode, said


def names_done(journal):
    """The clips that a journal calls done."""
    lines = journal.read_text().splitlines() if journal.exists() else []
    records = [json.loads(line) for line in lines[1:]]
    return [record["clip"] for record in records if record["state"] == "done"]


def until_done(journal, count, process):
    """Wait until a journal calls so many clips done."""
    end = time.monotonic() + PATIENCE
    while len(names_done(journal)) < count:
        assert time.monotonic() < end
        assert process.poll() is None, process.stdout.read()
        time.sleep(0.01)
