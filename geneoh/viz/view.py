"""Look at a result from Python: as a page in the browser, a picture, a film or another file."""

import html
import logging
import sys
import tempfile
import webbrowser
from collections.abc import Iterable, Iterator
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from geneoh.arguments import checked_call
from geneoh.choices import STRIP_CELL, Axis, Colouring, Side
from geneoh.config import as_field_type
from geneoh.errors import ConfigError, InputError, numbered
from geneoh.files.atomic import write_whole
from geneoh.files.npz import Arrays
from geneoh.hand.mano import MANO_NAMES, refuse_without_mano
from geneoh.pipeline.results import (
    FROM_ARRAYS,
    Denoised,
    Result,
    kept_arrays,
    kept_confidence,
    kept_filled,
    kept_notes,
    kept_samples,
)
from geneoh.progress import OnStep
from geneoh.readers.bodies.read import own_body
from geneoh.readers.npz.files import load
from geneoh.sequence.sequence import Sequence
from geneoh.viz.look import DEFAULT_LOOK, Look
from geneoh.viz.outputs import USED_BY, check_scene_outputs, lacking, write
from geneoh.viz.page import page_html
from geneoh.viz.scene import Scene, make_scene

LOG = logging.getLogger(__name__)
OF_BARE = "joint_order", "keypoint_unit"
"""Options of `geneoh.load` for keypoints that are not in OpenPose's order and in metres."""
CELL_HEIGHT = 720  # of the frame around a page below the cell of a notebook, pixels

Viewable = Result | Sequence | Path | str  # in memory, or an npz file


@checked_call
def view(
    result: Viewable,
    path: Path | str | None = None,
    *,
    before: Viewable | None = None,
    obj: Path | str | Iterable[Path | str] = (),
    title: str | None = None,
    colouring: Colouring = "penetration",
    up: Axis | None = None,
    frames: Iterable[int] = (),
    cell: int = STRIP_CELL,
    mano_dir: Path | str | None = None,
    on_step: OnStep | None = None,
) -> Path:
    """Show a result, beside its input where `before` is passed.

        result = geneoh.denoise(sequence)
        geneoh.view(result, before=sequence)  # opens a page in the browser
        geneoh.view(result, "film.mp4", before=sequence)

    The ending of the path names the format: `.html` a page that plays in any browser; `.png` a
    filmstrip; `.mp4` or `.gif` a film; and of the result alone `.glb` an animated scene, `.npz` the
    parameters under smplx names, `.bvh` a body with its fingers, `.obj` or `.ply` a folder of one
    mesh per frame.

    Args:
        result: what `denoise` or a generator returned, a sequence, or the npz file of one.
        path: file to write; without it a page in a temporary file is opened in the browser, or
            shown below the cell of a notebook.
        before: the input of the result, with the same number of frames.
        obj: mesh files of the object in metres, one per rigid part, for npz files; by default
            those that the npz file names. Without a mesh only hands are shown.
        title: title of the page; by default the name of the file or the source of the sequence.
        colouring: what the hands' colours show in pictures and films.
        up: axis of the world that points up; that of the body in the file, else z.
        frames: frames of a filmstrip; evenly spread ones when empty.
        cell: side of one picture of a filmstrip in pixels.
        mano_dir: folder of the user's MANO files, for results with MANO's hand.
        on_step: called with the number of pictures or frames done, and the total.

    Returns:
        The path that was written; of `.obj` and `.ply` that of the folder.

    Raises:
        InputError: a file cannot be read or written, the output path is an input or a file that
            geneoh did not write, its ending is of no known format, a mesh that a file names is
            missing, or the numbers of frames differ.
        ConfigError: a colouring or an axis that does not exist, frames that are no numbers, or one
            of these that the format does not show.
        MissingAssetError: a film without ffmpeg, or a `mano_dir` without MANO's files.
    """
    _refuse_others(result, "result")
    if before is not None:
        _refuse_others(before, "before")
    chosen = tuple(frames) if isinstance(frames, Iterable) else frames
    chosen = as_field_type(chosen, tuple[int, ...], "geneoh.view", "frames")
    if mano_dir is not None:
        refuse_without_mano(mano_dir)
    look = Look(colouring=colouring, up=up or "z", frames=chosen, cell=cell)
    for name in USED_BY:
        words = lacking(name, [Path(path or "page.html")])
        if words and getattr(look, name) != getattr(DEFAULT_LOOK, name):
            raise ConfigError(f"geneoh.view: '{name}' needs {words}; leave it out")
    obj = (obj,) if isinstance(obj, Path | str) else tuple(obj)
    if obj and not any(isinstance(given, Path | str) for given in (result, before)):
        raise InputError(
            "geneoh.view: 'obj' is for npz files, got a result in memory, which holds its meshes; "
            "leave it out, or load the result with geneoh.load(FILE, obj=MESH)"
        )
    if path is not None:
        read = [Path(given) for given in (result, before, *obj) if isinstance(given, Path | str)]
        remedy = "delete it, or choose another name"
        check_scene_outputs([Path(path)], inputs=read, remedy=remedy)
    scene = open_scene(result, before, obj=obj, title=title, mano_dir=mano_dir)
    look = replace(look, up=up or scene.up)
    if path is not None:
        return write(scene, Path(path), look, on_step=on_step)
    with tempfile.NamedTemporaryFile(prefix="geneoh_", suffix=".html", delete=False) as file:
        page = Path(file.name)
    write(scene, page, look)
    if is_in_notebook():
        show_below_cell(page)
    else:
        webbrowser.open(page.as_uri())
    return page


def is_in_notebook() -> bool:
    """Whether the code runs in a cell of a Jupyter notebook, such as in VS Code or Colab."""
    ipython = sys.modules.get("IPython")
    if ipython is None or "spyder_kernels" in sys.modules:  # Spyder's console shows no pages
        return False
    return hasattr(ipython.get_ipython(), "kernel")


def show_below_cell(page: Path) -> None:
    """Show a page below the running cell; the notebook then holds it, and needs no file."""
    display = import_module("IPython.display")
    text = html.escape(page.read_text("utf-8"))
    frame = (
        f'<iframe srcdoc="{text}" width="100%" height="{CELL_HEIGHT}" style="border: 0"></iframe>'
    )
    display.display(display.HTML(f"<div>{frame}</div>"))


def _refuse_others(given: Any, name: str) -> None:
    """`InputError` for what is neither a result, nor a sequence, nor a file."""
    if not isinstance(given, Viewable):
        takes = f"geneoh.view: '{name}' must be a result, a Sequence or the npz file of one"
        raise InputError(f"{takes}, got {type(given).__name__}; {FROM_ARRAYS}")


def open_scene(
    result: Viewable,
    before: Viewable | None = None,
    *,
    obj: tuple[Path | str, ...] = (),
    title: str | None = None,
    mano_dir: Path | str | None = None,
    **reading: Any,
) -> Scene:
    """The scene of a result, and of its input where `before` is passed.

    The arguments are those of `view`; others, such as `side`, `fps` and `unit`, are those of
    `geneoh.load`. `joint_order` and `keypoint_unit` are of the input, if there is one: results are
    in OpenPose's order and in metres.
    """
    sequences: dict[str, Sequence] = {}
    for given in (result,) if before is None else (before, result):
        if given is result and before is not None:
            reading = {name: each for name, each in reading.items() if name not in OF_BARE}
        if isinstance(given, Path | str):
            sequence = load(given, obj=obj, mano_dir=mano_dir, **reading)
            name, longer_name = Path(given).stem, str(given)
        else:
            sequence = given if isinstance(given, Sequence) else given.sequence
            name = title or sequence.source.partition(" (")[0] or "interaction"
            longer_name = f"{name}, cleaned"
        sequences[longer_name if name in sequences else name] = sequence
    if isinstance(result, Path | str):
        body = own_body(Path(result))
    else:
        body = getattr(result, "body", None)  # that of `geneoh.generate_on_body`
    kept = arrays_of(result)
    scene = make_scene(
        sequences, title=title, samples=kept_samples(kept), mano_dir=mano_dir, body=body
    )
    filled = filled_of(kept, scene)
    last = next(reversed(sequences.values()))
    fitted = tuple(fitted_notes(scene, last))
    notes = dict.fromkeys((*last.assumed, *kept_notes(kept)))
    for words in fitted:
        LOG.warning("%s: %s", scene.title, words)
    return replace(
        scene,
        object_confidence=confidence_of(kept),
        filled=torch.stack(list(filled.values())).any(0) if filled else None,
        notes=(*notes, *filled_notes(filled), *fitted),
    )


def arrays_of(result: Viewable) -> Arrays:
    """What a result, or a file, holds beside its sequence; empty for a sequence."""
    if isinstance(result, Path | str):
        return kept_arrays(result)
    return result.extra_arrays() if isinstance(result, Result) else {}


def confidence_of(kept: Arrays) -> Float[Tensor, " T"] | None:
    """Least confidence in the poses of the parts in each frame, but those that were never seen;
    None if unknown or 1 throughout."""
    found = kept_confidence(kept)
    seen = None if found is None else found[:, found.any(0)]
    if seen is None or bool((seen == 1).all()):
        return None
    return seen.amin(1)


def filled_of(kept: Arrays, scene: Scene) -> dict[Side, Bool[Tensor, " T"]]:
    """Frames that the input lacked, for each hand of the scene of which they are known."""
    shown = {hand.side for hand in scene.versions[-1].hands}
    return {
        side: filled
        for side, filled in kept_filled(kept).items()
        if side in shown and len(filled) == scene.frames
    }


def filled_notes(filled: dict[Side, Bool[Tensor, " T"]]) -> Iterator[str]:
    """How many frames of each hand were filled in, where there are any."""
    for side, frames in filled.items():
        if count := int(frames.sum()):
            what = numbered(count, "unobserved frame")
            yield f"{side} hand: {what} filled in, shaded behind the curves"


def fitted_notes(scene: Scene, last: Sequence) -> Iterator[str]:
    """Which hands of the last version have MANO's betas and are shown as our hand."""
    for hand in scene.versions[-1].hands:
        track, is_ours = last.hand(hand.side), hand.model.name not in MANO_NAMES
        if track.betas is not None and track.hand_model in MANO_NAMES and is_ours:
            how = "our hand is fitted to it and shown, some millimetres off"
            if track.joints is None:
                how = "our mean hand is shown in its pose, maybe centimetres off"
            yield (
                f"{hand.side} hand: its betas are MANO's, whose file is not there, so {how}; "
                "--mano FOLDER shows MANO's"
            )


def write_page(
    noisy: Sequence, result: Denoised, path: Path, *, title: str, mano_dir: Path | None
) -> None:
    """Write the page of a result beside its input, whatever the ending of the path."""
    write_whole(path, page_html(open_scene(result, noisy, title=title, mano_dir=mano_dir)))
