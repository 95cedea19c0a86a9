"""A user's sentence: read from the command line or a file, and refused where it is not English."""

import difflib
from collections.abc import Collection, Sequence
from pathlib import Path

from geneoh.errors import InputError, shortened
from geneoh.files.reading import read_bytes

LONGEST = 60  # words; a sentence of Text2HOI has 8, a description of BOTH57M 14 to 33
ENGLISH = 0.4  # least share of words that must be known for a sentence to count as English
LEAST_SIMILARITY = 0.8  # least similarity (difflib) of a misspelt word to the word that is meant
FILE_LIMIT = 100_000  # largest size of a file with a prompt, bytes


def prompt_text(argument: str) -> str:
    """The sentence of a command line: the argument, or the text of a file (`@FILE` or a path).

    Raises:
        InputError: the file cannot be read as one line of text.
    """
    path = Path(argument.removeprefix("@").strip())
    try:
        in_file = argument.startswith("@") or (argument.strip() != "" and path.is_file())
    except OSError:  # too long for the name of a file
        in_file = False
    if not in_file:
        return argument
    try:
        lines = read_bytes(path, FILE_LIMIT).decode("utf-8-sig").split("\n")
    except UnicodeDecodeError as error:
        raise InputError(
            f"{path}: expected one English sentence in UTF-8, found other bytes; save it as text"
        ) from error
    written = [line.strip() for line in lines if line.strip()]
    if len(written) > 1:
        raise InputError(
            f"{path}: expected one sentence, found {len(written)} lines; keep one in the file"
        )
    return written[0] if written else ""


def refused(sentence: str, why: str) -> InputError:
    """The error for a sentence; `why` says what was expected and found, and what to do."""
    return InputError(f"prompt '{shortened(sentence, 60)}': expected {why}")


def check_english(
    sentence: str, words: Sequence[str], known: Collection[str], *, on: str, example: str
) -> None:
    """Raise `InputError` for a text without words, with too many, or with too few known ones.

    For the message, `on` is the topic of valid sentences and `example` is one of them.
    """
    remedy = f"write one such as {example}"
    if not words:
        raise refused(sentence, f"an English sentence, found no words; {remedy}")
    if len(words) > LONGEST:
        few = f"one sentence of at most {LONGEST} words, found {len(words)}; say it shorter"
        raise refused(sentence, few)
    meant = [nearest_word(word, known) for word in words]
    # Words that only resemble ours may be another language's: "ella aplaude", "il saute".
    alike_alone = len(words) > 1 and not set(words).intersection(meant)
    understood = 0 if alike_alone else sum(word is not None for word in meant)
    if understood < ENGLISH * len(words):
        known_words = f"{understood} known words among {len(words)}"
        raise refused(sentence, f"an English sentence on {on}, found {known_words}; {remedy}")


def nearest_word(word: str, known: Collection[str]) -> str | None:
    """A known English word with the same first letter that equals or resembles the word."""
    if word in known or word.removesuffix("s") in known:
        return word
    if len(word) < 4:
        return None
    same = sorted(e for e in known if e[0] == word[0] and abs(len(e) - len(word)) <= 1)
    swapped = [each for each in same if sorted(each) == sorted(word)]
    near = swapped or difflib.get_close_matches(word, same, 1, LEAST_SIMILARITY)
    return near[0] if near else None
