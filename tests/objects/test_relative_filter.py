"""Which of hand and object was filtered, told by how the one moves beside the other."""

from dataclasses import replace

import pytest
import torch

from geneoh.geometry.rigid import Rigid
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.objects.palms import palm_of
from geneoh.objects.relative_filter import Found, LowPass, compared
from geneoh.sequence.placing import placed
from geneoh.sequence.sequence import Sequence
from tools.noisy_objects.clips import clip_of, with_noisy_hand
from tools.noisy_objects.filters import filtered_as, lag, smooth

FRAME = 1 / 30
TIME = torch.arange(90) * FRAME
PATH = torch.stack([torch.sin(3 * TIME), torch.cos(2 * TIME), TIME**2], -1)  # metres


def comparison(sequence: Sequence):
    return compared(sequence.object, 0, palm_of(sequence.hands[0]), sequence.fps)


@pytest.mark.parametrize(
    ("through", "size", "filter_"),
    [
        (smooth, 2.0, LowPass(0.0, (2 * FRAME) ** 2)),
        # each frame counts by a share s: delay (1 - s) / s frames, variance (1 - s) / s²
        (lag, 0.5, LowPass(1 * FRAME, 2 * FRAME**2)),
    ],
)
def test_the_moments_of_a_filter_undo_it(through, size, filter_):
    blurred = torch.from_numpy(through(PATH.double().numpy(), size)).float()
    inner = slice(12, -12)
    before = (blurred - PATH)[inner].norm(dim=-1).mean()
    after = (filter_.undone(blurred, 30.0) - PATH)[inner].norm(dim=-1).mean()
    assert after < 0.05 * before


def test_filters_one_after_the_other_add_up_and_say_what_they_are():
    whole = LowPass(0.05, 0.003) + LowPass(0.02, 0.0019)
    assert str(whole) == "as by a filter with a deviation of 70 ms and 70 ms late"
    assert str(LowPass(0.0, 0.01)) == "as by a filter with a deviation of 100 ms"


@pytest.mark.parametrize("noise", ["clean", "gauss", "bias", "drift", "drop", "camera"])
def test_nothing_is_found_where_nothing_was_filtered(noise):
    for name in ("recording", "mug", "shaken mug", "beside mug"):
        found = comparison(with_noisy_hand(clip_of(name), noise, 0))
        assert found is None or (
            found.filter_of_part is found.filter_of_palm is found.delay is None
        ), name


@pytest.mark.parametrize("noise", ["clean", "gauss", "camera"])
# a recorded hand moves over what it holds
@pytest.mark.parametrize(("name", "within"), [("recording", 2 * FRAME), ("mug", FRAME)])
def test_the_filter_of_an_object_is_found(name, within, noise):
    noisy = with_noisy_hand(clip_of(name), noise, 0)
    late, smoothed = (comparison(filtered_as(noisy, kind)) for kind in ("lag 0.3", "smooth 3"))
    assert late.filter_of_palm is smoothed.filter_of_palm is None
    assert late.filter_of_part.delay == pytest.approx(7 / 3 * FRAME, abs=within)
    assert smoothed.filter_of_part.delay == pytest.approx(0, abs=within)
    assert smoothed.filter_of_part.variance**0.5 == pytest.approx(3 * FRAME, abs=within)


def with_a_lid(name: str, strokes: int, stroke: float) -> Sequence:
    """The hand of a clip that turns its object in place by so many strokes, radians, and goes back
    after each while the object rests."""
    held = torch.full((120,), 30)
    clip = clip_of(name)
    hands = tuple(replace(hand[held], betas=hand.betas) for hand in clip.hands)
    grip = replace(clip, hands=hands, object=clip.object[held])
    count, phase = torch.linspace(0, strokes, 121)[:-1].frac(), torch.linspace(0, strokes, 121)
    forth, back = (eased(each) for each in (count / 0.6, (count - 0.65) / 0.3))
    turns = stroke * (forth - back), stroke * (phase[:-1].floor() + forth)
    up = torch.tensor([0.0, 0.0, 1.0])
    middle = (
        grip.object.rotation[0] @ clip.object.meshes[0].center() + grip.object.translation[0]
    )[0]
    moved = []
    for angle in turns:
        turn = axis_angle_to_matrix(angle[:, None] * up)
        moved.append(placed(grip, Rigid(turn, middle - turn @ middle)))
    return replace(moved[0], object=moved[1].object)


def eased(share: torch.Tensor) -> torch.Tensor:
    """From 0 to 1 without a sudden change of speed."""
    inside = share.clamp(0, 1)
    return inside**2 * (3 - 2 * inside)


@pytest.mark.parametrize("name", ["mug", "ycb_005_tomato_soup_can.ply", "ycb_024_bowl.ply"])
@pytest.mark.parametrize(("strokes", "stroke"), [(3, 1.0), (3, 0.5), (4, 0.7)])
@pytest.mark.parametrize("noise", ["clean", "gauss", "drift"])
def test_a_lid_that_a_hand_turns_by_several_grips_was_not_filtered(name, strokes, stroke, noise):
    found = comparison(with_noisy_hand(with_a_lid(name, strokes, stroke), noise, 0))
    assert found.filter_of_part is found.filter_of_palm is found.delay is None


@pytest.mark.parametrize("noise", ["clean", "gauss"])
def test_the_filter_of_a_hand_is_found(noise):
    noisy = with_noisy_hand(clip_of("mug"), noise, 0)
    late = comparison(filtered_as(noisy, "hand lag 0.3"))
    smoothed = comparison(filtered_as(noisy, "hand smooth 3"))
    assert late.filter_of_part is smoothed.filter_of_part is None
    assert late.filter_of_palm.delay == pytest.approx(7 / 3 * FRAME, abs=FRAME / 2)
    assert smoothed.filter_of_palm.delay == pytest.approx(0, abs=FRAME / 2)


@pytest.mark.parametrize(("kind", "sign"), [("late 2", 1), ("hand late 2", -1)])
def test_of_a_delay_nothing_tells_whose_it_is(kind, sign):
    found = comparison(filtered_as(clip_of("mug"), kind))
    assert found.filter_of_part is found.filter_of_palm is None
    assert found.delay.delay == pytest.approx(sign * 2 * FRAME, abs=FRAME / 2)


@pytest.mark.parametrize(("lost", "of"), [(5, 10), (7, 14), (9, 16)])
def test_the_lines_that_fill_gaps_are_taken_for_no_filter(lost, of):
    """Of a scan of which single frames between gaps seem to show one."""
    clip = clip_of("ycb_035_power_drill.ply")
    (hand,) = clip.hands
    valid = torch.arange(clip.frames) % of < of - lost
    gone = ~valid[:, None, None]
    hand = replace(hand, valid=valid, joints=hand.joints.masked_fill(gone, torch.nan))
    found = compared(clip.object, 0, palm_of(replace(hand, pose=None, wrist=None)), clip.fps)
    assert found is None or found.filter_of_palm is found.filter_of_part is found.delay is None


@pytest.mark.parametrize(("start", "length"), [(46, 8), (37, 12), (43, 12)])
def test_a_hand_that_is_lost_on_the_way_was_not_filtered(start, length):
    """The object moves by a decimetre in the gap, and the line that fills it does not."""
    clip = clip_of("ycb_035_power_drill.ply")
    hand = clip.hands[0]
    valid = torch.ones(clip.frames, dtype=torch.bool)
    valid[start : start + length] = False
    found = compared(clip.object, 0, palm_of(replace(hand, valid=valid)), clip.fps)
    assert found.filter_of_palm is found.filter_of_part is found.delay is None


def test_a_single_frame_tells_nothing_at_any_rate():
    assert comparison(replace(clip_of("recording")[60:61], fps=1.0)) is None


def test_an_object_at_rest_tells_nothing():
    clip = clip_of("mug")
    still = clip.object.rotation[:1].expand_as(clip.object.rotation).clone()
    place = clip.object.translation[:1].expand_as(clip.object.translation).clone()
    motion = type(clip.object)(clip.object.meshes, still, place)
    assert compared(motion, 0, palm_of(clip.hands[0]), clip.fps) is None


def mirrored(sequence: Sequence) -> Sequence:
    hands = tuple(hand.mirrored() for hand in sequence.hands)
    return replace(sequence, hands=hands, object=sequence.object.mirrored())


@pytest.mark.parametrize("kind", ["lag 0.3", "hand smooth 3"])
def test_a_mirrored_hand_has_the_same_filter(kind):
    filtered = filtered_as(with_noisy_hand(clip_of("recording"), "camera", 0), kind)
    one, other = comparison(filtered), comparison(mirrored(filtered))
    for found, same in ((one.of_part, other.of_part), (one.of_palm, other.of_palm)):
        assert same.filter.delay == pytest.approx(found.filter.delay, abs=1e-6)
        assert same.filter.variance == pytest.approx(found.filter.variance, abs=1e-7)


@pytest.mark.parametrize("noise", ["clean", "gauss"])
def test_a_hand_that_is_surely_late_is_filtered_even_if_the_variance_is_unsure(noise):
    found = comparison(
        filtered_as(with_noisy_hand(clip_of("kettle")[:90], noise, 0), "hand lag 0.3")
    )
    assert not found.of_palm.is_wide
    assert found.filter_of_palm.delay == pytest.approx(7 / 3 * FRAME, abs=FRAME / 2)


@pytest.mark.parametrize(
    ("by_speeds", "agrees"), [(0.1, False), (0.8, True), (2.4, True), (6, False)]
)
def test_a_filter_shows_in_speeds_as_in_places(by_speeds, agrees):
    """True filters had 0.6 to 2.4 times the variance by speeds. A hand that MediaPipe saw drift by
    centimetres along the camera's ray seemed to show a filter of 649 ms, with 6 times."""
    variance = 0.649**2
    filter_ = LowPass(-0.182, variance)
    found = Found(filter_, 0.05, variance / 3.2, explained=0.15, by_speeds=by_speeds * variance)
    assert found.is_wide
    assert found.is_by_speeds == agrees
