"""What a sentence asks for and the motion that was made for it lacks, in words."""

import torch

from geneoh.choices import SIDES
from geneoh.generators.text2hoi.choosing import moved_by
from geneoh.generators.text2hoi.physics.held_hands import frames_of_motion
from geneoh.generators.text2hoi.physics.resting import touching_hands
from geneoh.generators.text2hoi.sentences.passing import handed_over
from geneoh.generators.text2hoi.sentences.prompt import JOINTED, Prompt
from geneoh.synthesis.actions.action import Actions

HARDLY_MOVED = 0.01
"""How far an object moves at most that is told to rest, metres."""
IDLE = 0.5
"""Share of the object's moving frames in which each of two hands should touch it."""


def missing_notes(actions: Actions, prompt: Prompt, draws: int) -> tuple[str, ...]:
    """Notes on what the sentence asks for and the finished first action lacks."""
    found = []
    if prompt.verb != "press" and moved_by(actions)[0] < HARDLY_MOVED:
        found.append("the object hardly moves; another seed may make it move")
    touching, moves = touching_hands(actions)[0], frames_of_motion(actions)
    alone = not bool(moves.any()) or prompt.verb in ("pass", *JOINTED)  # one hand may do most of it
    held = (touching & moves).sum(1) >= IDLE * moves.sum()
    for number in torch.nonzero(actions.hands[0])[:, 0].tolist():
        if not bool(touching[number].any()):
            found.append(fault_note(draws, f"the {SIDES[number]} hand does not come to the object"))
        elif not alone and not bool(held[number]):
            found.append(fault_note(draws, f"the {SIDES[number]} hand hardly touches the object"))
    if prompt.giver is not None and not handed_over(touching, prompt.giver):
        found.append(fault_note(draws, f"the {prompt.giver} hand does not pass the object on"))
    return tuple(found)


def fault_note(draws: int, fault: str) -> str:
    """The note on a fault that even the best sample has."""
    drawn = f"the best of {draws} drawn motions" if draws > 1 else "the drawn motion"
    return f"in {drawn} {fault}; another seed or more draws may make a better one"
