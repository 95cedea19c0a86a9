"""A scene as mp4 or GIF: before and after side by side, drawn without a display."""

import os
import shutil
import subprocess
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
from jaxtyping import Float
from PIL import Image, ImageDraw

from geneoh.choices import Colouring
from geneoh.errors import InputError, MissingAssetError
from geneoh.files.atomic import unwritable
from geneoh.viz.camera import cameras
from geneoh.viz.colours import SCALES
from geneoh.viz.picture import Picture, draw
from geneoh.viz.scene import Scene
from geneoh.viz.strip import FAINT, FOOT, HEAD, INK, NOTE, PAPER, UP, caption, draw_scale, font

PANEL = 320
"""Side of one picture in a film, pixels."""
QUALITY = "20"
"""x264's constant rate factor: no loss that is seen."""
GIF_RATE = 15.0
"""Frames a second of a GIF; more only makes it larger."""
BATCH = 4
"""Pictures that each thread draws before the next are handed out."""
GIF_FILTER = "split[a][b];[a]palettegen=stats_mode=diff[p];[b][p]paletteuse=dither=bayer"


def film_frames(
    scene: Scene,
    *,
    colouring: Colouring = "penetration",
    panel: int = PANEL,
    up: Float[np.ndarray, " 3"] = UP,
    every: int = 1,
) -> Iterator[Picture]:
    """The pictures of a film one by one, all takes side by side; width and height are even."""
    seen = cameras(scene, up)
    panel += panel % 2
    height = HEAD + panel + NOTE + FOOT

    def sheet_of(frame: int) -> Picture:
        sheet = Image.new("RGB", (panel * len(scene.takes), height), PAPER)
        pen = ImageDraw.Draw(sheet)
        pictures = draw(scene, scene.takes, frame, seen[frame], (panel, panel), colouring=colouring)
        for index, (take, picture) in enumerate(zip(scene.takes, pictures, strict=True)):
            left = index * panel
            sheet.paste(Image.fromarray(picture), (left, HEAD))
            pen.text((left + 12, 8), take.title, INK, font(16))
            pen.text((left + 12, HEAD + panel + 2), caption(scene, take, frame), FAINT, font(14))
        if colouring != "plain":
            draw_scale(sheet, SCALES[colouring], (12, height - FOOT + 8))
        return np.asarray(sheet)

    # numpy lets go of the interpreter in its loops; in batches, so that few pictures are held
    workers = os.cpu_count() or 1
    frames = range(0, scene.frames, every)
    with ThreadPoolExecutor(workers) as pool:
        for start in range(0, len(frames), BATCH * workers):
            yield from pool.map(sheet_of, frames[start : start + BATCH * workers])


def write_film(
    scene: Scene,
    path: Path,
    *,
    colouring: Colouring = "penetration",
    up: Float[np.ndarray, " 3"] = UP,
    on_picture: Callable[[int, int], None] | None = None,
) -> None:
    """Write an mp4 or a GIF, by the ending of the path, in one step.

    Raises:
        MissingAssetError: no ffmpeg.
        InputError: the place cannot be written to.
    """
    gif = path.suffix.lower() == ".gif"
    every = max(1, round(scene.fps / GIF_RATE)) if gif else 1
    total = len(range(0, scene.frames, every))
    beside = path.with_name(f".{path.stem}.tmp{path.suffix}")
    maker = None
    try:
        frames = film_frames(scene, colouring=colouring, up=up, every=every)
        for done, picture in enumerate(frames, 1):
            if maker is None:
                maker = _ffmpeg(beside, picture, scene.fps / every, gif)
            assert maker.stdin is not None, "the pipe was asked for"
            maker.stdin.write(picture.tobytes())
            if on_picture is not None:
                on_picture(done, total)
        assert maker is not None, "a scene has a frame"
        _, said = maker.communicate()
        if maker.returncode:
            reason = said.decode(errors="replace").strip().splitlines()[-1:]
            raise InputError(f"{path}: ffmpeg cannot write it ({''.join(reason)}); see the path")
        beside.replace(path)
    except BrokenPipeError:
        raise InputError(f"{path}: ffmpeg stopped; choose another place") from None
    except OSError as error:
        raise unwritable(path, error) from None
    finally:
        if maker is not None and maker.poll() is None:
            maker.kill()
        beside.unlink(missing_ok=True)


def ffmpeg_path() -> str:
    """The ffmpeg on the path, or the one that the extra `view` brings.

    Raises:
        MissingAssetError: there is none.
    """
    if found := shutil.which("ffmpeg"):
        return found
    try:
        import imageio_ffmpeg
    except ImportError:
        raise MissingAssetError(
            "films need ffmpeg, got none on the path; install it, or `pip install 'geneoh[view]'`"
        ) from None
    return imageio_ffmpeg.get_ffmpeg_exe()


def _ffmpeg(path: Path, picture: Picture, rate: float, gif: bool) -> subprocess.Popen[bytes]:
    """An ffmpeg that waits for raw pictures of this size."""
    height, width = picture.shape[:2]
    raw = ("-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}", "-r", f"{rate:g}")
    if gif:
        coded = ("-filter_complex", GIF_FILTER)
    else:
        coded = (*("-c:v", "libx264", "-preset", "veryfast", "-crf", QUALITY),)
        coded += ("-pix_fmt", "yuv420p", "-movflags", "+faststart")
    return subprocess.Popen(
        [ffmpeg_path(), "-v", "error", "-y", *raw, "-i", "-", *coded, str(path)],
        stdin=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
