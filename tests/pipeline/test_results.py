"""Results as text."""

from dataclasses import replace
from types import SimpleNamespace

import fake_cleaning
import pytest
import torch
from fake_cleaning import write_clips

import geneoh
from geneoh.pipeline.options import Options


@pytest.fixture
def result(tmp_path):
    write_clips(tmp_path, 1)
    sequence = geneoh.load(tmp_path / "clip0.npz", obj=tmp_path / "clip0.obj")
    result = fake_cleaning.denoise(sequence, Options())
    hand = next(iter(result.hands.values()))
    filled = torch.arange(sequence.frames) < 2
    samples = hand.samples.expand(3, -1, -1, -1)
    hand = replace(hand, filled=filled, samples=samples, seconds={"fit": 1.25})
    hand = replace(hand, moved=0.012, moved_most=0.0971)
    return replace(
        result,
        hands={"right": hand},
        notes=("so",),
        doubts=("odd",),
        hands_in_each_other=(0.02, 0.0),
    )


def test_a_result_as_text_says_what_changed(result):
    lines = str(result).splitlines()
    assert lines[:2] == [
        "note: odd",
        "right hand: 1 window, 3 samples (their mean kept); fit 1.2 s",
    ]
    assert "  penetration depth, mean               1.00 ->     0.50 mm" in lines
    assert lines[-5:] == [
        "  keypoints moved by 12.0 mm on average, 97.1 mm in the frame with most",
        "  2 unobserved frames filled in; see right_filled in the file",
        "  note: a <note>",
        "depth of the hands in each other, deepest: 20.0 -> 0.00 mm",
        "note: so",
    ]


def test_a_file_holds_how_deep_two_hands_were_in_each_other(result):
    told = "depth of the hands in each other, deepest: 20.0 -> 0.00 mm"
    assert result.extra_arrays()["notes"].tolist() == ["odd", "so", told, "right hand: a <note>"]
    apart = replace(result, hands_in_each_other=(0.0, 0.0))
    assert told not in apart.sentences()
    assert len(apart.sentences()) == len(replace(result, hands_in_each_other=None).sentences()) == 3


def test_of_made_hands_a_file_holds_that_they_go_through_a_wall(result):
    hand = result.hands["right"]
    hand = replace(hand, after=replace(hand.after, through_fraction=0.5))
    made = replace(result, hands={"right": hand})
    (note,) = (line for line in made.measures() if "a thin wall of the object in 50.0%" in line)
    side, words = made.notes_on_made_hands()[0].split(": ", 1)
    assert (side, f"  note: {words}") == ("right hand", note)
    assert made.notes_on_made_hands()[1:] == result.notes_on_made_hands() == ("so",)


def test_a_notebook_shows_the_text_of_a_result_and_not_all_of_its_fields(result):
    written = []
    result._repr_pretty_(SimpleNamespace(text=written.append), False)
    assert written == [str(result)]
    assert repr(result).startswith("Denoised(sequence=")


@pytest.mark.parametrize("rate", [0.5, 1, 2])
def test_chosen_frames_bring_the_samples_of_their_time(result, rate):
    hand, count = result.hands["right"], result.sequence.frames
    drawn = round((count - 1) * rate) + 1
    place = torch.linspace(0, count - 1, drawn)[None, :, None, None].expand(2, -1, 21, 3)
    result = replace(result, hands={"right": replace(hand, samples=place)})
    for frames, first, last in ((slice(1, 5), 1, 4), (slice(0, 5, 2), 0, 4), (slice(4, 5), 4, 4)):
        times = result[frames].hands["right"].samples[0, :, 0, 0]
        assert len(times) == pytest.approx((last - first) * rate + 1, abs=1.1)
        torch.testing.assert_close(
            times[[0, -1]], torch.tensor([first, last]).float(), atol=1.5, rtol=0
        )
    shuffled = result[torch.tensor([5, 0, 3])].hands["right"].samples
    expected = torch.tensor([5.0, 0.0, 3.0])
    torch.testing.assert_close(shuffled[0, :, 0, 0], expected, atol=1.5, rtol=0)
