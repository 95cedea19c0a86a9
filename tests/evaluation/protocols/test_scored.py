"""Each data set in its published layout can be scored, from the files to the table."""

import pytest

from geneoh.evaluation.options import EvaluationOptions, ProtocolOptions
from geneoh.evaluation.runner import evaluate
from geneoh.evaluation.tables import as_text

PLAIN = {"hoi4d"}
"""Recorded with real noise: without ground truth, judged by plausibility."""


@pytest.mark.parametrize("name", ["grab", "grab-beta", "hoi4d", "arctic", "taco"])
def test_a_data_set_in_its_published_layout_is_scored(tree, mano_dir, tmp_path, name):
    source = name.removesuffix("-beta")
    root = tree(source, 160) if source == "grab" else tree(source)
    options = EvaluationOptions(
        name,
        root=root,
        seeds=(11,),
        limit=1,
        methods=("input", "savgol"),
        protocol=ProtocolOptions(mano_dir=mano_dir, frames=20, stride=10),
        close_frames=1,
    )
    made = evaluate(options, tmp_path / "out")
    assert [score.failed for score in made.scores] == [""] * len(made.methods) * len(made.blocks)
    for block in made.blocks:  # one for each noise of the protocol
        assert block.cells["input"]["acceleration_mm"].mean > 0
        for cells in block.cells.values():
            assert ("mpjpe_mm" in cells) == (name not in PLAIN)
    assert any("Savitzky-Golay on keypoints" in line for line in as_text(made.blocks))
