"""Means, spreads, intervals and ranks of made-up scores."""

import random

import pytest

from geneoh.evaluation.scores import Score
from geneoh.evaluation.tables import (
    FEWEST_RECORDINGS,
    as_markdown,
    as_text,
    blocks_of,
    cell_of,
    recordings_interval,
    seed_agreement,
)

OF_TACO = ("tool_right", "target_left")  # what the clips of both hands of a recording are named by


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
    assert (cell.low, cell.high) == (None, None)  # of two clips nobody knows how others scatter


def test_one_seed_has_no_spread_and_one_value_no_interval():
    cell = cell_of(TWO_BY_TWO[:1], "mpjpe_mm")
    assert (cell.mean, cell.deviation, cell.low, cell.high) == (1.0, None, None, None)
    assert cell_of(TWO_BY_TWO, "depth_mm") is None


def test_an_error_bar_is_the_interval_also_where_a_seed_lacks_a_value():
    clips = [(f"{place}", float(place)) for place in range(FEWEST_RECORDINGS)]
    scores = [score("a", value, clip) for clip, value in clips]
    scores += [score("a", 100.0 + value, clip, 22) for clip, value in clips[:2]]
    cell = cell_of(scores, "mpjpe_mm")
    assert cell.ends == (cell.low, cell.high)
    assert sum(cell.ends) / 2 == pytest.approx(sum(each.values["mpjpe_mm"] for each in scores) / 10)
    assert cell_of(TWO_BY_TWO, "mpjpe_mm").ends == pytest.approx((3 - 2**0.5, 3 + 2**0.5))
    assert cell_of(TWO_BY_TWO[:1], "mpjpe_mm").ends is None


def test_the_interval_holds_the_true_mean_as_often_as_it_says():
    """Eight recordings of unequal numbers of windows, which differ more than their windows do."""
    drawn, held = random.Random(0), 0
    for _ in range(1000):
        recordings = [[drawn.gauss(0, 1)] * drawn.randint(1, 6) for _ in range(FEWEST_RECORDINGS)]
        values = [[base + drawn.gauss(0, 0.3) for base in each] for each in recordings]
        low, high = recordings_interval(values)
        held += low <= 0 <= high
    assert 920 <= held <= 975
    assert recordings_interval(values[1:]) == (None, None)


def test_windows_and_hands_of_a_recording_count_once():
    names = ("s1/mug_2_left_00000", "s1/mug_2_right_00030", "s1/mug_2_00100_right_00030")
    windows = [
        score("a", float(place), clip) for place, clip in enumerate(names * FEWEST_RECORDINGS)
    ]
    assert cell_of(windows, "mpjpe_mm").low is None
    hands = [f"stir/{place}_{held}_00000" for place in "1234567" for held in OF_TACO]
    assert cell_of([score("a", 1.0, name) for name in hands], "mpjpe_mm").low is None
    made = [score("a", float(place), f"mug_0000{place}") for place in range(FEWEST_RECORDINGS)]
    assert cell_of(made, "mpjpe_mm").low == pytest.approx(3.5 - 2.365 * 6**0.5 / 8**0.5, abs=1e-3)


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


def test_a_mean_over_fewer_cases_than_others_is_told():
    """A method that lets go of the object in its worst clip has no slip there to answer for."""
    scores = [score("a", 9.0, "c", key="slip_mm_s"), score("a", 1.0, "d", key="slip_mm_s")]
    scores += [score("b", 1.0, "c", key="slip_mm_s"), score("b", None, "d")]
    scores += [score("f", 1.0, "c", key="slip_mm_s"), score("f", None, "d", failed="no")]
    (block,) = blocks_of(scores, ["a", "b", "f"])
    (said,) = block.gaps()
    assert said.startswith("tip slip under gauss is a mean over fewer cases")
    assert said.endswith(": 1 of 2 with b.")


def test_a_method_without_a_value_says_so():
    scores = [score("a", 1.0), score("b", 2.0, key="depth_mm")]
    lines = list(as_markdown(blocks_of(scores, ["a", "b"])))
    assert lines[-1] == "|  | b | n/a | **2.00** |"
