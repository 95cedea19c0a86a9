"""Objects and hands whose poses stay behind what they move with."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from carried_box import AT_REST, FRAMES, HELD, LOST, PLACES, off, palm, passed, resting
from pretended_device import PretendedDevice
from scipy.spatial.transform import Rotation

from geneoh.evaluation.protocols.synthetic import draw_clip
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.objects.held_in_gaps import held_in_gaps
from geneoh.objects.palms import RigidMotion
from geneoh.objects.stuck import behind_object, without_stuck_poses
from geneoh.pipeline.denoise import denoise
from geneoh.pipeline.options import Options
from geneoh.seeds import seeded_generator
from geneoh.sequence.noise import corrupt_sequence
from geneoh.sequence.sequence import ObjectTrack


def kept(motion: ObjectTrack, frames: slice = LOST, share: float = 0.0) -> ObjectTrack:
    """A track that makes only a share of its motion in some frames, from the last one before."""
    numbers = torch.arange(len(motion.translation))
    since = numbers[frames] - frames.start + 1
    numbers[frames] = frames.start - 1 + (share * since).round().long()
    return motion[numbers]


def jittered(motion: ObjectTrack, turn: float, shift: float) -> ObjectTrack:
    """A track with white noise, radians and metres per axis."""
    size, generator = motion.translation.shape, seeded_generator("stuck")
    turns = axis_angle_to_matrix(turn * torch.randn(size, generator=generator))
    places = motion.translation + shift * torch.randn(size, generator=generator)
    return replace(motion, rotation=motion.rotation @ turns, translation=places)


def filled(given: ObjectTrack, *palms) -> ObjectTrack:
    """The track without poses that stay behind, moved with the palms there."""
    found, notes = without_stuck_poses(given, palms, 30.0)
    assert len(notes) == 1
    return held_in_gaps(found, palms)


@pytest.mark.parametrize("share", [0.0, 0.3])
@pytest.mark.parametrize(
    ("noise", "turned", "turn", "shift", "left"),
    [(0.0, 0.0, 0.0, 0.0, 0.05), (0.003, 0.03, 0.0, 0.0, 0.25), (0.003, 0.03, 0.01, 0.002, 0.25)],
)
def test_an_object_that_stays_behind_and_leaps_moves_with_the_palm(
    share, noise, turned, turn, shift, left
):
    given = jittered(kept(HELD, share=share), turn, shift)
    for palms in ([palm(noise, turned)], [AT_REST, palm(noise, turned)]):
        found = filled(given, *palms)
        assert off(found, HELD) < left * off(given, HELD)
        wrong = (~found.observed[:, 0]).nonzero()[:, 0].tolist()
        assert abs(wrong[0] - LOST.start) <= 3
        assert wrong[-1] == LOST.stop - 1


def test_so_it_does_where_it_was_taken_from_rest():
    truth = passed(resting(20), HELD, 20)
    stays = slice(20, 34)
    given = kept(truth, stays)
    assert off(filled(given, palm()), truth, stays) < 0.15 * off(given, truth, stays)


@pytest.mark.parametrize("shift", [0.0, 0.002])
def test_so_it_does_where_it_was_put_down_before_it_is_found(shift):
    truth = passed(HELD, resting(30), 30)
    stays = slice(20, 45)
    given = jittered(kept(truth, stays), 0.0, shift)
    assert off(filled(given, palm()), truth, stays) < 0.15 * off(given, truth, stays)


def test_so_it_does_where_it_was_taken_and_put_down():
    truth = passed(passed(resting(18), HELD, 18), resting(36), 36)
    stays = slice(18, 48)
    given = kept(truth, stays)
    assert off(filled(given, palm()), truth, stays) < 0.15 * off(given, truth, stays)


def test_objects_of_another_device_stay_there():
    given = kept(passed(HELD, resting(30), 30), slice(20, 45))
    expected, _ = without_stuck_poses(given, (palm(),), 30.0)
    behind = behind_object(stuck_palm(LOST, 0.0, 0.0), 0.07, HELD, 30.0)
    with PretendedDevice() as device:
        found, _ = without_stuck_poses(given.to(device), (palm(),), 30.0)
        again = behind_object(stuck_palm(LOST, 0.0, 0.0), 0.07, HELD.to(device), 30.0)
        assert found.translation.device == device
    assert found.to("cpu").observed.equal(expected.observed)
    assert again.equal(behind)


def moved(motion: ObjectTrack, frames: slice, shift: float, turn: float) -> ObjectTrack:
    """A track that is elsewhere in some frames, by metres along x and by radians about it."""
    places, turns = motion.translation.clone(), motion.rotation.clone()
    places[frames] += torch.tensor([shift, 0.0, 0.0])
    turns[frames] = turns[frames] @ axis_angle_to_matrix(torch.tensor([turn, 0.0, 0.0]))
    return replace(motion, rotation=turns, translation=places)


@pytest.mark.parametrize(
    "given",
    [
        HELD,
        resting(20),
        passed(resting(20), HELD, 20),
        jittered(HELD, 0.17, 0.01),
        moved(HELD, LOST, 0.1, 0.0),
        moved(HELD, LOST, 0.0, 3.1),
        moved(HELD, slice(30, None), 0.2, 0.5),
        moved(resting(20), slice(30, None), 0.2, 0.5),
        kept(HELD, slice(30, FRAMES)),
    ],
    ids=["held", "rests", "taken", "shakes", "leaps", "flips", "stays away", "moved", "lost"],
)
def test_other_motion_and_other_faults_stay(given):
    found, notes = without_stuck_poses(given, (palm(0.003, 0.03),), 30.0)
    assert found is given
    assert notes == ()


def test_an_object_that_leaps_from_a_palm_was_not_stuck():
    near = np.linspace(1.0, 0.0, 20)[:, None] * [0.3, 0.0, 0.0]
    comes = replace(palm(), turns=Rotation.identity(FRAMES), places=np.zeros((FRAMES, 3)))
    comes.places[:20] = near
    given = moved(resting(0), slice(45, None), 0.1, 0.0)
    place = torch.tensor([0.05, 0.0, 0.0])
    given = replace(given, translation=given.translation - given.translation[0] + place)
    assert without_stuck_poses(given, (comes,), 30.0)[0] is given


def stuck_palm(frames: slice, share: float, noise: float) -> RigidMotion:
    """A palm with white noise that makes only a share of its motion in some frames."""
    numbers, truth, noisy = np.arange(FRAMES), palm(), palm(noise, 5 * noise)
    since = numbers[frames] - frames.start + 1
    numbers[frames] = frames.start - 1 + np.round(share * since).astype(int)
    shift = noisy.places - truth.places
    return replace(truth, turns=noisy.turns[numbers], places=truth.places[numbers] + shift)


@pytest.mark.parametrize("share", [0.0, 0.3])
@pytest.mark.parametrize("noise", [0.0, 0.002, 0.005])
def test_a_palm_that_stays_behind_the_object_that_it_holds_is_told(share, noise):
    found = behind_object(stuck_palm(LOST, share, noise), 0.07, HELD, 30.0)
    wrong = found.nonzero()[:, 0].tolist()
    assert abs(wrong[0] - LOST.start) <= 3
    assert wrong[-1] == LOST.stop - 1


def test_a_palm_by_an_object_at_rest_or_with_it_does_not_stay_behind():
    for motion in (HELD, resting(20), kept(HELD, slice(30, FRAMES)), moved(HELD, LOST, 0.1, 0.0)):
        assert not behind_object(palm(0.003, 0.03), 0.07, motion, 30.0).any()
    leaps = replace(palm(), places=PLACES + 0.2 * (np.arange(FRAMES) >= 30)[:, None])
    assert not behind_object(leaps, 0.07, resting(20), 30.0).any()


@pytest.mark.slow
@pytest.mark.parametrize("noise", ["clean", "gauss"])
def test_a_hand_that_stays_behind_its_object_is_carried_by_it(noise):
    clip = draw_clip("kettle", 0, 60)  # lifted from frame 23 to 39
    (hand,), stays = clip.hands, slice(25, 37)
    given = clip
    if noise != "clean":
        given = corrupt_sequence(clip, noise, generator=seeded_generator("stuck hand"))
    (seen,) = given.hands
    shift = kept(clip.object, stays).translation[:, 0] - clip.object.translation[:, 0]
    behind = replace(seen, joints=seen.joints + shift[:, None], wrist=seen.wrist + shift)
    result = denoise(replace(given, hands=(behind,)), Options(preset="fast"))
    assert any("stays behind the object that it holds" in doubt for doubt in result.doubts)
    (cleaned,) = result.hands.values()
    apart = (cleaned.track.joints - hand.joints).norm(dim=-1).mean(-1)
    assert float(apart[stays].mean()) < 0.25 * float(shift[stays].norm(dim=-1).mean())


@pytest.mark.slow
def test_a_hand_is_cleaned_as_with_right_poses_and_the_object_is_refined():
    clip = draw_clip("kettle", 0, 60)  # lifted from frame 23 to 39
    motion, stays = clip.object, slice(25, 37)
    given = replace(clip, object=jittered(kept(motion, stays), 0.01, 0.002))
    result = denoise(given, Options(preset="fast", refine_object=True))
    assert any("stays behind the hand" in note for note in result.notes)
    assert not any("timing" in doubt for doubt in result.doubts)

    def apart(found: ObjectTrack) -> float:
        verts = motion.meshes[0].verts
        one, other = (
            verts @ each.rotation[stays, 0].mT + each.translation[stays] for each in (found, motion)
        )
        return float((one - other).norm(dim=-1).mean())

    assert apart(result.sequence.object) < 0.3 * apart(given.object)
