import json
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
import torch
import trimesh
from draws import seeded
from made_grasps import ANY_GRASP
from safetensors.torch import load_file, save_file

from geneoh.errors import InputError
from geneoh.geometry.distance import SurfaceDistance
from geneoh.geometry.mesh_files import load_mesh
from geneoh.geometry.mirror import mirror_points
from geneoh.geometry.openings import edges_of
from geneoh.geometry.thin_walls import goes_through
from geneoh.hand.library import load_hand
from geneoh.synthesis.attempts import draw_attempts, tried_grasps
from geneoh.synthesis.data_config import SynthesisConfig
from geneoh.synthesis.replay import replay_shard
from geneoh.synthesis.shapes import scans as module
from geneoh.synthesis.shapes.objects import draw_objects
from geneoh.synthesis.shapes.scans import (
    FILE,
    MARGIN,
    build_scans,
    find_scans,
    read_folder,
    read_scans,
    write_scans,
)
from geneoh.synthesis.shapes.surface import mesh_of_solid
from geneoh.synthesis.shards import read_shards, shard_record, write_shards

TINY = SynthesisConfig(count=16, frames=8, points=32, shard=8, grasps=ANY_GRASP)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A ball, a wedge that is no mirror image of itself and a carton, off their origins."""
    folder = tmp_path_factory.mktemp("objects")
    ball = trimesh.creation.icosphere(3, 0.03)
    wedge = trimesh.convex.convex_hull(
        [[0, 0, 0], [0.05, 0, 0], [0.08, 0.03, 0], [0, 0.03, 0], [0, 0, 0.04], [0.02, 0.03, 0.02]]
    )
    carton = trimesh.creation.box((0.3, 0.3, 0.02))
    for name, shape in (("ball.ply", ball), ("wedge.obj", wedge), ("carton.stl", carton)):
        shape.apply_translation((0.01, 0.2, -0.03))
        shape.export(folder / name)
    (folder / "held_out.txt").write_text("wedge\n")
    (folder / "LICENSE").write_text("Made for a test.")
    return folder


@pytest.fixture(scope="module")
def scans(folder):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "NODES", 60_000)
        return build_scans(read_folder(folder))


def test_meshes_are_read_in_order_with_what_is_held_out_and_their_licence(scans):
    assert scans.names == ("ball.ply", "carton.stl", "wedge.obj")
    assert scans.held_out == ("wedge.obj",)
    assert scans.notice == "Made for a test."
    for mesh in scans.meshes:
        torch.testing.assert_close(mesh.verts.amin(0), -mesh.verts.amax(0), atol=1e-6, rtol=0)


@pytest.mark.parametrize("number", range(3))
def test_near_the_surface_the_grid_is_the_exact_distance(scans, number):
    field = SurfaceDistance(scans.meshes[number])
    points = scans.points[number] + 0.003 * torch.randn(4096, 3, generator=seeded())
    want = field.query(points)
    got, normal = scans.lookup(torch.tensor([number]), points[None])
    error = (got[0] - want.distance).abs()
    assert float(error.mean()) < 1e-4
    assert float(error.max()) < 2e-3, "at edges, which a grid rounds"
    agree = (normal[0] * want.normal).sum(-1)
    assert float((agree > 0.95).float().mean()) > 0.9


def test_off_the_grid_the_distance_of_a_ball_is_that_to_its_centre(scans):
    points = 0.3 * torch.randn(1, 500, 3, generator=seeded())
    points = points[:, (points[0].norm(dim=-1) > 0.03 * 1.8 + MARGIN)]
    got, normal = scans.lookup(torch.tensor([0]), points)
    torch.testing.assert_close(got, points.norm(dim=-1) - 0.03, atol=0.02, rtol=0)
    agree = (normal * torch.nn.functional.normalize(points, dim=-1)).sum(-1)
    assert float(agree.min()) > 0.9


def test_the_slope_of_the_distance_is_its_normal(scans):
    points = (0.03 * torch.randn(2, 50, 3, generator=seeded())).requires_grad_(True)
    which = torch.tensor([0, 2])
    scans.distance(which, points).sum().backward()
    assert points.grad is not None
    torch.testing.assert_close(points.grad, scans.lookup(which, points.detach())[1])


def test_a_mixed_batch_is_each_of_its_objects(scans):
    names = ["box", "wedge.obj", "mug", "ball.ply"]
    mixed = draw_objects(names, generator=seeded(), scans=scans)
    assert mixed.scan.clamp(min=-1).tolist() == [-1, 2, -1, 0]
    points = 0.05 * torch.randn(4, 60, 3, generator=seeded(1))
    together, normals = mixed.distance_and_normal(points)
    for i in range(4):
        alone, normal = mixed.take(slice(i, i + 1), "B").distance_and_normal(points[i : i + 1])
        torch.testing.assert_close(together[i], alone[0])
        torch.testing.assert_close(normals[i], normal[0])


def test_surface_points_of_a_mixed_batch_lie_on_it_and_look_outward(scans):
    mixed = draw_objects(["box", "wedge.obj", "ball.ply"], generator=seeded(), scans=scans)
    mixed = replace(mixed, scans=scans)
    for batch in (mixed, mixed.mirrored()):
        points, normals = batch.surface_points(200, generator=seeded(1))
        assert float(batch.signed_distance(points).abs().max()) < 1e-3
        outside = batch.signed_distance(points + 0.002 * normals)
        assert float((outside > 0.0015).float().mean()) > 0.9
    points, _ = mixed.surface_points(5000, generator=seeded(1))
    assert points.shape == (3, 5000, 3), "more than are kept"


def test_a_mirrored_scan_is_the_mirror_image(scans):
    wedge = draw_objects(["wedge.obj"], generator=seeded(), scans=scans)
    points = 0.05 * torch.randn(1, 200, 3, generator=seeded(1))
    mirrored = wedge.mirrored()
    torch.testing.assert_close(
        mirrored.signed_distance(mirror_points(points)), wedge.signed_distance(points)
    )
    assert not torch.allclose(mirrored.signed_distance(points), wedge.signed_distance(points))
    torch.testing.assert_close(mirrored.extents, wedge.extents)
    for solid in (wedge, mirrored):
        mesh = mesh_of_solid(solid)
        assert float(solid.signed_distance(mesh.verts[None]).abs().max()) < 1.5e-3
        volume = torch.linalg.det(mesh.corners()).sum()
        assert float(volume) > 0, "faces look outward"
        torch.testing.assert_close(mesh.extent() / 2, solid.extents[0], atol=1e-5, rtol=0)


def test_hands_start_where_an_object_is_thin_enough(scans):
    """A carton is 30 cm wide from rim to rim and 2 cm thick from face to face."""
    carton = draw_objects(["carton.stl"] * 400, generator=seeded(), scans=scans)
    points, normals = carton.surface_points(1, generator=seeded(1), to_grasp=True)
    assert float(carton.signed_distance(points).abs().max()) < 2e-3
    rims = normals[:, 0, 2].abs() < 0.5
    thin = scans.grasped[1] == 1
    assert float(thin.float().mean()) == pytest.approx(0.88, abs=0.02), "the rims are 12%"
    assert float(rims.float().mean()) < 0.06, "0.15 of that"


@pytest.mark.slow
def test_no_kept_hand_goes_through_a_thin_plate(tmp_path):
    trimesh.creation.box((0.2, 0.15, 0.001)).export(tmp_path / "plate.ply")
    plate = build_scans(read_folder(tmp_path))
    config = SynthesisConfig(scanned=1.0)
    names = ["mug", "plate.ply"]
    tried = draw_attempts(config, names, 40, generator=seeded(1), scans=plate)
    assert set(tried.families) == {"plate.ply"}
    toward = torch.zeros(len(tried.families), 3)
    grasps = tried_grasps(tried, config, toward, seeded(2))
    assert grasps.kept.any()
    held = tried.take(grasps.kept, "B")
    posed = held.hands.posed(grasps.pose[grasps.kept], grasps.wrist[grasps.kept])
    local = (posed.verts - held.solids.center[:, :1]) @ held.solids.rotation[:, 0]
    found = SurfaceDistance(plate.meshes[0]).query(local / held.solids.size[:, :1])
    through = goes_through(local, found.distance, found.normal, edges_of(load_hand("right").faces))
    assert not through.any()


def test_kept_scans_are_read_as_they_were(scans, tmp_path):
    write_scans(tmp_path / FILE, scans)
    again = read_scans(tmp_path / FILE)
    assert (again.names, again.held_out, again.notice) == (
        scans.names,
        scans.held_out,
        scans.notice,
    )
    assert torch.equal(again.values, scans.values)
    assert again.fingerprint == scans.fingerprint
    write_scans(tmp_path / "second.safetensors", scans)
    assert (tmp_path / FILE).read_bytes() == (tmp_path / "second.safetensors").read_bytes()


@pytest.fixture(scope="module")
def data(tmp_path_factory, scans):
    """Shards of grasps that hardly descend, half of them on scanned objects."""
    data = tmp_path_factory.mktemp("data")
    write_scans(data / FILE, scans)
    write_shards(data, TINY, seed=0, scans=scans)
    return data


def test_held_out_scans_are_in_validation_shards_only(data, scans):
    train, val = (read_shards(data, split).take(slice(None)) for split in ("train", "val"))
    assert set(train.scan.tolist()) == {-1, 0, 1}
    assert set(val.scan.tolist()) == {-1, 2}
    assert float((train.scan >= 0).float().mean()) == pytest.approx(0.5, abs=0.3)
    shown = train.points[train.scan == 0].norm(dim=-1)
    assert 0.9 * 0.029 < float(shown.min()) < float(shown.max()) < 1.1 * 0.031, "the ball's surface"


def test_a_shard_of_scans_is_replayed_with_them(data):
    found = replay_shard(data / "train_00001.safetensors")
    of_scans = found.clips.scan >= 0
    names = [name for name, scan in zip(found.made_from.families, of_scans, strict=True) if scan]
    assert names
    assert set(names) <= {"ball.ply", "carton.stl"}
    off = found.made_from.solids.signed_distance(found.clips.points)
    assert float(off.abs().max()) < 1.5e-3
    every = torch.arange(8).expand(len(of_scans), 8)
    world = found.clips.points[:, None] @ found.clips.rotation[:, :, 0].mT
    local = found.in_object(world + found.clips.translation[:, :, :1])
    rigid = ~found.made_from.solids.jointed
    assert float(found.distance(local, every)[rigid].abs().max()) < 1.5e-3


def test_shards_of_other_objects_or_none_are_refused(data, folder, scans, tmp_path):
    for other in (None, replace(scans, held_out=())):
        with pytest.raises(InputError, match="was made with objects"):
            write_shards(data, TINY, seed=0, scans=other)
    (tmp_path / "ball.ply").write_bytes((folder / "ball.ply").read_bytes())
    with pytest.raises(InputError, match="was made of other objects than"):
        find_scans(data, tmp_path)
    assert find_scans(data, folder).names == scans.names


def test_a_lost_file_of_objects_is_told_with_the_cure(data, tmp_path, scans):
    path = tmp_path / "train_00001.safetensors"
    path.write_bytes((data / path.name).read_bytes())
    with pytest.raises(InputError, match=r"expected the scanned objects .*again"):
        replay_shard(path)
    write_scans(tmp_path / FILE, replace(scans, held_out=()))
    with pytest.raises(InputError, match="holds other objects than train_00001"):
        replay_shard(path)


def test_shards_from_before_there_were_scans_are_read(data, tmp_path):
    path = data / "train_00001.safetensors"
    tensors = load_file(path)
    del tensors["scan"]
    record = {"config": {"shard": 8}, "seed": 0}
    save_file(tensors, tmp_path / path.name, metadata={"record": json.dumps(record)})
    assert shard_record(tmp_path / path.name).objects == ""
    assert read_shards(tmp_path, "train").take(slice(None)).scan.tolist() == [-1] * 8


@pytest.mark.parametrize(
    ("files", "words"),
    [
        ({}, "expected mesh files"),
        ({"a.obj": "v 0 0 0\n"}, "a.obj"),
        ({"held_out.txt": "hammer"}, "'hammer' is no mesh of this folder"),
        ({"a.obj": "v 0 0 0\nv 90 0 0\nv 0 90 0\nv 0 0 90\nf 1 3 2\nf 1 2 4\n"}, "--unit mm"),
        ({"a.obj": "v 0 0 0\nv .1 0 0\nv .2 0 0\nv 0 0 0\nf 1 3 2\nf 1 2 4\n"}, "a.obj"),
    ],
)
def test_folders_that_cannot_be_used_are_refused_with_the_reason(files, words, folder, tmp_path):
    if "held_out.txt" in files:
        (tmp_path / "ball.ply").write_bytes((folder / "ball.ply").read_bytes())
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    with pytest.raises(InputError, match=words):
        build_scans(read_folder(tmp_path))


def test_names_with_blanks_and_of_several_endings_can_be_held_out(folder, tmp_path):
    for name in ("red mug.ply", "red mug 2.ply", "pan.ply", "pan.obj"):
        kind = "ball.ply" if name.endswith("ply") else "wedge.obj"
        shutil.copy(folder / kind, tmp_path / name)
    (tmp_path / "held_out.txt").write_text("red mug\n\n  pan \n")
    assert set(read_folder(tmp_path).held_out) == {"red mug.ply", "pan.ply", "pan.obj"}


def test_words_beside_the_meshes_may_be_of_any_program_and_lie_in_folders(folder, tmp_path):
    shutil.copy(folder / "ball.ply", tmp_path)
    (tmp_path / "LICENSES").mkdir()
    (tmp_path / "README.txt").write_bytes("Größe".encode("latin-1"))
    (tmp_path / "held_out.txt").write_text("ball\n", encoding="utf-8-sig")
    found = read_folder(tmp_path)
    assert (found.held_out, found.notice) == (("ball.ply",), "Gr\ufffd\ufffde")


def test_meshes_in_millimetres_are_read_with_their_unit(folder, tmp_path):
    mesh = trimesh.load_mesh(folder / "ball.ply")
    mesh.apply_scale(1000).export(tmp_path / "ball.ply")
    (half,) = (m.extent() for m in read_folder(tmp_path, "mm").meshes)
    torch.testing.assert_close(half, load_mesh(folder / "ball.ply").extent())


def test_the_shipped_objects_hold_out_twenty():
    objects = Path(__file__).parents[3] / "examples" / "objects"
    found = read_folder(objects)
    assert len(found.names) == 109
    assert len(set(found.held_out)) == 20
    assert "CC BY 4.0" in found.notice
    assert "Copyright (c) 2020 OpenAI" in found.notice
    assert sum(path.stat().st_size for path in objects.iterdir()) < 2_100_000
