"""Progress is told when the work on an item is done, not when it begins."""

from geneoh.progress import steps


def test_every_step_is_told_after_its_work():
    told = []
    for item in steps("ab", lambda *now: told.append(now)):
        told.append(item)
    assert told == ["a", (1, 2), "b", (2, 2)]
    assert list(steps(range(3), None)) == [0, 1, 2]
