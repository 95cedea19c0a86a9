"""Bundles of tensors: cut, joined and moved by the names of the axes in their annotations."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
import torch
from jaxtyping import Float, Int
from torch import Tensor

from geneoh.bundle import Bundle, concatenated, position, where
from geneoh.sequence.sequence import HandTrack

T = 6


@dataclass(frozen=True)
class Inner(Bundle):
    moving: Float[Tensor, "*B T 3"]
    still: Float[Tensor, "*B 20 3"]


@dataclass(frozen=True)
class Outer(Bundle):
    name: str
    inner: tuple[Inner, ...]
    missing: Float[Tensor, "T 2"] | None
    stored: dict[str, Float[np.ndarray, "T 3"]]
    pairs: tuple[Float[Tensor, "T 2"], Float[Tensor, "T 2"]]


@pytest.fixture
def outer() -> Outer:
    inner = Inner(torch.arange(2.0 * T * 3).reshape(2, T, 3), torch.ones(2, 20, 3))
    stored = {"right": np.arange(3.0 * T).reshape(T, 3)}
    return Outer("kept", (inner, inner), None, stored, (torch.zeros(T, 2), torch.ones(T, 2)))


def test_frames_are_cut_in_every_field_that_has_frames(outer):
    cut = outer[2:5]
    assert torch.equal(cut.inner[1].moving, outer.inner[1].moving[:, 2:5])
    assert torch.equal(cut.inner[0].still, outer.inner[0].still)
    assert np.array_equal(cut.stored["right"], outer.stored["right"][2:5])
    assert cut.pairs[1].shape == (3, 2)
    assert (cut.name, cut.missing) == ("kept", None)


def test_a_mask_and_indices_choose_frames_too(outer):
    mask = torch.tensor([True, False, False, True, False, True])
    backward = np.array([5, 3, 0])[::-1]
    for index in (mask, torch.tensor([0, 3, 5]), np.array([0, 3, 5]), [0, 3, 5], backward):
        assert torch.equal(outer[index].inner[0].moving, outer.inner[0].moving[:, [0, 3, 5]])
    assert outer[[]].inner[0].moving.shape[1] == 0


@pytest.mark.parametrize("index", [torch.tensor([4]), torch.arange(T) == 4])
def test_arrays_keep_the_axis_of_which_one_entry_is_chosen(outer, index):
    assert outer[index].stored["right"].shape == (1, 3)


def test_a_slice_that_runs_backward_is_refused_with_what_does(outer):
    with pytest.raises(ValueError, match=r"run forward along T.*torch.arange\(n - 1, -1, -1\)"):
        outer[::-1]


def test_a_single_frame_number_is_refused_because_it_would_remove_the_axis(outer):
    with pytest.raises(TypeError, match="slice"):
        outer[2]


def test_entries_of_the_batch_are_chosen_where_there_is_a_batch(outer):
    second = outer.inner[0].take(slice(1, 2), "B")
    assert second.moving.shape == (1, T, 3)
    assert second.still.shape == (1, 20, 3)
    assert outer.take(slice(1, 2), "B").pairs[0].shape == (T, 2)


def test_parts_joined_again_are_the_whole(outer):
    whole = concatenated([outer[:2], outer[2:]])
    assert torch.equal(whole.inner[1].moving, outer.inner[1].moving)
    assert torch.equal(whole.inner[1].still, outer.inner[1].still)
    assert np.array_equal(whole.stored["right"], outer.stored["right"])
    twice = concatenated([outer.inner[0]] * 2, "B")
    assert twice.moving.shape == (4, T, 3)
    assert twice.still.shape == (4, 20, 3)


def test_one_mask_of_the_first_axes_chooses_between_the_tensors_of_two_bundles():
    @dataclass(frozen=True)
    class Hand(Bundle):
        turn: Float[Tensor, "B T 3 3"]
        width: Float[Tensor, "B T"]

    mask = torch.tensor([[True, False, True], [False, False, True]])
    ones = Hand(torch.ones(2, 3, 3, 3), torch.ones(2, 3))
    found = where(mask, ones, ones.map(torch.zeros_like))
    assert torch.equal(found.width, mask.float())
    assert torch.equal(found.turn, mask.float()[..., None, None].expand(2, 3, 3, 3))


def test_moving_to_a_device_moves_every_tensor(outer):
    there = outer.to("meta")
    tensors = [there.inner[0].moving, there.inner[1].still, *there.pairs]
    assert {tensor.device.type for tensor in tensors} == {"meta"}


def test_a_function_is_applied_to_every_tensor_or_to_those_with_an_axis(outer):
    assert outer.map(lambda value: 2 * value).inner[0].still.eq(2).all()
    changed = outer.map(lambda value: value + 1, axis="T")
    assert changed.pairs[1].eq(2).all()
    assert changed.inner[0].still.eq(1).all()


@pytest.mark.parametrize(
    ("axis", "axes", "ndim", "expected"),
    [
        ("T", "T 21 3", 3, 0),
        ("T", "*#B T 21 3", 5, 2),
        ("T", "*#B T 21 3", 3, 0),
        ("T", "*B 20 3", 3, None),
        ("B", "*B 20 3", 4, 0),
        ("B", "*B 20 3", 2, None),
        ("T", "T ...", 4, 0),
    ],
)
def test_an_axis_stands_where_the_annotation_has_it(axis, axes, ndim, expected):
    assert position(axis, tuple(axes.split()), ndim) == expected


def test_a_tensor_whose_annotation_names_no_axes_cannot_be_cut():
    @dataclass(frozen=True)
    class Careless(Bundle):
        values: Tensor

    with pytest.raises(TypeError, match="annotation with its axes"):
        Careless(torch.zeros(3))[1:]


def test_a_new_per_frame_field_of_a_track_is_cut_by_its_annotation_alone():
    @dataclass(frozen=True)
    class Tracked(HandTrack):
        speed: Float[Tensor, " T"] | None = None
        touched: Int[Tensor, "T K"] | None = None
        width: Float[Tensor, " 2"] | None = None

    valid = torch.ones(T, dtype=torch.bool)
    track = Tracked("right", valid, joints=torch.zeros(T, 21, 3), width=torch.zeros(2))
    track = replace(track, speed=torch.arange(float(T)), touched=torch.zeros(T, 4).long())
    cut = track[1:3]
    assert cut.speed.tolist() == [1, 2]
    assert cut.touched.shape == (2, 4)
    assert torch.equal(cut.width, track.width)


def test_a_bundle_is_shown_by_the_shapes_of_its_tensors():
    track = HandTrack("left", torch.ones(4, dtype=torch.bool), joints=torch.zeros(4, 21, 3))
    assert "side='left', valid=Tensor(4,), joints=Tensor(4, 21, 3), pose=None" in repr(track)
