"""Exceptions that reach the user, each one sentence: where, what was expected, what came, cure."""


class GeneOHError(Exception):
    """Base of every error geneoh raises on purpose."""


class InputError(GeneOHError, ValueError):
    """A file, field or array the user gave cannot be used as it is."""


class ConfigError(GeneOHError, ValueError):
    """A setting is unknown, has the wrong type or contradicts another one."""


class MissingAssetError(GeneOHError, FileNotFoundError):
    """A file the user must supply (a MANO model, weights, a data set) is not where it should be."""


class CheckpointError(GeneOHError):
    """Saved weights do not fit the network that should load them."""


class NumericalError(GeneOHError, ArithmeticError):
    """A computation on valid input left the range of finite numbers."""
