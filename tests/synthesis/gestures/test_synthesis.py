"""What bodies do in gestures: where hands are, what they look like, how smoothly they move."""

import pytest
import torch
from draws import seeded

from geneoh.body.motion import pose
from geneoh.body.skeleton import FINGER_JOINTS, JOINT_NAMES, WRISTS
from geneoh.synthesis.draws import Draws
from geneoh.synthesis.gestures import synthesis
from geneoh.synthesis.gestures.clips import REST
from geneoh.synthesis.gestures.hands import stroke, taps
from geneoh.synthesis.gestures.one_handed import ONE_HANDED
from geneoh.synthesis.gestures.repertoire import SHAPES, GestureShares
from geneoh.synthesis.gestures.synthesis import BodyConfig, Role, Roles, draw_roles, gesturing
from geneoh.synthesis.gestures.two_handed import TWO_HANDED
from geneoh.synthesis.gestures.variation import HandSettings, Variation


def clips_of(names, monkeypatch, walking=0.0, frames=90):
    """A clip of each gesture, of the right hand where it is of one."""
    roles = iter(names)

    def drawn(*_):
        name = next(roles)
        if name in ONE_HANDED:
            return Roles(Role(REST), Role(name, 0, ONE_HANDED[name]))
        pair = TWO_HANDED[name]
        return Roles(Role(name, 0, pair.left or pair), Role(name, 0, pair), pair)

    monkeypatch.setattr(synthesis, "draw_roles", drawn)
    config = BodyConfig(shares=GestureShares(walking=walking, seated=0.0))
    bodies = list(range(len(names)))
    return gesturing([], bodies, frames, config, generator=seeded(1))


@pytest.fixture(scope="module")
def random_clips():
    variants = [(name, n) for name in (*ONE_HANDED, *TWO_HANDED) for n in range(3)]
    return gesturing(variants, list(range(8)), 90, BodyConfig(), generator=seeded(3))


def test_hands_move_smoothly_and_no_faster_than_people(random_clips):
    hands = pose(random_clips.skeleton, random_clips.motion).positions[:, :, list(WRISTS.values())]
    speed = 30 * torch.diff(hands, dim=1).norm(dim=-1)
    assert speed.max() < 6.0
    turns = torch.diff(random_clips.motion.rotations, dim=1).norm(dim=(-1, -2))
    assert turns[:, :, 1:].max() < 1.2  # Frobenius norm of the change in a frame


def test_feet_stay_on_the_ground(random_clips):
    posed = pose(random_clips.skeleton, random_clips.motion).positions
    ankles = posed[:, :, [JOINT_NAMES.index(f"{side}_ankle") for side in ("left", "right")], 1]
    assert (ankles.amin(-1) - 0.075).abs().max() < 0.06


def test_a_clip_begins_at_the_origin_and_faces_forward(random_clips):
    assert random_clips.root[:, 0, ::2].abs().max() < 0.02
    assert (random_clips.motion.rotations[:, 0, 0, 2, 2] > 0.99).all()


def test_the_palms_of_a_clap_meet_and_part(monkeypatch):
    clip = clips_of(["clap"], monkeypatch)
    posed = pose(clip.skeleton, clip.motion)
    middles = [posed.positions[0, :, FINGER_JOINTS[side][3]] for side in ("left", "right")]
    apart = (middles[0] - middles[1]).norm(dim=-1)[40:75]
    assert 0.02 < apart.min() < 0.09
    assert apart.max() > 0.14


def test_a_resting_hand_hangs_while_the_other_one_waves(monkeypatch):
    clip = clips_of(["wave"], monkeypatch)
    left, right = pose(clip.skeleton, clip.motion).positions[0, 60, list(WRISTS.values())]
    assert right[1] - left[1] > 0.15
    assert clip.gesture.tolist() == [[0, 1]]


def test_the_number_of_fingers_shown_differs_while_the_arm_does_not(monkeypatch):
    one, five = SHAPES["one"].fingers(), SHAPES["open"].fingers()
    assert one[3:12, 2].min() > 0.9  # middle, pinky and ring are bent at every joint
    assert five[:12, 2].abs().max() < 0.2
    first, last = (ONE_HANDED[f"show {n}"].start for n in ("one", "five"))
    assert (first.place, first.along, first.palm) == (last.place, last.along, last.palm)


def test_people_who_walk_come_forward_and_those_who_stand_do_not(monkeypatch):
    walks = clips_of(["wave", "count"], monkeypatch, walking=1.0)
    stands = clips_of(["wave", "count"], monkeypatch)
    assert (walks.root[:, -1, 2] > 0.7).all()
    assert (stands.root[:, -1, 2].abs() < 0.1).all()


def test_strokes_go_to_the_end_and_back():
    phase = torch.tensor([-1.0, 0.0, 0.5, 1.0])
    for course in ("swing", "strike"):
        assert torch.allclose(stroke(course, phase), torch.tensor([0.0, 0, 1, 0]), atol=1e-6)
    assert torch.allclose(stroke("once", phase), torch.tensor([0.0, 0, 1, 0]), atol=1e-6)
    assert stroke("still", phase).abs().max() == 0


def test_rippling_fingers_tap_one_after_the_other_from_the_pinky_on():
    phase = torch.linspace(0, 0.9, 91)
    bent = taps("ripple", phase, Draws(1, seeded()))
    index, middle, pinky, ring = bent.argmax(0).tolist()
    assert pinky < ring < middle < index


def test_typing_fingers_tap_at_the_turn_of_a_stroke_alone():
    bent = taps("taps", torch.linspace(0, 10, 1001), Draws(1, seeded()))
    assert bent[50::100].amax(1).min() > 0.9
    assert bent[::100].amax() < 0.05


def test_palms_that_meet_do_not_vary_sideways():
    variation = Variation.drawn(Draws(1, seeded()), HandSettings())
    meeting = variation.with_palms_together()
    assert variation.place[0] != 0
    assert meeting.place[0] == 0
    assert meeting.size == 1.0


def test_roles_are_drawn_of_one_gesture_alone():
    for name in ("wave", "clap"):
        roles = [
            draw_roles([(name, 2)], GestureShares(), Draws(1, seeded(seed))) for seed in range(12)
        ]
        named = {role.name for each in roles for role in (each.left, each.right)}
        assert named <= {name, REST}
        assert name in named
