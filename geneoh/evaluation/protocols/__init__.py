"""Which clips of a data set are scored, under which noise: `find_cases` lists them."""

from geneoh.evaluation.protocols.options import (
    CASE_NOISES,
    DATASETS,
    DEFAULT_NOISES,
    SEEDS,
    CaseNoise,
    Dataset,
    ProtocolOptions,
)
from geneoh.evaluation.protocols.pending import PendingCase, find_cases
from geneoh.evaluation.protocols.roots import HOMES

__all__ = [
    "CASE_NOISES",
    "DATASETS",
    "DEFAULT_NOISES",
    "HOMES",
    "SEEDS",
    "CaseNoise",
    "Dataset",
    "PendingCase",
    "ProtocolOptions",
    "find_cases",
]
