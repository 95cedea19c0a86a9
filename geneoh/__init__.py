"""Clean 3D hand-object interaction: a noisy hand track in, the same interaction cleaned out.

    import geneoh

    sequence = geneoh.load("noisy.npz", obj="mesh.obj")
    result = geneoh.denoise(sequence)
    geneoh.save(result, "clean.npz")

Reading and writing: `load` (npz files), `read` (files of data sets and estimators), `from_arrays`
(arrays in memory), `load_mesh`, `save`, `to_smplx`. Cleaning: `denoise` with `Options`, which
returns a `Denoised`. Looking: `view`. Scoring: `evaluate` with `EvaluationOptions`. Data:
`Sequence`, made of `HandTrack`, `ObjectTrack` and `Mesh`. Errors: `geneoh.errors`.

Units are metres, radians and seconds. A public name is imported when it is first used, so that
`import geneoh` and `geneoh --help` do not wait for torch.
"""

import os
import sys
from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from geneoh import errors as errors
    from geneoh.evaluation.options import EvaluationOptions
    from geneoh.evaluation.runner import evaluate
    from geneoh.geometry.mesh import Mesh, load_mesh
    from geneoh.pipeline.denoise import denoise
    from geneoh.pipeline.options import Options
    from geneoh.pipeline.results import Denoised, save
    from geneoh.pipeline.smplx_layer import to_smplx
    from geneoh.readers.arrays import from_arrays
    from geneoh.readers.npz_files import load
    from geneoh.readers.read import read
    from geneoh.sequence.sequence import HandTrack, ObjectTrack, Sequence
    from geneoh.viz.view import view

    __version__: str

__all__ = [
    "Denoised",
    "EvaluationOptions",
    "HandTrack",
    "Mesh",
    "ObjectTrack",
    "Options",
    "Sequence",
    "denoise",
    "errors",
    "evaluate",
    "from_arrays",
    "load",
    "load_mesh",
    "read",
    "save",
    "to_smplx",
    "view",
]

_DEFINED_IN = {
    "Denoised": "geneoh.pipeline.results",
    "EvaluationOptions": "geneoh.evaluation.options",
    "HandTrack": "geneoh.sequence.sequence",
    "Mesh": "geneoh.geometry.mesh",
    "ObjectTrack": "geneoh.sequence.sequence",
    "Options": "geneoh.pipeline.options",
    "Sequence": "geneoh.sequence.sequence",
    "denoise": "geneoh.pipeline.denoise",
    "evaluate": "geneoh.evaluation.runner",
    "from_arrays": "geneoh.readers.arrays",
    "load": "geneoh.readers.npz_files",
    "load_mesh": "geneoh.geometry.mesh",
    "read": "geneoh.readers.read",
    "save": "geneoh.pipeline.results",
    "to_smplx": "geneoh.pipeline.smplx_layer",
    "view": "geneoh.viz.view",
}
"""The module that defines each public name."""


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
    """Keep torch in a forked process off the threads of its parent, which a fork does not copy.

    OpenMP would wait for them for ever.
    """
    if "torch" in sys.modules:
        sys.modules["torch"].set_num_threads(1)


if hasattr(os, "register_at_fork"):  # not on Windows, which has no fork
    os.register_at_fork(after_in_child=_use_one_thread)
