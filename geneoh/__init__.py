"""Clean 3D hand-object interaction tracks: no penetration, contact where the object moves.

    sequence = geneoh.load("noisy.npz", obj="mesh.obj")
    result = geneoh.denoise(sequence)
    geneoh.save(result.sequence, "clean.npz")

The names are imported when they are first used, so that the command's help need not wait for torch.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from geneoh.pipeline.denoise import Denoised, Options, denoise
    from geneoh.readers.npz_files import load
    from geneoh.readers.npz_files import save_sequence as save
    from geneoh.sequence.sequence import HandTrack, ObjectTrack, Sequence

__all__ = ["Denoised", "HandTrack", "ObjectTrack", "Options", "Sequence", "denoise", "load", "save"]

_HOMES = {
    "load": ("geneoh.readers.npz_files", "load"),
    "save": ("geneoh.readers.npz_files", "save_sequence"),
    "HandTrack": ("geneoh.sequence.sequence", "HandTrack"),
    "ObjectTrack": ("geneoh.sequence.sequence", "ObjectTrack"),
    "Sequence": ("geneoh.sequence.sequence", "Sequence"),
    "Denoised": ("geneoh.pipeline.denoise", "Denoised"),
    "Options": ("geneoh.pipeline.denoise", "Options"),
    "denoise": ("geneoh.pipeline.denoise", "denoise"),
}
"""Module and name behind each public name."""


def __getattr__(name: str) -> Any:
    if name == "__version__":
        return import_module("importlib.metadata").version("geneoh")
    if name not in _HOMES:
        raise AttributeError(f"module 'geneoh' has no attribute '{name}'")
    module, attribute = _HOMES[name]
    return getattr(import_module(module), attribute)
