"""The files of an evaluation of generated clips."""

import json

from geneoh.evaluation.generation.report import GenerationReport, as_json
from geneoh.evaluation.generation.scores import MEASURES, RowScores


def test_what_a_generator_cannot_be_measured_by_is_null():
    values = {measure.key: [float("nan"), 1.0] for measure in MEASURES}
    report = GenerationReport({}, "geneoh eval", {"real": RowScores(values)}, ())
    whole = json.loads(as_json(report), parse_constant=lambda word: word)
    assert whole["repetitions"]["real"][MEASURES[0].key] == [None, 1.0]
