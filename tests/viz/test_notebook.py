"""`geneoh.view` in a cell of a notebook."""

import re
import sys
from html import unescape
from types import ModuleType, SimpleNamespace

import pytest

from geneoh.viz.view import view

pytestmark = pytest.mark.usefixtures("few_directions")


@pytest.fixture
def notebook(monkeypatch):
    """A module IPython; what it shows, and what is opened in the browser."""
    seen = SimpleNamespace(shell=SimpleNamespace(kernel=None), shown=[], opened=[])
    package, display = ModuleType("IPython"), ModuleType("IPython.display")
    package.get_ipython = lambda: seen.shell
    display.HTML, display.display = (lambda text: text), seen.shown.append
    monkeypatch.setitem(sys.modules, "IPython", package)
    monkeypatch.setitem(sys.modules, "IPython.display", display)
    monkeypatch.setattr("webbrowser.open", seen.opened.append)
    return seen


def test_the_page_is_shown_below_the_cell(notebook, sequences):
    page = view(sequences[1], before=sequences[0])
    try:
        (shown,) = notebook.shown
        assert unescape(re.search('srcdoc="([^"]*)"', shown)[1]) == page.read_text("utf-8")
        assert not notebook.opened
    finally:
        page.unlink()


@pytest.mark.parametrize("shell", [None, SimpleNamespace()])
def test_a_terminal_of_ipython_and_a_plain_python_open_the_browser(notebook, sequences, shell):
    notebook.shell = shell
    page = view(sequences[1])
    try:
        assert notebook.opened == [page.as_uri()]
        assert not notebook.shown
    finally:
        page.unlink()


def test_the_console_of_spyder_opens_the_browser(notebook, sequences, monkeypatch):
    monkeypatch.setitem(sys.modules, "spyder_kernels", ModuleType("spyder_kernels"))
    page = view(sequences[1])
    page.unlink()
    assert notebook.opened
    assert not notebook.shown


def test_a_file_that_is_named_is_only_written(notebook, sequences, tmp_path):
    view(sequences[1], tmp_path / "page.html")
    assert not notebook.shown
    assert not notebook.opened
