"""Many results in a browser, live: a list sorted by a measure, next and previous, a time slider.

Needs viser, which the extra `view` brings.
"""

import threading
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from geneoh.choices import Axis
from geneoh.errors import InputError, MissingAssetError
from geneoh.metrics.report import FRAME_MEANS
from geneoh.progress import OnStep, steps
from geneoh.readers.base import SourceClip
from geneoh.readers.meshes import mesh_beside
from geneoh.readers.recordings import with_distinct_names
from geneoh.viz.camera import cameras
from geneoh.viz.look import SKIN_COLOUR, Look
from geneoh.viz.scene import Scene, Version

ADDRESS = "127.0.0.1"  # reachable from this machine only
SORT_MEASURES = tuple(FRAME_MEANS)  # of `geneoh.metrics.report.InteractionReport`
VERSION_SPACING = 0.35  # metres between before and after, side by side


@dataclass(frozen=True)
class GalleryItem:
    """One result in the list: how to open it, and its measures."""

    name: str
    open: Callable[[], Scene]
    measures: dict[str, float]


def gallery_items(
    results: Iterable[Path],
    obj: tuple[Path, ...],
    open_scene: Callable[..., Scene],
    *,
    on_step: OnStep | None = None,
) -> tuple[list[GalleryItem], list[str]]:
    """Open and measure every result once; also returns one line for each that cannot be opened.

    `open_scene` is that of `geneoh.viz.view`, with further arguments bound.

    NAME_clean.npz is shown beside its input NAME.npz, where that exists. Without `obj`, the mesh
    is a mesh file called NAME, else those that the result names. Results of equal names get as
    much of their path in front as is needed to tell them apart.

    Raises:
        InputError: no result can be opened; the message is the reason of the first one.
    """
    paths = dict.fromkeys(path.absolute() for path in results)
    clips = with_distinct_names([SourceClip(path.stem, path) for path in paths])
    items: list[GalleryItem] = []
    refused: dict[str, InputError] = {}
    for clip in steps(clips, on_step):
        path = clip.path
        stem = path.stem.removesuffix("_clean")
        beside = path.with_name(f"{stem}.npz")
        before = beside if beside != path and beside.is_file() else None
        opened = partial(open_scene, path, before, obj=obj or mesh_beside(beside))
        try:
            scene = opened()
            items.append(GalleryItem(clip.name, opened, scene.means(scene.versions[-1])))
        except InputError as error:
            refused[clip.name] = error
    if refused and not items:
        raise next(iter(refused.values()))
    return items, [f"{name}: {error}" for name, error in refused.items()]


def sorted_by(items: list[GalleryItem], measure: str) -> list[GalleryItem]:
    """The items by decreasing measure; those whose measure is NaN come last."""
    return sorted(items, key=lambda item: np.nan_to_num(-item.measures[measure], nan=np.inf))


def in_words(value: float, digits: int) -> str:
    """A measure with `digits` decimals; depth and contact are NaN without an object."""
    return "not known" if np.isnan(value) else f"{value:.{digits}f}"


class Gallery:
    """The running server: one result is shown; the list and the sliders change it."""

    def __init__(self, items: list[GalleryItem], *, up: Axis | None, port: int = 8080):
        """Start the server and show the first result; `up` is by default that of each scene."""
        try:
            import viser
        except ImportError:
            raise MissingAssetError(
                "--serve needs viser, which is not installed; `pip install 'geneoh[view]'`"
            ) from None
        self._items = items
        self._order = sorted_by(items, SORT_MEASURES[0])
        self._moving: list[tuple[Any, dict[str, Any]]] = []
        # viser calls from threads of its own, while `run` plays in that of the caller
        self._lock = threading.RLock()
        self._server: Any = viser.ViserServer(host=ADDRESS, port=port, verbose=False)
        self._up: Axis | None = up
        gui = self._server.gui
        self._sort = gui.add_dropdown("Sort by", SORT_MEASURES)
        self._list = gui.add_dropdown("Result", [self._label(item) for item in self._order])
        buttons = gui.add_button_group("Go", ("previous", "next"))
        self._words = gui.add_markdown("")
        self._frame = gui.add_slider("Frame", min=0, max=1, step=1, initial_value=0)
        self._play = gui.add_checkbox("Play", False)
        self._sort.on_update(lambda _: self._resort())
        self._list.on_update(lambda _: self._show())
        self._frame.on_update(lambda _: self._pose())
        buttons.on_click(lambda event: self._step(1 if event.target.value == "next" else -1))
        self._show()
        self._server.on_client_connect(self._look)

    @property
    def address(self) -> str:
        """The address to open in a browser."""
        return f"http://{self._server.get_host()}:{self._server.get_port()}"

    @property
    def shown(self) -> GalleryItem:
        """The result on the screen."""
        return self._order[[self._label(item) for item in self._order].index(self._list.value)]

    def run(self) -> None:
        """Play until the program is stopped."""
        while True:
            time.sleep(1 / self._scene.fps)
            if self._play.value:
                self._frame.value = (self._frame.value + 1) % self._scene.frames

    def stop(self) -> None:
        """End the server."""
        self._server.stop()

    def _label(self, item: GalleryItem) -> str:
        return f"{item.name}  ({in_words(item.measures[self._sort.value], 1)})"

    def _resort(self) -> None:
        self._order = sorted_by(self._items, self._sort.value)
        self._list.options = [self._label(item) for item in self._order]
        self._list.value = self._list.options[0]  # a new value is shown

    def _step(self, by: int) -> None:
        names = list(self._list.options)
        self._list.value = names[(names.index(self._list.value) + by) % len(names)]

    def _show(self) -> None:
        """Put the chosen result on the screen."""
        with self._lock:
            item = self.shown
            self._scene = item.open()
            self._words.content = "\n".join(
                f"- {name.replace('_', ' ')}: **{in_words(value, 2)}**"
                for name, value in item.measures.items()
            )
            upward = Look(up=self._up or self._scene.up).upward
            self._camera = cameras(self._scene, upward)[0]
            self._server.scene.reset()
            self._server.scene.set_up_direction(tuple(upward))
            self._moving = []
            for index, version in enumerate(self._scene.versions):
                self._add_version(index, version)
            self._frame.max = max(1, self._scene.frames - 1)
            self._frame.value = 0
            self._pose()
            for client in self._server.get_clients().values():
                self._look(client)

    def _look(self, client: Any) -> None:
        """Let a browser see all versions, wherever they are in the world."""
        right, _, back = self._camera.axes
        half = VERSION_SPACING * (len(self._scene.versions) - 1) / 2
        middle = self._camera.target + half * right
        far = (self._camera.radius + half) / np.sin(client.camera.fov / 2)
        client.camera.position, client.camera.look_at = middle + far * back, middle

    def _add_version(self, index: int, version: Version) -> None:
        """Add the meshes of one version, each with its properties by frame."""
        scene, shapes, root = self._scene, self._server.scene, f"/version{index}"
        aside = VERSION_SPACING * index * self._camera.axes[0]
        shapes.add_frame(root, show_axes=False, position=aside)
        for part in scene.parts:
            mesh = scene.object.meshes[part]
            shape = (f"{root}/object{part}", mesh.verts.numpy(), mesh.faces.numpy())
            node = shapes.add_mesh_simple(*shape, color=scene.part_colour(part), opacity=0.55)
            quat_wxyz, translation = scene.part_motion(part)
            self._moving.append((node, {"wxyz": quat_wxyz, "position": translation}))
        for hand in version.hands:
            verts, valid = hand.verts.numpy(), hand.valid.tolist()
            faces = hand.model.faces.numpy()
            node = shapes.add_mesh_simple(f"{root}/{hand.side}", verts[0], faces, color=SKIN_COLOUR)
            self._moving.append((node, {"vertices": verts, "visible": valid}))

    def _pose(self) -> None:
        """Move everything to the slider's frame."""
        with self._lock:
            frame = min(self._frame.value, self._scene.frames - 1)
            for node, properties in self._moving:
                for name, values in properties.items():
                    setattr(node, name, values[frame])
