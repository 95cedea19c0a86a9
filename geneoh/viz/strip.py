"""A filmstrip: frames of an interaction side by side, before above after."""

from pathlib import Path

from geneoh.errors import InputError
from geneoh.progress import OnStep
from geneoh.viz.camera import cameras
from geneoh.viz.canvas import CAPTION_HEIGHT, SCALE_HEIGHT, TITLE_HEIGHT, Canvas, save_picture
from geneoh.viz.look import Look
from geneoh.viz.picture import Picture
from geneoh.viz.scene import Scene

STRIP_FRAMES = 5
STRIP_GAP = 10
"""Between two pictures, pixels."""


def filmstrip(scene: Scene, look: Look | None = None, on_step: OnStep | None = None) -> Picture:
    """A row of frames for each version, all seen from one direction, with measures below each.

    Args:
        scene: what to show.
        look: how; its frames must be in the clip.
        on_step: called with the pictures done and in all.

    Raises:
        InputError: a frame that the clip does not have.
    """
    look = look or Look()
    frames = look.frames or spread_frames(scene, STRIP_FRAMES)
    _refuse_frames(scene, frames)
    seen, cell = cameras(scene, look.upward), look.cell
    row, column = TITLE_HEIGHT + cell + CAPTION_HEIGHT, cell + STRIP_GAP
    scale_height = SCALE_HEIGHT if look.colouring != "plain" else 0
    height = row * len(scene.versions) + scale_height
    canvas = Canvas(column * len(frames) - STRIP_GAP, height)
    for index, version in enumerate(scene.versions):
        canvas.write(version.title, 12, index * row + 8, size=16)
    for index, frame in enumerate(frames):
        corners = [(index * column, i * row + TITLE_HEIGHT) for i in range(len(scene.versions))]
        canvas.paste_versions(scene, frame, seen[frame], corners, look.colouring, cell)
        if on_step is not None:
            on_step(index + 1, len(frames))
    if scale_height:
        canvas.draw_scale(look.colouring, 12, height - scale_height + 8)
    return canvas.picture()


def spread_frames(scene: Scene, count: int) -> tuple[int, ...]:
    """Frames spread evenly over the clip: the middles of equal shares."""
    count = min(count, scene.frames)
    return tuple(int((i + 0.5) * scene.frames / count) for i in range(count))


def _refuse_frames(scene: Scene, frames: tuple[int, ...]) -> None:
    """Refuse frames that the clip does not have."""
    if wrong := [frame for frame in frames if not 0 <= frame < scene.frames]:
        raise InputError(
            f"frames must be from 0 to {scene.frames - 1}, got {', '.join(map(str, wrong))}; "
            "leave them out or name others"
        )


def write_filmstrip(scene: Scene, path: Path, look: Look, on_step: OnStep | None) -> None:
    """Write a filmstrip as a PNG in one step."""
    save_picture(filmstrip(scene, look, on_step), path)
