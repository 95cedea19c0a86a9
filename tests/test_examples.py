"""The scripts of examples/ run on the example recording and say something of it."""

import re
import runpy
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[1] / "examples"
SAYS = {
    "denoise_from_python": r"penetration 3\.0 mm before, 2\.0 mm after",
    "keypoints_only": r"noisy keypoints: mean error 24\.\d mm\nclean keypoints: mean error 1\d\.\d",
    "read_a_data_set": r"146 frames at 30 frames per second\nleft hand, observed in 146 frames",
    "uncertainty": r"within the 90% radius",
    "your_own_noise": r"noisy track: .* 23\.\d mm\nclean track: .* (8|9)\.\d mm",
}


def test_every_script_is_tested():
    assert {path.stem for path in EXAMPLES.glob("[!_]*.py")} == set(SAYS)


@pytest.mark.slow
@pytest.mark.parametrize("name", SAYS)
def test_a_script_runs(name, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", [name])
    runpy.run_path(str(EXAMPLES / f"{name}.py"), run_name="__main__")
    assert re.search(SAYS[name], capsys.readouterr().out)
