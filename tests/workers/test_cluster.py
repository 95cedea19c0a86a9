"""Work on a Ray cluster of two nodes on this machine."""

import os
import sys
import time
from importlib.util import find_spec
from pathlib import Path

import chores
import fake_cleaning
import pytest

from geneoh.batch import run
from geneoh.batch.cleaning import Batch
from geneoh.batch.clips import find_clips
from geneoh.errors import ConfigError
from geneoh.workers.cluster import on_cluster

needs_ray = pytest.mark.skipif(find_spec("ray") is None, reason="needs ray (extra cluster)")
with_ray = [needs_ray, pytest.mark.slow, pytest.mark.filterwarnings("ignore")]


def lost(item, why):
    return f"{item[0]}: {why}"


@pytest.fixture
def cluster(monkeypatch):
    """A head and another node, with one processor each."""
    from ray.cluster_utils import Cluster

    support = str(Path(chores.__file__).parent)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([support, os.environ.get("PYTHONPATH", "")]))
    made = Cluster(initialize_head=True, head_node_args={"num_cpus": 1})
    made.other = made.add_node(num_cpus=1)
    yield made
    made.shutdown()


def test_without_ray_a_sentence_says_how_to_get_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(ConfigError, match=r"pip install 'geneoh\[cluster\]'"):
        next(on_cluster([1], chores.doubled, address="local", lost=lost))


@needs_ray
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("address", ["127.0.0.1:1", "ray://127.0.0.1:1", "127.0.0.1:99999"])
def test_an_address_without_a_cluster_is_told(address):
    with pytest.raises(ConfigError, match=f"--ray {address}: no cluster answers"):
        next(on_cluster([1], chores.doubled, address=address, lost=lost))


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
        assert words.startswith("3: the workers that began it were lost")
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
            batch = Batch(tmp_path / name)
            clips = find_clips([tmp_path / "in"], None, batch.folder)
            assert run.clean_batch(clips, batch, ray=address).failed == []
            found[name] = {p.name: p.read_bytes() for p in batch.folder.iterdir()}
        assert found["here"] == found["there"], time.monotonic() - began
        assert len(found["here"]) == 9
