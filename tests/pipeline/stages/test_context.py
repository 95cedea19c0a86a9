from dataclasses import replace

import pytest
import torch
import trimesh
from draws import seeded
from short_clips import example

from geneoh.fitting.subject import subject_of
from geneoh.geometry.mesh import Mesh
from geneoh.hand.library import load_hand
from geneoh.pipeline.stages.context import stage_context
from geneoh.sequence.normalisation import normalised_hands
from geneoh.sequence.sequence import Sequence


def with_table(clip: Sequence, away: float) -> Sequence:
    """The clip with a table as a second part, some metres from where the object is first."""
    box = trimesh.creation.box((1.5, 0.03, 0.8))
    table = Mesh(torch.tensor(box.vertices).float(), torch.tensor(box.faces))
    motion = clip.object
    place = motion.translation[:1, 0] + torch.tensor([0.0, away, 0.0])
    return replace(
        clip,
        object=replace(
            motion,
            meshes=(*motion.meshes, table),
            rotation=torch.cat([motion.rotation, torch.eye(3).expand(clip.frames, 1, 3, 3)], 1),
            translation=torch.cat(
                [motion.translation, place.expand(clip.frames, 3)[:, None]], dim=1
            ),
        ),
    )


@pytest.mark.parametrize(("away", "fewest", "most"), [(3.0, 1, 16), (0.1, 500, 1024)])
def test_a_table_that_the_hand_is_never_near_gets_few_points(away, fewest, most):
    (hand,) = normalised_hands(with_table(example(), away))
    subject = subject_of(hand.track, load_hand("right"))
    context = stage_context(hand.object.surface(), subject, hand.fps, generator=seeded())
    assert fewest <= int((context.part == 1).sum()) <= most
    assert len(context.points) >= 1000
