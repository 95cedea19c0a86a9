"""Clean 3D hand-object interaction: a noisy hand track in, the same interaction cleaned out.

    import geneoh

    sequence = geneoh.load("noisy.npz", obj="mesh.obj")
    result = geneoh.denoise(sequence)
    geneoh.save(result, "clean.npz")

Reading and writing: `load` (npz files and keypoints), `read` (files of data sets and estimators),
`from_arrays` (arrays in memory), `load_mesh`, `save`, `to_smplx`. Cleaning: `denoise` with
`Options`, which returns a `Denoised`; `Stream`, frame by frame. Making: `generate` with
`GenerateOptions`, which returns a `Generated`; `generate_on_body` with `BodyOptions`, which returns
a `BodyWithHands`. Looking: `view`. Scoring: `evaluate` with `EvaluationOptions`. Data: `Sequence`,
made of `HandTrack`, `ObjectTrack` and `Mesh`. Errors: `geneoh.errors`.

Units are metres, radians and seconds. A public name is imported when it is first used, so that
`import geneoh` and `geneoh --help` do not wait for torch.
"""

import os
import sys
from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from geneoh import errors as errors
    from geneoh.evaluation.options import EvaluationOptions as EvaluationOptions
    from geneoh.evaluation.runner import evaluate as evaluate
    from geneoh.generators.both2hands.on_body import BodyOptions as BodyOptions
    from geneoh.generators.both2hands.on_body import BodyWithHands as BodyWithHands
    from geneoh.generators.both2hands.on_body import generate_on_body as generate_on_body
    from geneoh.generators.text2hoi.generate import Generated as Generated
    from geneoh.generators.text2hoi.generate import GenerateOptions as GenerateOptions
    from geneoh.generators.text2hoi.generate import generate as generate
    from geneoh.geometry.mesh import Mesh as Mesh
    from geneoh.geometry.mesh_files import load_mesh as load_mesh
    from geneoh.pipeline.denoise import denoise as denoise
    from geneoh.pipeline.options import Options as Options
    from geneoh.pipeline.results import Denoised as Denoised
    from geneoh.pipeline.results import save as save
    from geneoh.pipeline.smplx_layer import to_smplx as to_smplx
    from geneoh.pipeline.streaming.stream import Stream as Stream
    from geneoh.readers.arrays import from_arrays as from_arrays
    from geneoh.readers.npz.files import load as load
    from geneoh.readers.recordings import read as read
    from geneoh.sequence.sequence import HandTrack as HandTrack
    from geneoh.sequence.sequence import ObjectTrack as ObjectTrack
    from geneoh.sequence.sequence import Sequence as Sequence
    from geneoh.viz.view import view as view

    __version__: str

_MODULES = {
    "evaluation.options": ("EvaluationOptions",),
    "evaluation.runner": ("evaluate",),
    "generators.both2hands.on_body": ("BodyOptions", "BodyWithHands", "generate_on_body"),
    "generators.text2hoi.generate": ("GenerateOptions", "Generated", "generate"),
    "geometry.mesh": ("Mesh",),
    "geometry.mesh_files": ("load_mesh",),
    "pipeline.denoise": ("denoise",),
    "pipeline.options": ("Options",),
    "pipeline.results": ("Denoised", "save"),
    "pipeline.smplx_layer": ("to_smplx",),
    "pipeline.streaming.stream": ("Stream",),
    "readers.arrays": ("from_arrays",),
    "readers.npz.files": ("load",),
    "readers.recordings": ("read",),
    "sequence.sequence": ("HandTrack", "ObjectTrack", "Sequence"),
    "viz.view": ("view",),
}
_DEFINED_IN = {name: f"geneoh.{module}" for module, names in _MODULES.items() for name in names}
"""The module that defines each public name."""

__all__ = sorted([*_DEFINED_IN, "errors"])  # pyright: ignore[reportUnsupportedDunderAll]


if not TYPE_CHECKING:  # checkers would take every name for one of the package

    def __getattr__(name: str) -> Any:
        if name == "__version__":
            return import_module("importlib.metadata").version("geneoh")
        if name == "errors":
            return import_module("geneoh.errors")
        if name not in _DEFINED_IN:
            raise AttributeError(f"module 'geneoh' has no attribute '{name}'")
        return getattr(import_module(_DEFINED_IN[name]), name)


def __dir__() -> list[str]:
    return sorted([*__all__, "__doc__", "__version__"])


def _use_one_thread() -> None:
    """Limit torch in a forked process to one thread: a fork does not copy its parent's threads, and
    OpenMP would wait for them for ever."""
    if "torch" in sys.modules:
        sys.modules["torch"].set_num_threads(1)


if hasattr(os, "register_at_fork"):  # not on Windows, which has no fork
    os.register_at_fork(after_in_child=_use_one_thread)
