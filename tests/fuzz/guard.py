"""A trap for code that a file brings along: what the command never does ends the process at once.

An audit hook hears of every file that Python opens, of imports, of programs and of sockets. Files
that native libraries open are not heard of.
"""

import os
import sys
import sysconfig
from pathlib import Path
from typing import Any, Final

TRAPPED: Final = 99
"""Exit code of a process that the trap ended."""

HARMLESS = ("/dev/null", "/dev/urandom", "/proc/", "/sys/", "/usr/share/zoneinfo")
FORBIDDEN = (
    *("os.exec", "os.fork", "os.forkpty", "os.posix_spawn", "os.spawn", "os.system", "os.kill"),
    *("pty.spawn", "subprocess.Popen", "pickle.find_class", "ctypes.dlopen"),
    *("os.setxattr", "os.symlink", "os.link", "os.chroot", "webbrowser.open", "ftplib.connect"),
    *("urllib.Request", "http.client.connect", "socket.connect", "socket.bind", "socket.sendto"),
)
CHANGING = ("os.rename", "os.remove", "os.mkdir", "os.rmdir", "os.truncate", "os.chmod", "os.chown")
CODE = ("exec", "marshal.loads")
WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND


def set_trap(read: Path, write: Path) -> None:
    """End the process when it leaves its place.

    Args:
        read: the folder of the input; installed packages may be read as well.
        write: the folder of the output.
    """
    roots = [str(read.resolve()), *installed()]
    room = str(write.resolve())
    sys.addaudithook(lambda event, args: check(event, args, roots, room))


def installed() -> list[str]:
    """The folders of Python, of its packages, of this repository's package, and of this one."""
    import geneoh

    known = {sys.prefix, sys.base_prefix, *sysconfig.get_paths().values()}
    known |= {str(Path(module.__file__).parents[1]) for module in geneoh_modules()}
    own = [Path(geneoh.__file__).parent, Path(__file__).parent]
    return [os.path.realpath(path) for path in [*known, *own]]


def geneoh_modules() -> list[Any]:
    """Modules of packages that may lie outside of Python's own folders."""
    return [sys.modules[name] for name in ("torch", "numpy", "scipy", "trimesh", "geneoh_cli")]


def check(event: str, args: tuple[Any, ...], roots: list[str], room: str) -> None:
    """End the process at an event that is not allowed."""
    if event in FORBIDDEN:
        trapped(event, args)
    elif event == "open":
        path, _mode, flags = args
        if not isinstance(path, str | bytes | os.PathLike):
            return
        place = os.path.realpath(os.fsdecode(path))
        allowed = [room] if flags & WRITING else [room, *roots]
        if not place.startswith(HARMLESS) and not within(place, allowed):
            trapped("write to" if flags & WRITING else "read of", place)
    elif event in CHANGING:
        for path in args[: 2 if event == "os.rename" else 1]:
            if not within(os.path.realpath(os.fsdecode(path)), [room]):
                trapped(event, path)
    elif event == "import":
        if args[0].partition(".")[0] not in known_packages():
            trapped(event, args[0])
    elif event in CODE and not importing():
        trapped(event, args[0])


def within(place: str, folders: list[str]) -> bool:
    """Whether a path lies in one of some folders or is one of them."""
    return any(place == folder or place.startswith(f"{folder}{os.sep}") for folder in folders)


def known_packages() -> set[str]:
    """Packages of which a module was imported before any input was read, and Python's own."""
    return {name.partition(".")[0] for name in sys.modules} | set(sys.stdlib_module_names)


def importing() -> bool:
    """Whether a module is being imported."""
    frame = sys._getframe()
    while frame is not None:
        if frame.f_code.co_filename == "<frozen importlib._bootstrap>":
            return True
        frame = frame.f_back
    return False


def trapped(what: str, detail: object) -> None:
    """End the process; no handler of exceptions can hold it."""
    os.write(2, f"\nTRAPPED: {what} {detail}\n"[:500].encode(errors="replace"))
    os._exit(TRAPPED)
