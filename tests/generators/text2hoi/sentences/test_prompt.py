import pytest

from geneoh.errors import InputError
from geneoh.generators.text2hoi.sentences.prompt import named_verbs, read_prompt


@pytest.mark.parametrize(
    ("sentence", "verb", "hands"),
    [
        ("Pour from the kettle with the right hand.", "pour", "right hand"),
        ("Both hands lift a box.", "lift", "both hands"),
        ("A lock is opened by the left hand.", "open", "left hand"),
        ("pick the mug up with your left hand", "lift", "left hand"),
        ("use the left hand to slide the plate to the right", "slide", "left hand"),
        ("left-handed, put the cup down", "put down", "left hand"),
        ("hand over the phone from one hand to the other", "pass", "both hands"),
        ("use the left hand to hand over the phone", "pass", "left hand"),
        ("Look at the can opener with the left hand and the right hand", "inspect", "both hands"),
        ("slide the book from the left to the right with the right hand", "slide", "right hand"),
        ("shake the bottle with two hands", "shake", "both hands"),
        ("inspect the toy from both sides with the left hand", "inspect", "left hand"),
        ("the left hand holds the jar while the right hand opens it", "open", "both hands"),
        ("he shook the bottle with the right hand", "shake", "right hand"),
        ("she gave the cup from the left hand to the right hand", "pass", "both hands"),
    ],
)
def test_verb_and_hands_of_plain_sentences(sentence, verb, hands):
    prompt = read_prompt(sentence)
    assert (prompt.verb, prompt.hands, prompt.known) == (verb, hands, True)
    known = ("has no joint", "choose the direction")
    assert [note for note in prompt.notes if not any(words in note for words in known)] == []


@pytest.mark.parametrize(
    ("sentence", "verb", "hands"),
    [
        ("Lfit the mug wiht the rihgt hand", "lift", "right hand"),
        ("shkae the bottle with boht hands", "shake", "both hands"),
        ("opne the laptop with the letf hand", "open", "left hand"),
    ],
)
def test_misspelt_sentences_are_read(sentence, verb, hands):
    prompt = read_prompt(sentence)
    assert (prompt.verb, prompt.hands) == (verb, hands)


def test_a_verb_that_was_never_made_gives_the_nearest_and_says_so():
    prompt = read_prompt("Drink from the mug with the right hand.")
    assert (prompt.verb, prompt.known) == ("tilt", False)
    assert prompt.notes == ("'drink from' was never learned; the nearest verb is 'tilt'",)


def test_to_pinch_is_to_hold_and_no_misspelt_punch():
    prompt = read_prompt("Pinch the mug with the right hand.")
    assert (prompt.verb, prompt.known) == ("lift", False)
    assert prompt.notes == ("'pinch' was never learned; the nearest verb is 'lift'",)


def test_a_verb_that_moves_two_parts_as_one_is_told():
    told = "the closed object moves as a whole: 'open' or 'close' moves one part"
    sentence = "Lift the lid with the right hand."
    assert read_prompt(sentence, jointed=True).notes == (told,)
    assert read_prompt(sentence).notes == ()
    assert read_prompt("Open the lid with the right hand.", jointed=True).notes == ()


@pytest.mark.parametrize(
    ("sentence", "told"),
    [
        ("Flip the lid open", "open the lid"),
        ("flip open the lid of the box", "open the lid of the box"),
        ("swing the door wide open", "open the door wide"),
        ("the right hand slides the drawer shut", "the right hand closes the drawer"),
        ("pull the door closed with both hands", "close the door with both hands"),
        ("slamming the lid shut", "closing the lid"),
        ("the laptop is flipped open by the left hand", "the laptop is opened by the left hand"),
        ("lift the box, then push its door closed", "lift the box then close its door"),
    ],
)
def test_a_verb_that_ends_open_or_shut_opens_or_closes(sentence, told):
    verb = "open" if "open" in sentence else "close"
    for jointed in (False, True):
        prompt = read_prompt(sentence, jointed=jointed)
        assert (prompt.verb, prompt.known, prompt.network_text) == (verb, True, told)


@pytest.mark.parametrize("said", ["pull the drawer open", "push it shut", "pull open the drawer"])
def test_phrases_for_open_and_close_that_are_learned_stay(said):
    prompt = read_prompt(said, jointed=True)
    assert (prompt.verb in ("open", "close"), prompt.network_text) == (True, said)


@pytest.mark.parametrize(
    ("said", "verb", "alone"),
    [
        ("screw the lid off", "open", "rotate"),
        ("twist the cap off with the left hand", "open", "rotate"),
        ("take off the lid", "open", "carry"),
        ("he took off the lid", "open", "carry"),
        ("lift the lid off the pot", "open", "lift"),
        ("unscrew the cap of the bottle", "open", "rotate"),
        ("the left hand removes the lid", "open", "lift"),
        ("screw the lid back on", "close", "rotate"),
        ("put the lid on the box", "close", "put down"),
        ("put the lid on the table", "put down", "put down"),
        ("the cap is screwed off", "open", "rotate"),
        ("the lid of the jar is being taken off by the left hand", "open", "carry"),
        ("the lid is screwed back on", "close", "rotate"),
        ("press on the lid", "press", "press"),
        ("take the box off the table", "carry", "carry"),
    ],
)
def test_a_lid_that_comes_off_opens_an_object_of_two_parts(said, verb, alone):
    assert read_prompt(said, jointed=True).verb == verb
    assert read_prompt(said).verb == alone


@pytest.mark.parametrize(
    ("said", "told"),
    [
        ("twist it off", "open it"),
        ("unscrew it with the left hand", "open it with the left hand"),
        ("put it back on", "close it"),
        ("bring the lid down to close", "close the lid"),
        ("lift the lid with the left hand to open it", "open the lid with the left hand"),
        ("the left hand lowers the lid to close the box", "the left hand closes the box"),
        ("lower the lid with the left hand to close the box", "with the left hand close the box"),
        ("move the door until it is shut", "close the door"),
        ("raising the lid all the way up until it's fully open", "opening the lid"),
        ("pull the top drawer out with the left hand", "open the top drawer with the left hand"),
        ("slides out the drawer of the desk", "opens the drawer of the desk"),
        ("push the drawer back in", "close the drawer"),
        ("pushing in the tray with both hands", "closing the tray with both hands"),
        ("push the drawer in the corner", "push the drawer in the corner"),
        ("take it off the table", "take it off the table"),
        ("put it on the plate", "put it on the plate"),
        ("the lid is put on the table", "the lid is put on the table"),
        ("push the box to the open door", "push the box to the open door"),
    ],
)
def test_what_a_verb_is_for_opens_or_closes_an_object_of_two_parts(said, told):
    assert read_prompt(said, jointed=True).network_text == told
    assert read_prompt(said).network_text == said


@pytest.mark.parametrize(
    ("said", "verb"),
    [
        ("pull the open drawer to the left", "slide"),
        ("carry the closed laptop with both hands", "carry"),
        ("shake the closed jar", "shake"),
        ("pick up the box with the open hand", "lift"),
    ],
)
def test_an_object_that_is_open_or_closed_stays_so(said, verb):
    prompt = read_prompt(said)
    assert (prompt.verb, prompt.network_text) == (verb, said)


def test_an_outcome_that_is_ruled_out_is_refused():
    with pytest.raises(InputError, match="found only 'don't open'"):
        read_prompt("don't flip the lid open")


def test_an_unknown_verb_gives_some_verb_and_says_so():
    prompt = read_prompt("Yodel the mug with the right hand.")
    assert not prompt.known
    assert prompt.notes[0].startswith("no verb of the sentence is known; the nearest is '")


def test_an_unknown_noun_is_fine():
    prompt = read_prompt("Lift the flurble with the right hand.")
    assert prompt.known
    assert prompt.notes == ()


def test_a_sentence_without_hands_gets_the_right_one_or_both_to_pass():
    one = read_prompt("Lift the mug.")
    assert one.hands == "right hand"
    assert one.notes == ("the sentence names no hand; 'right hand' is taken",)
    assert read_prompt("Pass the mug.").hands == "both hands"


@pytest.mark.parametrize(("start", "end"), [("left", "right"), ("right", "left")])
def test_a_direction_of_passing_is_read(start, end):
    prompt = read_prompt(f"Pass the cup from the {start} hand to the {end} hand.")
    assert (prompt.verb, prompt.hands, prompt.known) == ("pass", "both hands", True)
    assert (prompt.giver, prompt.notes) == (start, ())
    assert read_prompt(f"Carry it from {start} to {end} with both hands.").giver is None


@pytest.mark.parametrize(
    ("sentence", "both"),
    [
        ("lift it with the left hand and the left hand", True),
        ("the left hand and left hand lift it", True),
        ("lift it with my left and left hand", True),
        ("the left hand lifts the mug and the left hand shakes it", True),
        ("lift it with the left hand with the left hand", False),
    ],
)
def test_a_hand_that_is_named_twice_is_one_hand(sentence, both):
    assert read_prompt(sentence).hands == "left hand"
    if both:  # the same with one of each
        assert read_prompt(sentence.replace("left", "right", 1)).hands == "both hands"


@pytest.mark.parametrize("side", ["left", "right"])
def test_what_a_hand_passes_to_itself_is_refused(side):
    with pytest.raises(InputError, match=f"found the {side} hand twice"):
        read_prompt(f"Pass the mug from the {side} hand to the {side} hand.")


def test_two_hands_that_contradict_each_other_are_refused():
    with pytest.raises(InputError, match=r"write 'both hands', or name one"):
        read_prompt("With the left hand lift the mug with the right hand.")


@pytest.mark.parametrize(
    ("sentence", "hands", "told"),
    [
        ("lift it, without using the left hand", "right hand", "lift it with the right hand"),
        ("don't use your right hand to lift it", "left hand", "to lift it with the left hand"),
        ("lift it with the right hand, not the left", "right hand", "lift it with the right hand"),
        ("lift it, but not with the left hand", "right hand", "lift it with the right hand"),
        ("slide it not to the left with the left hand", "left hand", None),
    ],
)
def test_a_hand_that_is_ruled_out_leaves_the_other_one(sentence, hands, told):
    prompt = read_prompt(sentence)
    assert (prompt.hands, prompt.network_text) == (hands, told or sentence)
    assert [note for note in prompt.notes if "choose the direction" not in note] == []


@pytest.mark.parametrize("thing", ["the coat", "up my coat", "it up", "a picture"])
def test_a_hand_that_hangs_something_does_not_rest(thing):
    prompt = read_prompt(f"the left hand hangs {thing}")
    assert (prompt.verb, prompt.hands) == ("put down", "left hand")


@pytest.mark.parametrize(
    ("sentence", "found"),
    [
        ("lift the cup with neither hand", "'neither hand'"),
        ("lift the cup with no hands", "'no hands'"),
        ("lift the cup without using your hands", "'without using your hands'"),
        ("do not use both hands to lift the cup", "'not use both hands'"),
        ("lift the cup without the left or the right hand", "neither of the two"),
        ("lift it with both hands, without the left hand", "left hand both named and ruled out"),
    ],
)
def test_hands_that_are_all_ruled_out_are_refused(sentence, found):
    with pytest.raises(InputError, match=f"expected hands that act, found .*{found}"):
        read_prompt(sentence)


@pytest.mark.parametrize(
    "sentence",
    [
        "don't lift the cup",
        "don\u2019t lift the cup",
        "do not ever lift the cup with the left hand",
        "the cup is not lifted",
        "don't put the cup down",
    ],
)
def test_a_verb_that_is_ruled_out_is_refused(sentence):
    with pytest.raises(InputError, match="expected an action that hands do, found only '"):
        read_prompt(sentence)


def test_beside_another_verb_one_that_is_ruled_out_is_noted():
    prompt = read_prompt("Carry the mug with the left hand without tilting it")
    assert (prompt.verb, prompt.network_text) == ("carry", "carry the mug with the left hand")
    assert prompt.notes == ("'without tilting it' is not followed",)


@pytest.mark.parametrize("sentence", ["", "   ", "...", "\n\t"])
def test_an_empty_sentence_is_refused(sentence):
    with pytest.raises(InputError, match=r"found no words; write one such as"):
        read_prompt(sentence)


@pytest.mark.parametrize(
    "sentence",
    [
        "Hebe die Tasse mit der rechten Hand.",
        "Soulevez la tasse avec la main droite.",
        "Levanta la taza con la mano derecha.",
        "右手でカップを持ち上げる",
        "Поднимите чашку правой рукой",
        "sdkjf weoiru xcvm qwpoei",
    ],
)
def test_a_sentence_that_is_not_english_is_refused(sentence):
    with pytest.raises(InputError, match="expected an English sentence"):
        read_prompt(sentence)


def test_a_whole_page_is_refused():
    with pytest.raises(InputError, match="at most 60 words, found 80"):
        read_prompt("lift the mug up now with it please " * 10)


def test_white_space_in_a_sentence_is_one_space():
    assert read_prompt(" Lift\nthe  mug ").sentence == "Lift the mug"


def test_a_longer_verb_hides_a_shorter_one_in_it():
    assert list(named_verbs(["push", "down", "the", "lid"])) == ["press"]
    assert list(named_verbs(["push", "the", "lid"])) == ["slide"]
    assert list(named_verbs(["pull", "open", "the", "drawer"])) == ["open"]
    assert named_verbs(["the", "lock", "and", "a", "place"]) == {}


@pytest.mark.parametrize(
    ("sentence", "hands"),
    [
        ("the left hand picks up the mug, the right hand rests", "left hand"),
        ("lift the mug with the right hand, the left does nothing", "right hand"),
        ("lift the mug using the right hand while the left hand is still", "right hand"),
        ("the right one stays still and the left hand shakes the toy", "left hand"),
        ("lift the mug and keep your left hand away", "right hand"),
        ("keeping the left hand still, lift the mug with the right hand", "right hand"),
        ("lift the mug, left hand idle", "right hand"),
        ("lift the mug using anything but the left hand", "right hand"),
        ("the left hand hangs down while the mug is lifted", "right hand"),
        ("lift the mug. The left hand isn't used.", "right hand"),
        ("the left hand is not moving, the mug is lifted", "right hand"),
        ("the left hand doesn't move, lift the mug", "right hand"),
    ],
)
def test_a_hand_that_rests_takes_no_part(sentence, hands):
    assert read_prompt(sentence).hands == hands


@pytest.mark.parametrize("said", ["keep the left hand on the mug and lift it", "left hand lifts"])
def test_a_hand_that_is_kept_at_the_object_takes_part(said):
    assert read_prompt(said).hands == "left hand"


def test_a_hand_that_rests_on_the_object_does_take_part():
    said = "the left hand rests on the lid and the right hand lifts the jar"
    assert read_prompt(said).hands == "both hands"


@pytest.mark.parametrize(
    "sentence", ["pass the apple from left to right", "hand the mug over to the right hand"]
)
def test_what_is_passed_to_a_hand_takes_both_and_comes_from_the_other(sentence):
    prompt = read_prompt(sentence)
    assert (prompt.verb, prompt.hands) == ("pass", "both hands")
    assert prompt.giver == "left"


def test_the_hand_that_passes_something_to_someone_is_one():
    assert read_prompt("pass the mug to the left with the right hand").hands == "right hand"


def test_a_verb_is_known_without_its_particle():
    prompt = read_prompt("pour water with the left hand")
    assert (prompt.verb, prompt.known, prompt.notes) == ("pour", True, ())


def test_of_two_actions_the_one_that_is_left_out_is_told():
    prompt = read_prompt("lift the mug and then put it down with the left hand")
    assert prompt.notes == ("one action is made, 'put down'; 'lift' is left out",)


@pytest.mark.parametrize(
    ("more", "left_out"),
    [
        ("and twirl it", "twirl"),
        ("then slowly twirls the mug", "twirls"),
        ("and then put it on the saucer", "put"),
        ("and throw it", "throw"),
        ("and hold it", ""),
        ("and the shiny saucer", ""),
        ("slowly and carefully", ""),
        ("and a gizmo", ""),
    ],
)
def test_a_further_action_that_was_never_learned_is_told(more, left_out):
    prompt = read_prompt(f"grab the mug {more} with the left hand")
    told = f"one action is made, 'grab'; '{left_out}' is left out"
    assert (prompt.verb, prompt.notes) == ("lift", (told,) if left_out else ())


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ("left index finger", ["left index finger"]),
        ("right thumb and the right ring finger", ["right thumb", "right ring finger"]),
        ("right hand", []),
    ],
)
def test_fingers_that_are_named_are_not_followed_and_told(words, told):
    notes = read_prompt(f"press the phone with the {words}").notes
    end = "is not followed: the networks choose the fingers"
    assert notes == tuple(f"'{fingers}' {end}" for fingers in told)


def test_something_that_is_passed_from_one_hand_comes_to_the_other():
    prompt = read_prompt("pass the cup from the right hand")
    assert (prompt.hands, prompt.giver) == ("both hands", "right")


def test_a_verb_that_is_taken_for_a_misspelt_one_is_told():
    assert "'pitch' is read as 'pinch'" in read_prompt("pitch the mug").notes
    assert not any("is read as 'p" in note for note in read_prompt("pinch the mug").notes)


@pytest.mark.parametrize(
    ("sentence", "verb", "note"),
    [
        ("reopening the chest", "open", ""),
        ("return the mug to the table", "put down", ""),
        ("the lamp is adjusted", "rotate", ""),
        ("scoop rice with the spoon", "carry", "'scoop' was never learned"),
        ("rinse the cup", "slide", "'rinse' was never learned"),
    ],
)
def test_verbs_that_the_encoder_never_learned_are_read_by_their_meaning(sentence, verb, note):
    prompt = read_prompt(sentence, jointed=True)
    assert prompt.verb == verb
    assert any(note in each for each in prompt.notes)
    assert not any("no verb of the sentence" in each for each in prompt.notes)


@pytest.mark.parametrize("said", ["open the bottle", "cut the bread"])
def test_a_mesh_that_cannot_open_or_close_is_told(said):
    assert any("has no joint" in note for note in read_prompt(said).notes)


@pytest.mark.parametrize(
    ("sentence", "verb"),
    [
        ("pick up the coin with two fingers", "lift"),
        ("lift it between fingers", "lift"),
        ("with just one hand, lift the mug", "lift"),
        ("pour from the mug one-handed", "pour"),
        ("pass the mug single-handed", "pass"),
    ],
)
def test_fingers_and_one_hand_are_of_one_hand(sentence, verb):
    prompt = read_prompt(sentence)
    assert (prompt.verb, prompt.hands) == (verb, "right hand")
    assert prompt.notes == ("the sentence names no hand; 'right hand' is taken",)


@pytest.mark.parametrize(
    ("sentence", "way"),
    [
        ("carry the mug to the left with the right hand", "to the left"),
        ("slide the sponge forward with the left hand", "forward"),
        ("pass the mug to the left hand", None),
        ("pass the mug to the left", None),  # to the left hand
        ("pass the mug forward", "forward"),
        ("carry the mug to the table with the left hand", None),
    ],
)
def test_directions_are_noted(sentence, way):
    noted = [note for note in read_prompt(sentence).notes if "the direction" in note]
    assert [note.split("'")[1] for note in noted] == ([] if way is None else [way])


@pytest.mark.parametrize("sentence", ["slide the box to the left", "tilt it towards your left"])
def test_a_direction_names_no_hand(sentence):
    prompt = read_prompt(sentence)
    assert prompt.hands == "right hand"
    assert "the sentence names no hand; 'right hand' is taken" in prompt.notes
