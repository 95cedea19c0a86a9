"""Means, spreads, intervals and ranks of made-up scores."""

import pytest

from geneoh.evaluation.scores import Score
from geneoh.evaluation.tables import (
    as_markdown,
    as_text,
    blocks_of,
    cell_of,
    interval,
    seed_agreement,
)


def score(method, value, clip="a", seed=11, noise="gauss", failed="", key="mpjpe_mm"):
    values = {} if value is None else {key: value}
    return Score("taco", clip, noise, seed, method, values, failed=failed)


TWO_BY_TWO = [
    score("input", 1.0, "a", 11),
    score("input", 3.0, "b", 11),
    score("input", 2.0, "a", 22),
    score("input", 6.0, "b", 22),
]


def test_a_cell_is_the_mean_over_clips_then_seeds_and_their_deviation():
    cell = cell_of(TWO_BY_TWO, "mpjpe_mm")
    assert cell.mean == 3.0  # of 2 and 4
    assert cell.deviation == pytest.approx(2**0.5)
    assert cell.count == 4
    assert (cell.low, cell.high) == (1.5, 4.5)  # clips have means 1.5 and 4.5


def test_one_seed_has_no_spread_and_one_value_no_interval():
    cell = cell_of(TWO_BY_TWO[:1], "mpjpe_mm")
    assert (cell.mean, cell.deviation, cell.low, cell.high) == (1.0, None, None, None)
    assert cell_of(TWO_BY_TWO, "depth_mm") is None


def test_the_interval_holds_the_mean_and_shrinks_with_more_values():
    few, many = [0.0, 1.0] * 4, [0.0, 1.0] * 64
    (low, high), (lower, higher) = interval(few), interval(many)
    assert low < 0.5 < high
    assert higher - lower < 0.5 * (high - low)
    assert interval(few) == (low, high)


def ranked(seed, **values):
    return [score(method, value, seed=seed) for method, value in values.items()]


def test_agreement_is_one_for_the_same_order_and_minus_one_for_the_reverse():
    rising = ranked(11, a=1.0, b=2.0, c=3.0)
    assert seed_agreement(rising + ranked(22, a=0.0, b=5.0, c=9.0)) == 1
    assert seed_agreement(rising + ranked(22, a=9.0, b=5.0, c=0.0)) == -1
    assert seed_agreement(rising + ranked(22, a=1.0, b=3.0, c=2.0)) == pytest.approx(1 / 3)
    assert seed_agreement(rising + ranked(22, a=1.0)) is None


def test_agreement_is_that_of_the_two_seeds_that_agree_least():
    scores = ranked(11, a=1.0, b=2.0) + ranked(22, a=1.5, b=2.5)
    assert seed_agreement(scores) == 1
    scores += ranked(77, a=3.0, b=2.0)
    assert seed_agreement(scores) == -1
    assert seed_agreement(scores[:2]) is None


def test_there_is_a_block_for_each_noise_and_methods_stand_as_asked():
    scores = [score("b", 2.0), score("a", 1.0), score("a", 1.0, noise="beta")]
    first, second = blocks_of(scores, ["a", "b"])
    assert (first.noise, second.noise) == ("gauss", "beta")
    assert list(first.cells) == ["a", "b"]
    assert first.title == "taco, gauss: 1 clip, 1 seed"


def test_the_text_has_a_line_for_each_method_and_says_what_failed():
    scores = [score("a", 1.25), score("b", None, failed="no such file"), score("b", 2.0, "c")]
    lines = list(as_text(blocks_of(scores, ["a", "b"])))
    assert len(lines) == 1 + 1 + 2 + 1
    assert "MPJPE mm" in lines[1]
    assert lines[2].split() == ["a", "1.2"]
    assert lines[3].startswith("b (1 failed)")


def test_markdown_has_the_best_of_each_column_in_bold():
    scores = [score("a", 1.0), score("b", 2.0)]
    scores += [
        score("a", 10.0, "c", key="contact_iou_pct"),
        score("b", 20.0, "c", key="contact_iou_pct"),
    ]
    lines = list(as_markdown(blocks_of(scores, ["a", "b"])))
    assert lines == [
        "| noise | method | MPJPE, mm | C-IoU, % |",
        "|---|---|---:|---:|",
        "| taco, gauss | a | **1.0** | 10.0 |",
        "|  | b | 2.0 | **20.0** |",
    ]


def test_a_method_without_a_value_says_so():
    scores = [score("a", 1.0), score("b", 2.0, key="depth_mm")]
    lines = list(as_markdown(blocks_of(scores, ["a", "b"])))
    assert lines[-1] == "|  | b | n/a | **2.00** |"
