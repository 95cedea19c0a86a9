"""A sequence's file knows the files of its object's meshes."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

import geneoh
from geneoh.errors import InputError
from geneoh.files.npz import read_archive, write_archive
from geneoh.geometry.mesh_files import load_mesh
from geneoh.pipeline.inputs import as_sequence

EXAMPLES = Path(__file__).parents[3] / "examples"


@pytest.fixture
def kept(tmp_path) -> Path:
    """A sequence in one folder, its mesh in another beside it."""
    for folder in ("results", "objects"):
        (tmp_path / "here" / folder).mkdir(parents=True)
    mesh = shutil.copy(EXAMPLES / "taco_object.obj", tmp_path / "here/objects/tool.obj")
    sequence = geneoh.load(EXAMPLES / "taco_noisy.npz", obj=mesh)
    geneoh.save(sequence, tmp_path / "here/results/a.npz")
    return tmp_path / "here/results/a.npz"


def test_meshes_are_found_again_without_being_named(kept):
    (mesh,) = geneoh.load(kept).object.meshes
    assert mesh.source == kept.parent / "../objects/tool.obj"
    assert mesh.sha256 == load_mesh(EXAMPLES / "taco_object.obj").sha256
    assert read_archive(kept)["object_files"].tolist() == ["../objects/tool.obj"]


def test_meshes_are_found_again_after_the_program_went_to_another_folder(kept, monkeypatch):
    monkeypatch.chdir(kept.parent)
    sequence = geneoh.load("a.npz", obj="../objects/tool.obj")
    monkeypatch.chdir(kept.parents[2])
    geneoh.save(sequence, "elsewhere.npz")
    assert len(geneoh.load("elsewhere.npz").object.meshes) == 1


@pytest.mark.parametrize(("unit", "scale"), [("mm", 1000), ("cm", 100)])
def test_a_mesh_in_another_unit_is_found_again_in_metres(tmp_path, unit, scale):
    mesh = trimesh.load_mesh(EXAMPLES / "taco_object.obj", process=False)
    mesh.apply_scale(scale).export(tmp_path / "tool.stl")
    given = geneoh.load(EXAMPLES / "taco_noisy.npz", obj=tmp_path / "tool.stl", unit=unit)
    geneoh.save(given, tmp_path / "a.npz")
    (found,) = geneoh.load(tmp_path / "a.npz").object.meshes
    assert found.verts.equal(given.object.meshes[0].verts)


def test_meshes_are_found_again_after_both_were_moved_together(kept, tmp_path):
    (tmp_path / "here").rename(tmp_path / "there")
    assert geneoh.load(tmp_path / "there/results/a.npz").object.meshes


def test_a_mesh_that_is_gone_is_missed_in_words_and_the_tracks_are_read(kept):
    (kept.parent / "../objects/tool.obj").unlink()
    sequence = geneoh.load(kept)
    assert sequence.object.meshes == ()
    assert "mesh ../objects/tool.obj is not there any more" in sequence.source
    cleaned = geneoh.denoise(sequence, preset="fast")
    assert any("the hand was cleaned by the prior of hand motion alone" in n for n in cleaned.notes)


def test_another_mesh_of_the_same_name_is_not_taken(kept):
    path = kept.parent / "../objects/tool.obj"
    path.write_text(path.read_text().replace("v 0", "v 1", 1).replace("v -0", "v -1", 1))
    sequence = geneoh.load(kept)
    assert sequence.object.meshes == ()
    assert "was changed since then" in sequence.source
    given = geneoh.load(kept, obj=path)
    assert given.object.meshes
    assert "the mesh in --obj is another one than the file was written with" in given.source


def test_the_same_mesh_from_elsewhere_needs_no_note(kept, tmp_path):
    (kept.parent / "../objects/tool.obj").rename(tmp_path / "moved.obj")
    given = geneoh.load(kept, obj=tmp_path / "moved.obj")
    assert "another one than the file was written with" not in given.source


def test_a_mesh_that_cannot_be_read_any_more_is_missed_in_words(kept):
    (kept.parent / "../objects/tool.obj").write_text("nothing")
    assert "cannot be used" in geneoh.load(kept).source


def test_a_changed_mesh_is_not_taken_for_that_of_its_file(kept):
    sequence = geneoh.load(kept)
    (mesh,) = sequence.object.meshes
    scaled = replace(sequence.object, meshes=(replace(mesh, verts=2 * mesh.verts),))
    geneoh.save(replace(sequence, object=scaled), kept)
    assert "was changed since then" in geneoh.load(kept).source


def test_meshes_that_were_made_leave_no_paths_and_are_missed_in_words(kept, caplog):
    sequence = geneoh.load(kept)
    made = tuple(mesh.mirrored() for mesh in sequence.object.meshes)
    geneoh.save(replace(sequence, object=replace(sequence.object, meshes=made)), kept)
    assert "mesh was made in memory, and no file is known that holds it; give it" in caplog.text
    assert "object_files" not in read_archive(kept)
    again = geneoh.load(kept)
    assert again.object.meshes == ()
    assert "made in memory" in again.object.missing
    assert "made in memory" in again.source
    assert geneoh.load(kept, obj=made).object.missing == ""
    with pytest.raises(InputError, match="pass --obj MESH"):
        geneoh.view(kept, kept.with_suffix(".png"))


def test_names_that_are_no_text_are_refused(kept):
    arrays = read_archive(kept) | {"object_files": np.zeros((2, 3))}
    write_archive(kept, arrays)
    with pytest.raises(InputError, match="'object_files' must be a list of text"):
        geneoh.load(kept)


@pytest.fixture
def scene(kept):
    """A GLB file of two meshes."""
    tool = trimesh.load_mesh(EXAMPLES / "taco_object.obj", process=False)
    lid = tool.copy()
    lid.apply_translation([0, 0, 0.02])
    trimesh.Scene([tool, lid]).export(kept.parent / "two.glb")
    return kept.parent / "two.glb"


def test_a_file_of_several_meshes_with_one_pose_is_one_rigid_body_in_words(kept, scene, caplog):
    sequence = geneoh.load(kept, obj=scene)
    assert len(sequence.object.meshes) == 1
    assert "holds 2 separate meshes, taken as one rigid body" in sequence.source
    assert "holds 2 separate meshes, taken as one rigid body" in caplog.text


def test_a_file_of_several_meshes_is_its_parts_where_there_are_as_many_poses(kept, scene):
    fields = read_archive(kept)
    for name in ("object_rotation", "object_translation"):
        fields[name] = fields[name].repeat(2, axis=1)
    np.savez(scene.with_name("parts.npz"), **fields)
    sequence = geneoh.load(scene.with_name("parts.npz"), obj=scene)
    assert len(sequence.object.meshes) == 2
    assert "taken as its parts" in sequence.source
    geneoh.save(sequence, scene.with_name("again.npz"))
    again = geneoh.load(scene.with_name("again.npz")).object.meshes
    assert [mesh.sha256 for mesh in again] == [mesh.sha256 for mesh in sequence.object.meshes]
    alone = replace(sequence, object=replace(sequence.object, meshes=()))
    whole = replace(sequence, object=replace(sequence.object, meshes=load_mesh(scene)))
    for taken in (as_sequence(alone, scene), as_sequence(whole, None)):
        assert taken.object == sequence.object


def test_the_meshes_of_the_parts_in_another_order_are_refused(tmp_path):
    lid = tmp_path / "lid.obj"
    trimesh.creation.box((0.1, 0.1, 0.01)).export(lid)
    one = geneoh.load(EXAMPLES / "taco_noisy.npz", obj=EXAMPLES / "taco_object.obj")
    motion = one.object.rotation.expand(-1, 2, -1, -1), one.object.translation.expand(-1, 2, -1)
    meshes = (*one.object.meshes, load_mesh(lid))
    track = replace(
        one.object, meshes=meshes, rotation=motion[0], translation=motion[1], valid=None
    )
    geneoh.save(replace(one, object=track), tmp_path / "a.npz")
    files = [EXAMPLES / "taco_object.obj", lid]
    assert len(geneoh.load(tmp_path / "a.npz", obj=files).object.meshes) == 2
    with pytest.raises(InputError, match=r"a\.npz: .*got those of the parts 2, 1; exchange them"):
        geneoh.load(tmp_path / "a.npz", obj=files[::-1])


def test_meshes_are_found_again_behind_a_link(kept, tmp_path):
    sequence = geneoh.load(kept)
    (tmp_path / "far" / "away").mkdir(parents=True)
    (tmp_path / "link").symlink_to("far/away")
    (tmp_path / "link.npz").symlink_to("far/away/linked.npz")
    for written, read in (
        ("link/clip.npz", "far/away/clip.npz"),
        ("link.npz", "far/away/linked.npz"),
    ):
        geneoh.save(sequence, tmp_path / written)
        assert geneoh.load(tmp_path / written).object.meshes
        assert geneoh.load(tmp_path / read).object.meshes
