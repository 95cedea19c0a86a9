import importlib
import re
from pathlib import Path

import pytest
from bad_inputs import write_good

from geneoh.config import as_dict, flat
from geneoh.errors import ConfigError
from geneoh.evaluation.options import ProtocolOptions
from geneoh.synthesis.action_shards import ActionSynthesisConfig
from geneoh.synthesis.data_config import SynthesisConfig
from geneoh.synthesis.gestures.shards import GestureConfig
from geneoh.training.config import TrainConfig

CONFIGS = Path(__file__).parents[2] / "configs"


@pytest.fixture
def find_config(command):
    package = type(command).__module__.rpartition(".")[0]
    return importlib.import_module(".options", package).find_config


def test_a_path_is_taken_as_it_is(find_config):
    assert find_config("some/where.toml") == Path("some/where.toml")


@pytest.mark.parametrize("shipped", sorted(CONFIGS.glob("*.toml")), ids=lambda path: path.stem)
def test_a_shipped_configuration_is_found_by_its_name(find_config, shipped):
    assert find_config(shipped.stem).read_text() == shipped.read_text()


def test_an_unknown_name_is_answered_with_those_there_are(find_config):
    with pytest.raises(ConfigError, match=r"--config nothing: expected .*or the path of a"):
        find_config("nothing")


@pytest.mark.parametrize(
    "words",
    [
        ("denoise", "hand.npz"),
        ("denoise", "--stream"),
        ("convert", "landmarks", "hand.npz", "--check"),
        ("view", "hand.npz"),
        ("generate", "wave", "--body", "hand.npz"),
    ],
)
def test_a_unit_of_meshes_that_are_not_given_is_refused(geneoh, tmp_path, words):
    write_good(tmp_path)
    done = geneoh(*words, "--unit", "mm", code=2)
    assert "--unit is of the meshes of --obj, which is not given" in done.stderr


@pytest.mark.parametrize(
    ("name", "kinds"),
    [
        ("train", (TrainConfig,)),
        ("synthesize", (SynthesisConfig, ActionSynthesisConfig, GestureConfig)),
        ("eval", (ProtocolOptions,)),
    ],
)
def test_settings_that_help_names_are_settings_of_the_command(geneoh, name, kinds):
    named = re.findall(r"[a-z_.]+=[a-z0-9.]*[a-z0-9]", geneoh(name, "--help").stdout)
    known = {field for kind in kinds for field in flat(as_dict(kind()))}
    assert named
    assert {setting.partition("=")[0] for setting in named} <= known
