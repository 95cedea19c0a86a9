"""The files of an evaluation of generated clips."""

import json

from geneoh.evaluation.generation.report import GenerationReport, as_json
from geneoh.evaluation.generation.scores import MEASURES, RowScores


def test_what_a_generator_cannot_be_measured_by_is_null():
    values = {measure.key: [float("nan"), 1.0] for measure in MEASURES}
    report = GenerationReport({}, "geneoh eval", {"real": RowScores(values)}, ())
    whole = json.loads(as_json(report), parse_constant=lambda word: word)
    assert whole["repetitions"]["real"][MEASURES[0].key] == [None, 1.0]


def test_distances_beside_the_last_row_are_of_the_same_halves():
    rows = {"real": [1.0, 2.0, 3.0], "far": [3.0, 5.0, 4.0], "ours": [2.0, 3.0, 4.0]}
    found = {name: RowScores(dict.fromkeys(("fid",), values)) for name, values in rows.items()}
    remarks = list(GenerationReport({}, "geneoh eval", found, ()).remarks())
    # of "far" the differences are 1, 2 and 0, whose deviation is 1
    assert remarks[-1] == (
        "FID less that of ours, over the same halves: real -1.00±0.00, far +1.00±1.96."
    )
    alone = GenerationReport({}, "geneoh eval", {"ours": found["ours"]}, ())
    assert not any("the same halves" in remark for remark in alone.remarks())
