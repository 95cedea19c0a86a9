"""A hand whose object is centimetres off its place."""

import numpy as np

from geneoh.pipeline.contradictions import lasting_shift
from geneoh.pipeline.misfit import MovedFar


def test_a_shift_counts_if_it_lasts():
    before, counted = np.zeros((90, 3)), np.ones(90, dtype=bool)
    after = before.copy()
    after[40:45] = 0.1
    assert lasting_shift(before, after, counted) < 0.03
    after[:] = (0.03, 0.04, 0.0)
    assert np.isclose(lasting_shift(before, after, counted), 0.05)


def test_the_object_is_relied_on_up_to_some_shift():
    assert MovedFar(0.022).evidence == 1
    assert not list(MovedFar(0.022).note())
    assert 0 < MovedFar(0.036).evidence < 1
    assert MovedFar(0.05).evidence == 0
    (note,) = MovedFar(0.05).note()
    assert "move by 50 mm" in note
