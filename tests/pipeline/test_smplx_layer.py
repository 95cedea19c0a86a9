"""A hand of a sequence in smplx's own module stands where our own model puts it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import smplx
import torch
import trees

import geneoh
from geneoh.errors import InputError, MissingAssetError
from geneoh.fitting.subject import subject_of
from geneoh.hand.embedded import read_arrays
from geneoh.hand.library import load_hand
from geneoh.pipeline.smplx_layer import to_smplx
from geneoh.sequence.sequence import Sequence

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture(scope="module")
def recording() -> Sequence:
    return geneoh.load(EXAMPLES / "taco_clean.npz", obj=EXAMPLES / "taco_object.obj")


def with_track(sequence: Sequence, **fields) -> Sequence:
    return replace(sequence, hands=(replace(sequence.hands[0], **fields),))


def test_the_layer_poses_the_recorded_hand_as_we_do(recording):
    track, model = recording.hand("left"), load_hand("left")
    ours = subject_of(track, model).shaped.posed(track.pose, track.wrist)
    posed = to_smplx("left", recording)()
    assert posed.vertices.shape == (track.frames, 778, 3)
    assert (posed.vertices - ours.verts).abs().max() < 1e-5
    assert (posed.joints[:, 0] - track.wrist).norm(dim=-1).max() < 1e-5


def test_betas_of_the_same_hand_are_kept(recording):
    betas = torch.linspace(-1, 1, 10)
    layer = to_smplx("left", with_track(recording, betas=betas, hand_model="embedded"))
    assert torch.equal(layer.betas, betas.expand(recording.frames, 10))


def test_its_parameters_pose_another_layer_of_the_same_hand(recording):
    layer, other = to_smplx("left", recording), to_smplx("left", recording)
    pose = dict(layer.named_parameters())
    assert set(pose) == {"betas", "global_orient", "hand_pose", "transl"}
    other.reset_params()
    assert (other().vertices - layer().vertices).abs().max() > 0.1
    assert torch.equal(other(**pose).vertices, layer().vertices)


def test_a_right_hand_is_the_mirror_image_of_a_left_one(recording):
    mirrored = replace(recording, hands=(recording.hands[0].mirrored(),))
    flip = torch.tensor([-1.0, 1.0, 1.0])
    left, right = to_smplx("left", recording)(), to_smplx("right", mirrored)()
    assert (right.vertices - left.vertices * flip).abs().max() < 1e-5


def test_frames_without_the_hand_are_filled(recording):
    track = recording.hand("left")
    seen = torch.ones_like(track.valid)
    seen[5:8] = False
    lost = track.wrist.clone()
    lost[5:8] = torch.nan
    verts = to_smplx("left", with_track(recording, wrist=lost, valid=seen))().vertices
    assert torch.isfinite(verts).all()
    assert torch.allclose(verts[seen], to_smplx("left", recording)().vertices[seen], atol=1e-3)


def test_frames_without_any_hand_cannot_be_filled(recording):
    lost = torch.zeros_like(recording.hand("left").valid)
    with pytest.raises(InputError, match=r"must hold the left hand, got 146 frames without"):
        to_smplx("left", with_track(recording, valid=lost))


def test_smplx_says_nothing_of_its_own(recording, capsys):
    to_smplx("left", recording)
    assert capsys.readouterr().out == ""


def test_keypoints_alone_cannot_pose_it(recording):
    with pytest.raises(InputError, match=r"needs the left hand's 'pose'.*geneoh\.denoise"):
        to_smplx("left", with_track(recording, pose=None, wrist=None))


def test_a_mano_layer_has_the_users_hand_and_the_betas_that_belong_to_it(recording, tmp_path):
    fields = read_arrays() | {"hands_components": np.eye(45)}
    fields["v_template"] = fields["v_template"] * [-1.0, 1.0, 1.0] * 1.1
    fields["f"] = fields["f"][:, ::-1]
    np.savez(tmp_path / "MANO_LEFT.npz", **fields)
    track = recording.hand("left")
    assert track.hand_model == "mano-as-shipped"
    layer = to_smplx("left", recording, hand="mano", mano_dir=tmp_path)
    model = load_hand("left", source="mano-as-shipped", mano_dir=tmp_path)
    ours = model.shaped(track.betas).posed(track.pose, track.wrist)
    assert (layer().vertices - ours.verts).abs().max() < 1e-5
    assert (layer.faces_tensor == model.faces).all()


def test_a_pose_with_betas_of_mano_alone_has_the_shape_of_the_users_mano(
    recording, tmp_path, caplog
):
    folder, betas = trees.write_mano(tmp_path), torch.linspace(2, -2, 10)
    pose = with_track(recording[:5], joints=None, betas=betas, hand_model="mano")
    there = load_hand("left", source="mano", mano_dir=folder).shaped(betas).offsets.norm(dim=-1)
    off = [
        (load_hand("left").shaped(to_smplx("left", pose, mano_dir=given).betas[0]).offsets)
        .norm(dim=-1)
        .sub(there)
        .abs()
        .mean()
        for given in (None, folder)
    ]
    assert off[1] < off[0] / 2
    assert caplog.text.count("the mean hand is used") == 1


def test_a_mano_layer_needs_the_users_file(recording, tmp_path):
    with pytest.raises(MissingAssetError, match=r"MANO_LEFT\.pkl"):
        to_smplx("left", recording, hand="mano", mano_dir=tmp_path)


def test_the_output_of_the_program_is_left_alone(recording, capsys):
    layer = to_smplx("left", recording[:2])
    assert capsys.readouterr().out == ""
    assert type(layer) is smplx.MANO
