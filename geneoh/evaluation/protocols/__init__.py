"""Which clips of a data set are scored, and the noise that is put on them."""

from geneoh.evaluation.protocols.clips import Clip
from geneoh.evaluation.protocols.options import DEFAULTS, SEEDS, ProtocolOptions

__all__ = ["DEFAULTS", "SEEDS", "Clip", "ProtocolOptions"]
