"""A filmstrip: frames of an interaction side by side, before above after."""

from geneoh.errors import InputError
from geneoh.progress import OnStep, steps
from geneoh.viz.camera import cameras
from geneoh.viz.canvas import CAPTION_HEIGHT, SCALE_HEIGHT, TITLE_HEIGHT, Canvas
from geneoh.viz.look import Look
from geneoh.viz.picture import Picture
from geneoh.viz.scene import Scene

STRIP_FRAMES = 5
STRIP_GAP = 10
"""Between two pictures, pixels."""


def filmstrip(scene: Scene, look: Look | None = None, on_step: OnStep | None = None) -> Picture:
    """A row of frames for each version, all seen from one direction, with measures below each.

    Raises:
        InputError: the look has a frame that the clip does not have.
    """
    look = look or Look()
    frames = look.frames or spread_frames(scene, STRIP_FRAMES)
    if wrong := [frame for frame in frames if not 0 <= frame < scene.frames]:
        raise InputError(
            f"frames must be from 0 to {scene.frames - 1}, got {', '.join(map(str, wrong))}; "
            "leave them out or name others"
        )
    seen, cell = cameras(scene, look.upward), look.cell
    row, column = TITLE_HEIGHT + cell + CAPTION_HEIGHT, cell + STRIP_GAP
    height = row * len(scene.versions)
    scaled = look.colouring != "plain"
    canvas = Canvas(column * len(frames) - STRIP_GAP, height + SCALE_HEIGHT * scaled)
    for index, version in enumerate(scene.versions):
        canvas.write(version.title, 12, index * row + 8, size=16)
    for index, frame in enumerate(steps(frames, on_step)):
        corners = [(index * column, i * row + TITLE_HEIGHT) for i in range(len(scene.versions))]
        canvas.paste_versions(scene, frame, seen[frame], corners, look.colouring, cell)
    if scaled:
        canvas.draw_scale(look.colouring, 12, height + 8)
    return canvas.picture()


def spread_frames(scene: Scene, count: int) -> tuple[int, ...]:
    """Frames spread evenly over the clip: the middles of equal shares."""
    count = min(count, scene.frames)
    return tuple(int((i + 0.5) * scene.frames / count) for i in range(count))
