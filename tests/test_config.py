import json
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar, Literal

import pytest
from hypothesis import given
from hypothesis import strategies as st

from geneoh.config import as_dict, configured, flat, with_table
from geneoh.errors import ConfigError


@dataclass(frozen=True)
class Network:
    depth: int = 6
    dropout: float = 0.1
    kind: Literal["plain", "skip"] = "skip"
    widths: tuple[int, ...] = (64, 128)


@dataclass(frozen=True)
class Run:
    LARGEST: ClassVar[int] = 3
    rate: float = 1e-3
    steps: int = 100
    name: str = "run"
    resume: bool = False
    limit: int | None = None
    data: Path | None = None
    betas: tuple[float, float] = (0.9, 0.99)
    network: Network = field(default_factory=Network)
    teacher: Network | None = None


RUN = Run()


def test_a_file_holds_only_the_differences(tmp_path):
    (tmp_path / "a.toml").write_text(
        'rate = 1e-4\nlimit = 5\ndata = "x/y"\nbetas = [0.5, 1]\n'
        '[network]\ndepth = 2\nwidths = [1, 2, 3]\n[teacher]\nkind = "plain"\n'
    )
    assert configured(RUN, tmp_path / "a.toml") == Run(
        rate=1e-4,
        limit=5,
        data=Path("x/y"),
        betas=(0.5, 1.0),
        network=Network(depth=2, widths=(1, 2, 3)),
        teacher=Network(kind="plain"),
    )


def test_settings_come_after_the_file_and_the_last_one_counts(tmp_path):
    (tmp_path / "a.toml").write_text("steps = 7\nrate = 0.5\n")
    run = configured(RUN, tmp_path / "a.toml", ["steps=8", "steps = 9", "network.kind=plain"])
    assert (run.steps, run.rate, run.network.kind) == (9, 0.5, "plain")


@pytest.mark.parametrize(
    ("setting", "name", "value"),
    [
        ("rate=1e-4", "rate", 1e-4),
        ("rate=2", "rate", 2.0),
        ("rate=inf", "rate", math.inf),
        ("name=a run, twice", "name", "a run, twice"),
        ('name="none"', "name", "none"),
        ("name=", "name", ""),
        ("resume=true", "resume", True),
        ("limit=3", "limit", 3),
        ("limit=none", "limit", None),
        ("data=some/where", "data", Path("some/where")),
        ("betas=[0.1, 0.2]", "betas", (0.1, 0.2)),
    ],
)
def test_a_setting_is_read_as_its_field_needs(setting, name, value):
    got = getattr(configured(Run(limit=1), settings=[setting]), name)
    assert got == value
    assert type(got) is type(value)


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ("stepps=1", "'stepps' is no setting; did you mean 'steps'?"),
        ("network.dept=1", "'network.dept' is no setting; did you mean 'network.depth'?"),
        ("xyz=1", "there are betas, data, limit"),
        ("LARGEST=1", "'LARGEST' is no setting; there are betas, data, limit"),
        ("steps=1.5", "'steps' must be a whole number, got 1.5"),
        ("steps=true", "'steps' must be a whole number, got True"),
        ("rate=fast", "'rate' must be a number, got 'fast'"),
        ("resume=1", "'resume' must be true or false, got 1"),
        ("name=3", "'name' must be text, got 3"),
        ("limit=x", "'limit' must be a whole number or none, got 'x'"),
        ("network=3", "'network' must be a table of Network, got 3"),
        ("network.kind=deep", "'network.kind' must be one of 'plain', 'skip', got 'deep'"),
        ("network.widths=[1, 'a']", r"'network.widths[1]' must be a whole number, got 'a'"),
        ("betas=[1.0]", "'betas' must be [a number, a number], got [1.0]"),
        ("steps.x=1", "'steps' must be a whole number, got {'x': 1}"),
        ("steps", "expected NAME=VALUE"),
        ("=3", "expected NAME=VALUE"),
        ("network..depth=3", "expected NAME=VALUE"),
        ("name=1\nsteps = 2", None),
    ],
)
def test_a_wrong_setting_is_refused_with_its_path(setting, words):
    if words is None:
        assert configured(RUN, settings=[setting]).name == "1\nsteps = 2"
        return
    with pytest.raises(ConfigError) as refusal:
        configured(RUN, settings=[setting])
    assert str(refusal.value).startswith(f"--set {setting}: ")
    assert words in str(refusal.value)


def test_a_file_that_is_no_toml_or_not_there_is_named(tmp_path):
    with pytest.raises(ConfigError, match=r"nix\.toml: cannot be read"):
        configured(RUN, tmp_path / "nix.toml")
    (tmp_path / "a.toml").write_text("steps = \n")
    with pytest.raises(ConfigError, match=r"a\.toml: expected TOML, got .*line 1"):
        configured(RUN, tmp_path / "a.toml")


def test_the_class_of_a_choice_between_dataclasses_is_the_one_that_stands_there():
    @dataclass(frozen=True)
    class Either:
        fit: Network | Run

    either = configured(Either(Run()), settings=["fit.steps=3"])
    assert either.fit == Run(steps=3)


RUNS = st.builds(
    Run,
    rate=st.floats(allow_nan=False, allow_infinity=False),
    steps=st.integers(),
    name=st.text(),
    resume=st.booleans(),
    limit=st.none() | st.integers(),
    data=st.none() | st.sampled_from([Path("a"), Path("a/b")]),
    betas=st.tuples(st.floats(0, 1), st.floats(0, 1)),
    network=st.builds(Network, depth=st.integers(), widths=st.lists(st.integers()).map(tuple)),
    teacher=st.none() | st.builds(Network, kind=st.sampled_from(["plain", "skip"])),
)


@given(RUNS)
def test_a_resolved_configuration_comes_back_through_json(run):
    assert with_table(RUN, json.loads(json.dumps(as_dict(run))), "file") == run


def test_nested_settings_have_dotted_names():
    assert flat({"a": 1, "b": {"c": [2], "d": {"e": 3}}}) == {"a": 1, "b.c": [2], "b.d.e": 3}
