"""The font of the words in pictures, for names in any script."""

from pathlib import Path

import matplotlib
import pytest

from geneoh.viz import fonts

DEJAVU = str(Path(matplotlib.get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf")


@pytest.mark.parametrize(
    ("words", "family"),
    [
        ("mug_clean 0.10 s", "Aileron"),
        ("café Müller", "DejaVu Sans"),
        ("Кружка", "DejaVu Sans"),
        ("杯子", "Aileron"),  # boxes, as no font has it
    ],
)
def test_a_font_of_the_machine_draws_letters_that_the_font_of_pillow_lacks(
    words, family, monkeypatch
):
    monkeypatch.setattr(fonts, "OF_SYSTEMS", ("no such font.ttf", DEJAVU))
    font = fonts.font_of(words, 16)
    assert (font.getname()[0], font.size) == (family, 16)
