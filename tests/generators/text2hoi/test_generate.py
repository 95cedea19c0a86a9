from dataclasses import replace
from pathlib import Path

import jaxtyping
import numpy as np
import pytest
import torch
import trimesh
from made_actions import WordEncoder
from made_networks import TINY
from two_parts import DEEP, HIGH, HINGE, box_with_lid

import geneoh
from geneoh.errors import ConfigError, InputError
from geneoh.generators.text2hoi import choosing
from geneoh.generators.text2hoi import generate as module
from geneoh.generators.text2hoi.generate import GenerateOptions, generate
from geneoh.generators.text2hoi.networks.autoencoders import (
    ContactNetwork,
    LengthConfig,
    LengthNetwork,
)
from geneoh.generators.text2hoi.networks.interaction import InteractionNetwork
from geneoh.generators.text2hoi.networks.library import Text2HoiNetworks
from geneoh.generators.text2hoi.physics.resting import touching_hands
from geneoh.generators.text2hoi.sampling import sample_actions
from geneoh.geometry.mesh_files import from_trimesh
from geneoh.pipeline.results import Denoised

PLAIN = GenerateOptions(refine="none", frames=20, steps=3)


@pytest.fixture(autouse=True)
def small_networks(monkeypatch):
    """Networks that have learned nothing: what they make is no motion, but is a clip."""
    torch.manual_seed(0)
    contact, interaction = ContactNetwork(TINY.contact), InteractionNetwork(TINY.interaction)
    encoder = WordEncoder()
    length = LengthNetwork(LengthConfig(text=encoder.width))
    made = Text2HoiNetworks(encoder, contact.eval(), interaction.eval(), length.eval())
    monkeypatch.setattr(module, "load_text2hoi", lambda *folder, **more: made)


@pytest.fixture(scope="module")
def mug(tmp_path_factory):
    """The file of a cylinder away from the origin, along the y axis."""
    path = tmp_path_factory.mktemp("mug") / "mug.obj"
    made = trimesh.creation.cylinder(0.04, 0.1, sections=24)
    made.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0]))
    made.apply_translation([0.2, 0.3, -0.1])
    made.export(path)
    return path


@pytest.mark.parametrize(
    "wrong",
    [
        *({"frames": 1}, {"frames": 300}, {"steps": 0}, {"steps": 2000}, {"draws": 0}),
        *({"guidance": -1.0}, {"guidance": float("nan")}, {"seed": -1}, {"refine": "all"}),
    ],
)
def test_values_that_no_setting_has_are_refused(wrong, monkeypatch):
    monkeypatch.setattr(jaxtyping.config, "jaxtyping_disable", True)  # as for users
    (name,) = wrong
    with pytest.raises(ConfigError, match=f"GenerateOptions: '{name}' must be "):
        GenerateOptions(**wrong)


def test_settings_take_folders_as_text_and_numbers_of_numpy(monkeypatch):
    monkeypatch.setattr(jaxtyping.config, "jaxtyping_disable", True)
    made = GenerateOptions(weights="runs", seed=np.int64(3), guidance=np.float32(2))
    assert made == GenerateOptions(weights=Path("runs"), seed=3, guidance=2.0)


@pytest.mark.parametrize(
    ("sentence", "sides"),
    [
        ("Lift the mug with the left hand.", ["left"]),
        ("The right hand shakes a mug.", ["right"]),
        ("Carry the mug with both hands.", ["left", "right"]),
    ],
)
def test_the_hands_that_were_asked_for_take_part(mug, sentence, sides):
    made = generate(sentence, mug, PLAIN)
    assert sorted(hand.side for hand in made.sequence.hands) == sides
    assert made.sequence.frames == 20
    assert made.sequence.fps == 30


def test_one_seed_makes_one_file_and_another_seed_another(mug, tmp_path):
    for name, seed in (("a", 0), ("b", 0), ("c", 1)):
        made = generate("Lift the mug with the left hand.", mug, replace(PLAIN, seed=seed))
        geneoh.save(made, tmp_path / f"{name}.npz")
    first, again, other = ((tmp_path / f"{name}.npz").read_bytes() for name in "abc")
    assert first == again
    assert first != other


def test_the_file_is_a_sequence_with_contact_at_the_vertices_and_the_sentence(mug, tmp_path):
    made = generate("Lift the mug with the left hand.", mug, PLAIN)
    geneoh.save(made, tmp_path / "made.npz")
    found = geneoh.load(tmp_path / "made.npz")
    assert [hand.side for hand in found.hands] == ["left"]
    assert torch.allclose(found.object.rotation, made.sequence.object.rotation)
    with np.load(tmp_path / "made.npz") as arrays:
        assert arrays["contact"].shape == (len(made.sequence.object.meshes[0].verts),)
        assert ((arrays["contact"] >= 0) & (arrays["contact"] <= 1)).all()
        assert str(arrays["prompt"]) == "Lift the mug with the left hand."
        assert str(arrays["verb"]) == "lift"
        assert tuple(arrays["notes"]) == made.prompt.notes


def test_what_the_cleaner_notes_on_the_clip_is_told_and_kept(mug):
    made = generate("Lift the mug with the left hand.", mug, PLAIN)
    made = replace(made, refined=Denoised(made.sequence, {}, ("the mesh is open",)))
    assert str(made).endswith("\nnote: the mesh is open")
    assert made.extra_arrays()["notes"].tolist() == [*made.prompt.notes, "the mesh is open"]


def test_a_hand_that_goes_through_a_wall_is_told_in_the_file(mug, monkeypatch):
    made = generate("Lift the mug with the left hand.", mug, PLAIN)
    monkeypatch.setattr(Denoised, "notes_on_made_hands", lambda _: ("left hand: through a wall",))
    made = replace(made, refined=Denoised(made.sequence, {}, ()))
    assert made.extra_arrays()["notes"].tolist()[-1] == "left hand: through a wall"


def test_the_object_stands_on_the_table_as_it_was_asked_to(mug, monkeypatch):
    monkeypatch.setattr(module, "finished", lambda actions, settle: still_actions(actions))
    made = generate("Lift the mug.", mug, replace(PLAIN, up="y"))
    motion = made.sequence.object
    world = motion.meshes[0].verts @ motion.rotation[0, 0].T + motion.translation[0, 0]
    size = world.amax(0) - world.amin(0)
    assert world[:, 2].amin() == pytest.approx(0, abs=1e-5)
    assert size[2] == pytest.approx(0.1, abs=1e-3)


def still_actions(actions):
    """The same actions with an object that stands where it is put."""
    still = torch.eye(3).expand_as(actions.rotation)
    return replace(actions, rotation=still, translation=torch.zeros_like(actions.translation))


def test_objects_rest_where_no_hand_touches_them(mug, monkeypatch):
    kept = []
    monkeypatch.setattr(
        module, "placed_sequence", lambda actions, *more: kept.append(actions) or 1 / 0
    )
    with pytest.raises(ZeroDivisionError):
        generate("Shake the mug.", mug, PLAIN)
    (actions,) = kept
    touching = touching_hands(actions).any(1)[0]
    still = ~(touching[1:] & touching[:-1])
    step = actions.translation[0].diff(dim=0).norm(dim=-1)
    turn = actions.rotation[0].diff(dim=0).flatten(1).norm(dim=-1)
    assert (step[still] < 1e-5).all()
    assert (turn[still] < 1e-5).all()


def test_the_cleaner_mends_hands_that_were_brought_to_the_surface(mug, monkeypatch):
    order = []

    def cleaned(sequence, options, on_progress):
        order.append("cleaned")
        assert options.trust_object
        return Denoised(sequence, {}, ())

    def brought(actions, stood, *, generator):
        order.append("settled")
        return actions

    monkeypatch.setattr(module, "clean_interaction", cleaned)
    monkeypatch.setattr(module, "settled", brought)
    made = generate("Lift the mug.", mug, replace(PLAIN, refine="geneoh"))
    assert order == ["settled", "cleaned"]
    assert made.refined is not None


def test_length_comes_from_the_sentence_where_none_is_asked_for(mug):
    made = generate("Lift the mug.", mug, replace(PLAIN, frames=None))
    assert 2 <= made.sequence.frames <= 150


def test_a_direction_of_passing_that_was_not_drawn_is_told(mug, monkeypatch):
    said = "pass it from the left hand to the right hand"
    for passed, told in ((False, 1), (True, 0)):
        monkeypatch.setattr(choosing, "handed_over", lambda *_, passed=passed: passed)
        notes = generate(said, mug, PLAIN).prompt.notes
        said_so = "in the best of 8 drawn motions the left hand does not pass the object on"
        assert sum(said_so in note for note in notes) == told


def test_hands_that_do_not_carry_the_object_are_told(mug, monkeypatch):
    for missed, told in ((0.01, 1), (-0.01, 0)):
        monkeypatch.setattr(module, "missed_motion", lambda _, by=missed: torch.tensor([by]))
        notes = generate("lift it", mug, replace(PLAIN, draws=1)).prompt.notes
        assert sum("motion hands are not always at the object" in note for note in notes) == told


def test_a_hand_that_does_not_come_to_the_object_is_told(mug, monkeypatch):
    for frames, words in ((0, "does not come to"), (8, "hardly touches"), (20, "")):
        touching = torch.ones(1, 2, 20, dtype=torch.bool)
        touching[0, 0, frames:] = False
        monkeypatch.setattr(choosing, "touching_hands", lambda _, touching=touching: touching)
        monkeypatch.setattr(choosing, "frames_of_motion", lambda _: torch.ones(20) > 0)
        notes = generate("lift it with both hands", mug, PLAIN).prompt.notes
        said_so = f"in the best of 8 drawn motions the left hand {words} the object"
        assert sum(said_so in note for note in notes) == bool(words)
        assert not any("the right hand" in note for note in notes)


def test_an_unusual_length_gets_the_motion_of_a_usual_one(mug, monkeypatch):
    asked = []

    def sampled(*given, **more):
        asked.append(int(given[4]))
        return sample_actions(*given, **more)

    monkeypatch.setattr(module, "sample_actions", sampled)
    for frames in (20, 150, None):
        made = generate("lift the mug with the left hand", mug, replace(PLAIN, frames=frames))
        assert frames is None or made.sequence.frames == frames
    short, long, usual = asked
    assert 20 < short <= usual <= long < 150


@pytest.mark.parametrize(("said", "told"), [("lift it", True), ("press it", False)])
def test_an_object_that_hardly_moves_is_told_unless_it_is_pressed(mug, monkeypatch, said, told):
    def notes_of(moved):
        monkeypatch.setattr(choosing, "moved_by", lambda _: torch.tensor([moved]))
        return generate(said, mug, PLAIN).prompt.notes

    note = "the object hardly moves; another seed may make it move"
    assert any(note in each for each in notes_of(0.005)) is told
    assert not any("hardly moves" in each for each in notes_of(0.02))


def test_a_part_that_moves_through_a_small_range_is_not_said_to_rest(monkeypatch):
    monkeypatch.setattr(module, "missing_notes", lambda actions, *_: kept.append(actions) or ())
    kept = []
    joint = HINGE.replace(":100", ":3")
    made = generate("open the box with the right hand", box_with_lid(), PLAIN, joint=joint)
    moved = replace(kept[0], joint=torch.linspace(0, 0.05, 20)[None])
    for actions, told in ((moved, False), (replace(moved, joint=torch.zeros(1, 20)), True)):
        notes = choosing.missing_notes(actions, made.prompt, 8)
        assert any("hardly moves" in note for note in notes) is told


def test_a_mesh_in_memory_will_do():
    mesh = from_trimesh(trimesh.creation.box((0.05, 0.06, 0.1)))
    assert generate("Lift the box.", mesh, PLAIN).sequence.frames == 20


def test_what_is_told_of_the_result_is_measured_of_what_is_written(mug, tmp_path):
    made = generate("Lift the mug with the left hand.", mug, replace(PLAIN, refine="geneoh"))
    geneoh.save(made, tmp_path / "clip.npz")
    again = geneoh.denoise(tmp_path / "clip.npz", preset="fast")
    assert made.refined is not None
    told, measured = made.refined.hands["left"].after, again.hands["left"].before
    assert told.acceleration_mm > 0.1
    assert told.as_dict() == pytest.approx(measured.as_dict(), rel=0.02, abs=0.02, nan_ok=True)


@pytest.mark.parametrize("verb", ["open", "close"])
def test_the_lid_of_a_box_that_stands_turns_about_its_hinge_within_its_range(verb):
    made = generate(f"{verb} the box with the right hand", box_with_lid(), PLAIN, joint=HINGE)
    motion = made.sequence.object
    base, lid = (motion.rotation[:, part] for part in range(2))
    assert torch.allclose(base, base[:1].expand_as(base), atol=1e-6)
    pivot = torch.tensor([0.0, DEEP / 2, HIGH])
    at_pivot = [motion.rotation[:, part] @ pivot + motion.translation[:, part] for part in (0, 1)]
    assert torch.allclose(*at_pivot, atol=1e-5)
    turned = base.mT @ lid
    assert torch.allclose(turned[:, 0, 0], torch.ones(20), atol=1e-5)
    angle = torch.atan2(turned[:, 1, 2], turned[:, 1, 1])
    assert (angle >= -1e-4).all()
    assert (angle <= np.deg2rad(100) + 1e-4).all()
    assert angle[-1 if verb == "close" else 0] == pytest.approx(0, abs=1e-4)
    assert not any("no joint" in note for note in made.prompt.notes)


def test_a_closed_box_is_carried_as_one():
    made = generate("carry the box with the right hand", box_with_lid(), PLAIN)
    motion = made.sequence.object
    assert len(motion.meshes) == 2
    assert torch.allclose(motion.rotation[:, 0], motion.rotation[:, 1], atol=1e-6)
    assert torch.allclose(motion.translation[:, 0], motion.translation[:, 1], atol=1e-6)
    assert len(made.contact) == sum(len(mesh.verts) for mesh in motion.meshes)


def test_the_joint_that_was_found_is_told():
    notes = generate("open the box", box_with_lid(), PLAIN).prompt.notes
    assert any("the joint is found from the meshes: --joint hinge:" in note for note in notes)


def test_one_mesh_that_is_to_be_opened_is_told_to_have_no_joint(mug):
    notes = generate("open the mug", mug, PLAIN).prompt.notes
    assert any("a mesh has no joint to open" in note for note in notes)
    with pytest.raises(InputError, match="a joint is of an object of two parts"):
        generate("open the mug", mug, PLAIN, joint=HINGE)
