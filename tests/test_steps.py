"""Progress is told when the work on an item is done, not when it begins."""

from geneoh.progress import counted, part_of, steps


def test_every_step_is_told_after_its_work():
    told = []
    for item in steps("ab", lambda *now: told.append(now)):
        told.append(item)
    assert told == ["a", (1, 2), "b", (2, 2)]
    assert list(steps(range(3), None)) == [0, 1, 2]


def test_pieces_of_work_are_told_as_parts_of_all_of_it():
    told = []
    for piece in range(2):
        list(steps("ab", part_of(lambda *now: told.append(now), piece, 2)))
    assert told == [(1, 4), (2, 4), (3, 4), (4, 4)]
    assert part_of(None, 0, 2) is None


def test_a_counter_tells_the_steps_that_are_done():
    told = []
    advance = counted(lambda *now: told.append(now), 2)
    advance(), advance()
    counted(None, 2)()
    assert told == [(1, 2), (2, 2)]
