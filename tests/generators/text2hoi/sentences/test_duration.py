import pytest

from geneoh.errors import InputError
from geneoh.generators.text2hoi.sentences.duration import number_of, stated_length, without_amounts
from geneoh.generators.text2hoi.sentences.prompt import read_prompt


@pytest.mark.parametrize(
    ("sentence", "rest", "frames"),
    [
        ("Lift the mug for two seconds", "Lift the mug", 60),
        ("shake it for about 2.5 seconds with both hands", "shake it with both hands", 75),
        ("lift the mug in 90 frames.", "lift the mug .", 90),
        ("lift the mug for a second", "lift the mug", 30),
        ("lift it for half a second", "lift it", 15),
        ("lift it for 1/2 a second", "lift it", 15),
        ("lift it for 2/3 of a second", "lift it", 20),
        ("pour for one and a half seconds", "pour", 45),
        ("pour for one second and a half", "pour", 45),
        ("pour for at least 2 seconds", "pour", 60),
        ("lift it for three quarters of a second", "lift it", 22),
        ("lift it for 2 to 3 seconds", "lift it", 90),
        ("lift it for 2-3 seconds", "lift it", 90),
        ("lift it for 1,500 ms", "lift it", 45),
        ("lift it for 1,5 seconds", "lift it", 45),
        ("lift it for a couple of seconds", "lift it", 60),
        ("a 3-second lift", "a lift", 90),
        ("shake it 2s", "shake it", 60),
        ("shake it for a minute", "shake it", 1800),
        ("shake it for 1500 ms", "shake it", 45),
        ("shake it for 1/2 second", "shake it", 15),
        ("shake it for 1 1/2 seconds", "shake it", 45),
        ("shake it for 500 milliseconds", "shake it", 15),
        ("shake it for forty-five frames", "shake it", 45),
        ("shake it for a hundred and twenty-five frames", "shake it", 125),
        ("shake it for twenty-five to thirty-five frames", "shake it", 35),
        ("shake it for two-three seconds", "shake it", 90),
        ("shake it for two-and-a-half seconds", "shake it", 75),
        ("shake it for 2 and a half seconds", "shake it", 75),
        ("shake it for three-quarters of a second", "shake it", 22),
        ("shake it for one-half of a second", "shake it", 15),
        ("shake it for half-a-second", "shake it", 15),
        ("shake it for .5 seconds", "shake it", 15),
    ],
)
def test_a_length_is_taken_out_of_the_sentence(sentence, rest, frames):
    found, stated = stated_length(sentence)
    assert (found, stated.frames) == (rest, frames)


@pytest.mark.parametrize(
    "sentence",
    [
        "lift the second cup",
        "lift a second cup with one hand",
        "lift a frame with the left hand",
        "one frame is lifted",
        "lift the mug after two seconds",
        "turn it every second",
        "lift the two mugs",
        f"lift it for {'9' * 400} seconds",
    ],
)
def test_other_times_and_numbers_are_no_length(sentence):
    assert stated_length(sentence) == (sentence, None)


@pytest.mark.parametrize(
    ("sentence", "rest", "amount"),
    [
        ("lift the mug by 10 cm with the left hand", "lift the mug with the left hand", "by 10 cm"),
        ("lift it about half a meter with one hand", "lift it with one hand", "about half a meter"),
        ("lift it by at least 10 cm with one hand", "lift it with one hand", "by at least 10 cm"),
        ("tilt it by 45° with the left hand", "tilt it with the left hand", "by 45°"),
        ("lift it by 10-15 cm with one hand", "lift it with one hand", "by 10-15 cm"),
        ("lift it two to three cm with one hand", "lift it with one hand", "two to three cm"),
        ("lift it by .5 m with one hand", "lift it with one hand", "by 0.5 m"),
        ("shake it three times with both hands", "shake it with both hands", "three times"),
        ("pour twice with the left hand", "pour with the left hand", "twice"),
    ],
)
def test_distances_angles_and_counts_are_left_out_with_a_note(sentence, rest, amount):
    prompt = read_prompt(sentence)
    assert prompt.network_text == rest
    (note,) = (note for note in prompt.notes if "is not followed" in note)
    assert note.startswith(f"'{amount}' ")


@pytest.mark.parametrize("sentence", ["lift the 2 cups", "lift it at all times", "pass a foot"])
def test_other_numbers_stay_in_the_sentence(sentence):
    assert without_amounts(sentence) == (sentence, ())


def test_numbers_are_read_in_digits_and_words():
    said = ("2,5", "twenty-five", "a hundred and twenty", "two hundred", "a quarter of a", "twelve")
    assert [number_of(each) for each in said] == [2.5, 25, 120, 200, 0.25, 12]


def test_a_stated_length_counts_unless_another_one_is_asked_for():
    sentence = "lift the mug with the left hand for two seconds"
    prompt = read_prompt(sentence)
    assert (prompt.sentence, prompt.network_text) == (sentence, "lift the mug with the left hand")
    assert prompt.frames == 60
    assert prompt.notes == ("the length is 60 frames by 'for two seconds'",)
    prompt = read_prompt(sentence.replace("two", "ten"), frames=50)
    assert prompt.frames is None
    assert prompt.notes[0].endswith("by 'for ten seconds', but 50 are asked for")


@pytest.mark.parametrize("length", ["ten seconds", "0 seconds", "one frame", "151 frames"])
def test_a_length_that_no_clip_has_is_refused(length):
    with pytest.raises(InputError, match=rf"2 to 150 frames, .* found 'for {length}'"):
        read_prompt(f"lift the mug for {length}")


def test_two_lengths_are_refused():
    with pytest.raises(InputError, match="one length, found 'for two seconds' and 'for 3 seconds'"):
        stated_length("lift it for two seconds and hold it for 3 seconds")


@pytest.mark.parametrize(
    ("said", "told", "frames"),
    [
        ("at 24 fps", "'at 24 fps' is not followed: the clip has 30 frames a second", None),
        ("at 24 frames per second", "'at 24 frames per second' is not followed", None),
        ("for 48 frames at 60 frames/s", "'at 60 frames/s' is not followed", 48),
        ("at thirty frames a second for 2 seconds", None, 60),
    ],
)
def test_a_frame_rate_is_no_length_and_another_one_is_told(said, told, frames):
    prompt = read_prompt(f"lift the mug with the left hand {said}")
    assert (prompt.network_text, prompt.frames) == ("lift the mug with the left hand", frames)
    notes = [note for note in prompt.notes if "not followed" in note]
    assert [note.startswith(told or "none") for note in notes] == [True] * (told is not None)


@pytest.mark.parametrize("said", ["for -2 seconds", "for minus two seconds"])
def test_a_negative_length_is_refused(said):
    with pytest.raises(InputError, match=f"expected a length of 2 to 150 frames.*found '{said}'"):
        read_prompt(f"lift the mug {said}")
