"""Sentences of users as text; what they ask for is tested with each generator."""

import pytest

from geneoh.errors import InputError
from geneoh.generators.sentences import nearest_word, prompt_text


def test_a_prompt_may_stand_in_a_file(tmp_path):
    file = tmp_path / "prompt.txt"
    file.write_bytes(b"\xef\xbb\xbfLift the mug with the left hand.\r\n\n")
    assert prompt_text(f"@{file}") == "Lift the mug with the left hand."
    assert prompt_text(str(file)) == "Lift the mug with the left hand."
    assert prompt_text("Lift the mug") == "Lift the mug"
    assert prompt_text("word " * 200) == "word " * 200
    assert prompt_text("") == ""
    file.write_text("")
    assert prompt_text(f"@{file}") == ""


def test_files_without_one_sentence_are_refused(tmp_path):
    file = tmp_path / "prompt.txt"
    with pytest.raises(InputError, match=r"prompt\.txt"):
        prompt_text(f"@{file}")
    file.write_text("Lift the mug.\nOpen the box.\n")
    with pytest.raises(InputError, match="expected one sentence, found 2 lines"):
        prompt_text(f"@{file}")
    file.write_bytes(b"\x89PNG\r\n\xff\xfe")
    with pytest.raises(InputError, match="found other bytes"):
        prompt_text(f"@{file}")


def test_words_are_matched_over_one_typing_error():
    known = frozenset(("lift", "shake", "mug", "put"))
    assert nearest_word("lfit", known) == "lift"
    assert nearest_word("shaek", known) == "shake"
    assert nearest_word("flurble", known) is None
    assert nearest_word("mugs", known) == "mugs"
    assert nearest_word("pit", known) is None
