"""A film (mp4 or GIF): before and after side by side, drawn without a display."""

import os
import shutil
import subprocess
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from itertools import chain
from pathlib import Path

from geneoh.errors import InputError, MissingAssetError
from geneoh.files.atomic import in_one_step
from geneoh.files.outputs import TAIL_MARKS
from geneoh.progress import OnStep, steps
from geneoh.viz.camera import cameras
from geneoh.viz.canvas import (
    CAPTION_HEIGHT,
    SCALE_HEIGHT,
    TITLE_HEIGHT,
    Canvas,
    end_of,
    near_height,
    scale_width,
)
from geneoh.viz.look import DEFAULT_LOOK, Look
from geneoh.viz.picture import Picture
from geneoh.viz.scene import Scene

FILM_CELL = 320  # side of one picture in a film, pixels
QUALITY = "20"  # x264's constant rate factor: losses are not visible
GIF_RATE = 15.0  # frames a second of a GIF; more only makes it larger
BATCH = 4  # pictures that each thread draws before the next are handed out
GIF_FILTER = "split[a][b];[a]palettegen=stats_mode=diff[p];[b][p]paletteuse=dither=bayer"
GIF_OPTIONS = ("-filter_complex", GIF_FILTER, "-f", "gif")
HUNDREDTHS = 100  # delays of a GIF are whole hundredths of a second; ffmpeg alternates them
SHORTEST_DELAY = 2  # hundredths of a second; browsers take shorter delays for ten
MP4_OPTIONS = f"-c:v libx264 -preset veryfast -crf {QUALITY} -pix_fmt yuv420p".split()
MP4_OPTIONS += ["-movflags", "+faststart", "-f", "mp4"]


def film_frames(
    scene: Scene, look: Look = DEFAULT_LOOK, *, cell: int = FILM_CELL, every: int = 1
) -> Iterator[Picture]:
    """The pictures of a film one by one, all versions side by side; width and height are even.

    `cell` is the side of one version's picture in pixels; `every` is the step between frames.
    """
    seen = cameras(scene, look.upward)
    cell += cell % 2
    height = TITLE_HEIGHT + cell + near_height(scene, cell) + CAPTION_HEIGHT
    corners = [(index * cell, TITLE_HEIGHT) for index in range(len(scene.versions))]
    titles = [end_of(version.title, cell - 24, 16) for version in scene.versions]
    scaled = scene.shows(look.colouring)
    width = max(cell * len(scene.versions), scale_width(look.colouring) if scaled else 0)
    width += width % 2

    def picture_of(frame: int) -> Picture:
        canvas = Canvas(width, height + SCALE_HEIGHT)
        for title, (left, _) in zip(titles, corners, strict=True):
            canvas.write(title, left + 12, 8, size=16)
        canvas.paste_versions(scene, frame, seen[frame], corners, look.colouring, cell, size=14)
        if scaled:
            canvas.draw_scale(look.colouring, height + 8)
        return canvas.picture()

    # numpy releases the interpreter in its loops; batches bound the pictures held in memory
    workers = os.cpu_count() or 1
    frames = range(0, scene.frames, every)
    with ThreadPoolExecutor(workers) as pool:
        for start in range(0, len(frames), BATCH * workers):
            yield from pool.map(picture_of, frames[start : start + BATCH * workers])


def write_film(scene: Scene, path: Path, look: Look, on_step: OnStep | None) -> None:
    """Write an mp4 or a GIF, by the ending of the path, in one step."""
    gif = path.suffix.lower() == ".gif"
    every = max(1, round(scene.fps / GIF_RATE)) if gif else 1
    pictures = film_frames(scene, look, every=every)
    pictures = chain([first := next(pictures)], pictures)
    with in_one_step(path) as beside:
        shown, held = scene.fps / every, last_delay(scene.frames, scene.fps, every)
        coded = (*GIF_OPTIONS, "-final_delay", str(held)) if gif else MP4_OPTIONS
        encoder = _ffmpeg(beside, first, shown, coded)
        assert encoder.stdin is not None, "the pipe was asked for"
        try:
            for _ in steps(range(0, scene.frames, every), on_step):
                encoder.stdin.write(next(pictures).tobytes())
            _, messages = encoder.communicate()
        except BrokenPipeError:  # it stopped reading, and says why
            encoder.wait()
            messages = encoder.stderr.read() if encoder.stderr else b""
        finally:
            encoder.kill()  # has no effect on a process that has ended
            encoder.wait()
        if encoder.returncode:
            reason = messages.decode(errors="replace").strip().splitlines()[-1:]
            raise InputError(f"{path}: ffmpeg cannot write it ({''.join(reason)}); see the path")
        with beside.open("rb+") as film:
            film.seek(-1 if gif else 0, os.SEEK_END)  # a GIF's last byte is in its mark
            film.write(TAIL_MARKS[path.suffix.lower()])


def last_delay(frames: int, fps: float, every: int) -> int:
    """Hundredths of a second for the last picture of a GIF, so that it is as long as the clip."""
    last = (frames - 1) // every * every
    whole, before = (round(HUNDREDTHS * frame / fps) for frame in (frames, last))
    return max(whole - before, SHORTEST_DELAY)


def ffmpeg_path() -> str:
    """The ffmpeg on the path, or the one that the extra `view` brings."""
    if found := shutil.which("ffmpeg"):
        return found
    try:
        import imageio_ffmpeg
    except ImportError:
        raise MissingAssetError(
            "films need ffmpeg, got none on the path; install it, or `pip install 'geneoh[view]'`"
        ) from None
    return imageio_ffmpeg.get_ffmpeg_exe()


def _ffmpeg(
    path: Path, picture: Picture, rate: float, coded: Iterable[str]
) -> subprocess.Popen[bytes]:
    """An ffmpeg process that encodes raw pictures of this size from its standard input."""
    height, width = picture.shape[:2]
    raw = ("-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}", "-r", f"{rate:g}")
    return subprocess.Popen(
        [ffmpeg_path(), "-v", "error", "-y", *raw, "-i", "-", *coded, f"file:{path}"],
        stdin=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
