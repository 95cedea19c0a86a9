"""Show a page below the cell of a notebook that asked for it."""

import html
import sys
from importlib import import_module
from pathlib import Path

HEIGHT = 720  # of the frame around a page, pixels


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
    frame = f'<iframe srcdoc="{text}" width="100%" height="{HEIGHT}" style="border: 0"></iframe>'
    display.display(display.HTML(f"<div>{frame}</div>"))
