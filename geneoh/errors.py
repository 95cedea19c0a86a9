"""Exceptions that reach the user.

Each message is one sentence that names the file and the field, what was expected, what was found
and what to do about it. The command line prints it as one line, without a traceback.
"""


class GeneOHError(Exception):
    """Base class of every error that geneoh raises on purpose.

    Catch it to handle all of them at once; any other exception is a defect of geneoh.
    """


class InputError(GeneOHError, ValueError):
    """A file, a field or an array that the user gave cannot be used as it is.

    The message says how to change it. The command line ends with exit code 2.
    """


class ConfigError(GeneOHError, ValueError):
    """A setting is unknown, has the wrong type, is out of range or contradicts another setting.

    Raised for options of commands, for TOML files and for fields of `geneoh.Options`.
    """


class MissingAssetError(GeneOHError, FileNotFoundError):
    """A file that the user must supply is not where it should be.

    Such as a MANO model, a folder of weights or a data set; the message says where to get it.
    """


class CheckpointError(GeneOHError):
    """Saved weights cannot be read, or do not fit the network that should load them.

    Usual causes are a file of another version of geneoh and weights of another stage.
    """


class EndedElsewhereError(GeneOHError):
    """Another process of the same run has ended it and reports why; this one prints nothing."""

    def __init__(self, exit_code: int) -> None:
        """The exit code that this process ends with."""
        super().__init__("another process of the run has ended it")
        self.exit_code = exit_code


def numbered(count: int, noun: str) -> str:
    """A number and what it counts, such as "1 window" or "4 windows"."""
    return f"{count} {noun}{'' if count == 1 else 's'}"


def shortened(text: str, length: int) -> str:
    """A text for a message, cut to a length."""
    return text if len(text) <= length else f"{text[:length]}..."
