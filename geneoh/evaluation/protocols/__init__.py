"""Which clips of a data set are scored, under which noise: `find_cases` lists them."""

from geneoh.choices import CASE_NOISES, DATASETS, CaseNoise, Dataset
from geneoh.evaluation.protocols.dataset_locations import HOMES
from geneoh.evaluation.protocols.options import DEFAULT_NOISES, SEEDS, ProtocolOptions
from geneoh.evaluation.protocols.pending import PendingCase, find_cases

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
