"""Many results in a browser, live: a list sorted by a measure, next and previous, a time slider.

Stands on viser, which the extra `view` brings.
"""

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch

from geneoh.errors import InputError, MissingAssetError
from geneoh.geometry.mesh import MESH_SUFFIXES
from geneoh.geometry.rotations import matrix_to_quat_wxyz
from geneoh.viz.colours import OBJECT, SKIN
from geneoh.viz.scene import Scene, Take

ADDRESS = "127.0.0.1"
"""Only this machine, unless the user says otherwise."""
MEASURES = ("penetration_mm", "deepest_mm", "fingers_touching", "acceleration_mm")
GAP = 0.35
"""Metres between before and after, side by side."""


@dataclass(frozen=True)
class Clip:
    """One result in the list: how to open it, and what it measures."""

    name: str
    open: Callable[[], Scene]
    measures: dict[str, float]


def find_clips(
    results: Iterable[Path],
    obj: tuple[Path, ...],
    open_scene: Callable[[tuple[Path, ...], tuple[Path, ...]], Scene],
    *,
    on_clip: Callable[[int, int], None] | None = None,
) -> list[Clip]:
    """Open and measure every result once.

    Beside NAME_clean.npz, its input NAME.npz is shown too where it is there; without `obj` the mesh
    is NAME with the ending of a mesh.

    Raises:
        InputError: a result has no mesh, or cannot be opened.
    """
    paths = list(results)
    clips = []
    for done, path in enumerate(paths, 1):
        stem = path.stem.removesuffix("_clean")
        before = path.with_name(f"{stem}.npz")
        files = (path, before) if before != path and before.is_file() else (path,)
        opened = partial(open_scene, files, obj or _mesh_beside(path, stem))
        clips.append(Clip(path.stem, opened, measured(opened().takes[-1])))
        if on_clip is not None:
            on_clip(done, len(paths))
    return clips


def _mesh_beside(path: Path, stem: str) -> tuple[Path, ...]:
    """The mesh that bears a clip's name."""
    for suffix in MESH_SUFFIXES:
        if (mesh := path.with_name(stem + suffix)).is_file():
            return (mesh,)
    raise InputError(f"{path}: expected a mesh {stem}.obj beside it, got none; pass --obj MESH")


def measured(take: Take) -> dict[str, float]:
    """What clips are sorted by, over all hands and the frames in which they are there."""

    def over(name: str) -> torch.Tensor:
        return torch.cat([getattr(hand, name)[hand.valid] for hand in take.hands])

    return {
        "penetration_mm": 1000 * float(over("depth").nanmean()),
        "deepest_mm": 1000 * float(over("depth").nan_to_num().max()),
        "fingers_touching": float(over("fingers").nanmean()),
        "acceleration_mm": float(over("acceleration").nanmean()),
    }


def sorted_by(clips: list[Clip], measure: str, *, largest_first: bool = True) -> list[Clip]:
    """The clips by a measure; those that have no number for it come last."""
    sign = -1 if largest_first else 1

    def key(clip: Clip) -> float:
        value = clip.measures[measure]
        return sign * value if value == value else float("inf")

    return sorted(clips, key=key)


class Gallery:
    """The running server: one clip is shown, the list and the sliders change it."""

    def __init__(self, clips: list[Clip], *, up: np.ndarray, host: str = ADDRESS, port: int = 8080):
        """Start the server and show the first clip."""
        try:
            import viser
        except ImportError:
            raise MissingAssetError(
                "--serve needs viser, which is not installed; `pip install 'geneoh[view]'`"
            ) from None
        self._clips = clips
        self._order = sorted_by(clips, MEASURES[0])
        self._moving: list[tuple[Any, Callable[[int], dict[str, Any]]]] = []
        self._server: Any = viser.ViserServer(host=host, port=port, verbose=False)
        self._server.scene.set_up_direction(tuple(up))
        gui = self._server.gui
        self._sort = gui.add_dropdown("Sort by", MEASURES)
        self._list = gui.add_dropdown("Clip", [self._label(clip) for clip in self._order])
        steps = gui.add_button_group("Go", ("previous", "next"))
        self._told = gui.add_markdown("")
        self._frame = gui.add_slider("Frame", min=0, max=1, step=1, initial_value=0)
        self._play = gui.add_checkbox("Play", False)
        self._sort.on_update(lambda _: self._resort())
        self._list.on_update(lambda _: self._show())
        self._frame.on_update(lambda _: self._pose())
        steps.on_click(lambda event: self._step(1 if event.target.value == "next" else -1))
        self._show()

    @property
    def address(self) -> str:
        """Where a browser finds it."""
        return f"http://{self._server.get_host()}:{self._server.get_port()}"

    @property
    def shown(self) -> Clip:
        """The clip on the screen."""
        return self._order[[self._label(clip) for clip in self._order].index(self._list.value)]

    def run(self) -> None:
        """Play until the program is stopped."""
        while True:
            time.sleep(1 / self._scene.fps)
            if self._play.value:
                self._frame.value = (self._frame.value + 1) % self._scene.frames

    def stop(self) -> None:
        """End the server."""
        self._server.stop()

    def _label(self, clip: Clip) -> str:
        return f"{clip.name}  ({clip.measures[self._sort.value]:.1f})"

    def _resort(self) -> None:
        self._order = sorted_by(self._clips, self._sort.value)
        self._list.options = [self._label(clip) for clip in self._order]
        self._list.value = self._list.options[0]
        self._show()

    def _step(self, by: int) -> None:
        options = list(self._list.options)
        at = (options.index(self._list.value) + by) % len(options)
        self._list.value = options[at]

    def _show(self) -> None:
        """Put the chosen clip on the screen."""
        clip = self.shown
        self._scene = clip.open()
        self._told.content = "\n".join(
            f"- {name.replace('_', ' ')}: **{value:.2f}**" for name, value in clip.measures.items()
        )
        self._server.scene.reset()
        self._moving = []
        for index, take in enumerate(self._scene.takes):
            self._add_take(index, take)
        self._frame.max = max(1, self._scene.frames - 1)
        self._frame.value = 0
        self._pose()

    def _add_take(self, index: int, take: Take) -> None:
        """Meshes of one take, moved aside; each with a function that gives a frame's state."""
        scene, shapes = self._scene, self._server.scene
        aside = np.array([GAP * index, 0.0, 0.0])
        root = f"/take{index}"
        shapes.add_frame(root, show_axes=False, position=aside)
        for part, mesh in enumerate(scene.object.meshes):
            quat = matrix_to_quat_wxyz(scene.object.rotation[:, part]).numpy()
            where = scene.object.translation[:, part].numpy()
            node = shapes.add_mesh_simple(
                f"{root}/object{part}",
                mesh.verts.numpy(),
                mesh.faces.numpy(),
                color=OBJECT,
                opacity=0.55,
            )
            self._moving.append(
                (node, lambda t, quat=quat, where=where: {"wxyz": quat[t], "position": where[t]})
            )
        for hand in take.hands:
            verts, there = hand.verts.numpy(), hand.valid.tolist()
            node = shapes.add_mesh_simple(
                f"{root}/{hand.side}", verts[0], hand.model.faces.numpy(), color=SKIN
            )
            self._moving.append(
                (node, lambda t, v=verts, there=there: {"vertices": v[t], "visible": there[t]})
            )

    def _pose(self) -> None:
        """Move everything to the slider's frame."""
        frame = min(self._frame.value, self._scene.frames - 1)
        for node, state in self._moving:
            for name, value in state(frame).items():
                setattr(node, name, value)
