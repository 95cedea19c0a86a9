import json
import struct
import sys

import pytest
import torch
import trimesh
from watertight import is_watertight, volume

from geneoh.errors import InputError
from geneoh.geometry.mesh_files import by_trimesh, from_trimesh, load_mesh, plain_obj


@pytest.fixture
def ball():
    return trimesh.creation.icosphere(2, 0.05)


@pytest.mark.parametrize("suffix", ["obj", "ply", "stl", "off", "glb"])
def test_every_format_gives_the_same_surface(ball, suffix, tmp_path):
    ball.export(tmp_path / f"ball.{suffix}")
    mesh = load_mesh(tmp_path / f"ball.{suffix}")
    torch.testing.assert_close(mesh.corners(), from_trimesh(ball).corners(), atol=1e-6, rtol=0)
    assert is_watertight(mesh)


@pytest.mark.parametrize("suffix", ["obj", "ply", "off", "glb"])
def test_vertex_order_is_kept(ball, suffix, tmp_path):
    ball.export(tmp_path / f"ball.{suffix}")
    mesh = load_mesh(tmp_path / f"ball.{suffix}")
    torch.testing.assert_close(mesh.verts, from_trimesh(ball).verts, atol=1e-6, rtol=0)


def test_scene_becomes_one_mesh_with_its_nodes_in_place(ball, tmp_path):
    scene = trimesh.Scene(ball)
    scene.add_geometry(ball, transform=trimesh.transformations.translation_matrix([1.0, 0, 0]))
    scene.export(tmp_path / "two.glb")
    mesh = load_mesh(tmp_path / "two.glb")
    assert len(mesh.faces) == 2 * len(ball.faces)
    torch.testing.assert_close(mesh.extent(), torch.tensor([1.1, 0.1, 0.1]), atol=1e-4, rtol=0)


def test_scene_of_several_meshes_keeps_each_in_the_order_of_the_file(ball, tmp_path):
    scene = trimesh.Scene(ball)
    scene.add_geometry(trimesh.creation.box((0.1, 0.1, 0.1)))
    scene.add_geometry(ball, transform=trimesh.transformations.translation_matrix([1.0, 0, 0]))
    scene.export(tmp_path / "three.glb")
    mesh = load_mesh(tmp_path / "three.glb")
    assert [len(part.faces) for part in mesh.parts] == [320, 12, 320]
    torch.testing.assert_close(mesh.parts[2].verts[:, 0].mean(), torch.tensor(1.0))
    assert sum(len(part.verts) for part in mesh.parts) == len(mesh.verts)
    small = load_mesh(tmp_path / "three.glb", "mm").parts[2]
    torch.testing.assert_close(small.verts, mesh.parts[2].verts / 1000)


def test_one_mesh_of_two_materials_is_no_scene_of_several(ball, tmp_path):
    path = tmp_path / "two.glb"
    trimesh.Scene([ball, ball.copy()]).export(path)
    assert len(load_mesh(path).parts) == 2
    merge_glb_meshes(path)
    assert len(load_mesh(path).faces) == 2 * len(ball.faces)
    assert load_mesh(path).parts == ()


def merge_glb_meshes(path):
    """Make all meshes of a GLB file the primitives of its first, as tools write materials."""
    content = path.read_bytes()
    length = int.from_bytes(content[12:16], "little")
    tree, rest = json.loads(content[20 : 20 + length]), content[20 + length :]
    tree["meshes"] = [
        {"primitives": [one for mesh in tree["meshes"] for one in mesh["primitives"]]}
    ]
    tree["nodes"], tree["scenes"], tree["scene"] = [{"mesh": 0}], [{"nodes": [0]}], 0
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    sizes = (20 + len(text) + len(rest)).to_bytes(4, "little") + len(text).to_bytes(4, "little")
    path.write_bytes(content[:8] + sizes + b"JSON" + text + rest)


def test_vertices_without_a_face_are_left_out_unless_they_are_counted(tmp_path):
    (tmp_path / "far.off").write_text(
        "OFF\n5 2 0\n9e4 0 0\n0 0 0\n1 0 0\n0 1 0\n1e5 0 0\n3 1 2 3\n3 1 4 1\n"
    )
    mesh = load_mesh(tmp_path / "far.off")
    torch.testing.assert_close(mesh.extent(), torch.tensor([1.0, 1.0, 0.0]))
    assert mesh.faces.tolist() == [[0, 1, 2]]
    whole = load_mesh(tmp_path / "far.off", tidy=False)
    assert len(whole.verts) == 5
    assert whole.sha256 == mesh.sha256


VERTS = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"


TRIANGLES = b"v 0 0 0\nv 1e-3 0.1 -2.5E2\nv 0.12345678901 1 0\nv 7 7 7\nf 1 2 3\nf 2 3 4"


@pytest.mark.parametrize(
    "content",
    [
        TRIANGLES,
        b"# \xff by a tool\n\n" + TRIANGLES.replace(b"\n", b" \r\n") + b"\nf 1 1 2\n",
        TRIANGLES.replace(b"v 7 7 7", b"v 0.12345678901 1 0"),
    ],
)
def test_plain_obj_is_read_as_trimesh_reads_it(content, tmp_path):
    path = tmp_path / "plain.obj"
    path.write_bytes(content)
    read, twin = plain_obj(path), by_trimesh(path)
    assert read is not None
    assert torch.equal(read.verts, twin.verts)
    assert torch.equal(read.faces, twin.faces)
    assert read.source == twin.source == path


def test_an_obj_may_have_tabs_between_its_numbers(tmp_path):
    (tmp_path / "tabs.obj").write_bytes(TRIANGLES.replace(b" ", b"\t"))
    (tmp_path / "plain.obj").write_bytes(TRIANGLES)
    tabs, plain = (load_mesh(tmp_path / name) for name in ("tabs.obj", "plain.obj"))
    assert torch.equal(tabs.verts, plain.verts)
    assert torch.equal(tabs.faces, plain.faces)


@pytest.mark.parametrize(
    "content",
    [
        TRIANGLES + b" 1",  # a face of four corners
        TRIANGLES + b"\nv 3 3 3",  # a vertex without a face
        TRIANGLES + b"\nf 1 2 5",
        TRIANGLES + b"\nf -1 1 2",
        TRIANGLES + b"\nf 1/1 2/2 3/3",
        TRIANGLES + b"\n f 1 2 3",
        TRIANGLES + b"\nvn 0 0 1",
        TRIANGLES.replace(b"7 7 7", b"7 7 seven"),
        TRIANGLES.replace(b"7 7 7", b"7 7 7 1 0 0"),
        TRIANGLES.replace(b"\n", b"\r"),
        b"# nothing",
    ],
)
def test_all_other_obj_files_are_left_to_trimesh(content, tmp_path):
    (tmp_path / "other.obj").write_bytes(content)
    assert plain_obj(tmp_path / "other.obj") is None


@pytest.mark.parametrize("packed", ["KHR_draco_mesh_compression", "KHR_mesh_quantization"])
def test_a_glb_whose_points_are_packed_is_refused(ball, packed, tmp_path):
    path = tmp_path / "a.glb"
    ball.export(path)
    data = path.read_bytes()
    size = int.from_bytes(data[12:16], "little")
    document = json.loads(data[20 : 20 + size])
    document["extensionsRequired"] = [packed]
    if packed == "KHR_mesh_quantization":
        (primitive,) = document["meshes"][0]["primitives"]
        document["accessors"][primitive["attributes"]["POSITION"]]["normalized"] = True
    text = json.dumps(document).encode()
    head = data[:12] + len(text).to_bytes(4, "little") + data[16:20]
    path.write_bytes(head + text + data[20 + size :])
    with pytest.raises(InputError, match=f"packed by {packed}.*save it again"):
        load_mesh(path)


FOREIGN = {  # a name of the program in Latin-1, in Shift-JIS ending in a backslash
    "obj": b"g W\xfcrfel\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\ng \x95\x5c\nf 1 2 3\nf 1 2 4\n",
    "off": b"OFF\n# W\xfcrfel\n4 2 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 1 2\n3 0 1 3\n",
    "ply": b"ply\nformat ascii 1.0\ncomment W\xfcrfel\nelement vertex 4\nproperty float x\n"
    b"property float y\nproperty float z\nelement face 2\nproperty list uchar int vertex_indices\n"
    b"end_header\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 1 2\n3 0 1 3\n",
    "stl": b"solid W\xfcrfel\n"
    + b"".join(
        b"facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n"
        b"vertex %s\nendloop\nendfacet\n" % tip
        for tip in (b"0 1 0", b"0 0 1")
    )
    + b"endsolid W\xfcrfel\n",
}


@pytest.mark.parametrize("kind", FOREIGN)
def test_names_in_another_encoding_are_no_obstacle(kind, tmp_path, monkeypatch):
    for package in ("chardet", "charset_normalizer"):  # with which trimesh guesses, and no user has
        monkeypatch.setitem(sys.modules, package, None)
    (tmp_path / f"cube.{kind}").write_bytes(FOREIGN[kind])
    mesh = load_mesh(tmp_path / f"cube.{kind}")
    corners = {tuple(corner) for face in mesh.corners().tolist() for corner in face}
    assert len(mesh.faces) == 2
    assert corners == {(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)}


def test_bytes_of_a_binary_stl_are_left_as_they_are(tmp_path):
    box = trimesh.creation.box((0.1, 0.1, 0.1))
    data = box.export(file_type="stl")
    (tmp_path / "box.stl").write_bytes(b"W\xfcrfel".ljust(80) + data[80:])
    assert torch.equal(load_mesh(tmp_path / "box.stl").corners(), from_trimesh(box).corners())


def test_faces_may_count_their_points_backward(tmp_path):
    """As programs write them that put each group's points before its faces."""
    groups = [
        f"g {z}\nv 0 0 {z}\nv 1 0 {z}\nv 1 1 {z}\nvt 0 0\nusemtl a\nf -3/-1 -2/-1 \\\r\n -1/-1\n"
        for z in (0, 1)
    ]
    (tmp_path / "a.obj").write_text("mtllib a.mtl\n" + "".join(groups))
    mesh = load_mesh(tmp_path / "a.obj")
    wanted = [[[0, 0, z], [1, 0, z], [1, 1, z]] for z in (0.0, 1.0)]
    assert mesh.corners().tolist() == wanted
    assert mesh.source == tmp_path / "a.obj"


@pytest.mark.parametrize("first", range(6))
@pytest.mark.parametrize("suffix", ["obj", "ply"])
def test_faces_with_a_notch_are_cut_within_their_outline(first, suffix, tmp_path):
    """As of an angle iron, whose gap had a lid where the first corner was across from it."""
    outline = [(0, 0), (0.1, 0), (0.1, 0.03), (0.03, 0.03), (0.03, 0.1), (0, 0.1)]
    points = [(x, y, z) for z in (0, 0.05) for x, y in outline]
    around = [(first + corner) % 6 for corner in range(6)]
    faces = [around[::-1], [6 + corner for corner in around]]
    faces += [[at, (at + 1) % 6, (at + 1) % 6 + 6, at + 6] for at in range(6)]
    path = tmp_path / f"angle.{suffix}"
    if suffix == "obj":
        lines = [f"v {x} {y} {z} 0.5 0.5 0.5" for x, y, z in points]
        lines += ["f " + " ".join(f"{corner + 1}//1" for corner in face) for face in faces]
    else:
        head = "ply\nformat ascii 1.0\nelement vertex 12\n"
        head += "".join(f"property float {axis}\n" for axis in "xyz")
        head += "element face 8\nproperty list uchar int vertex_indices\nend_header"
        lines = [head, *(f"{x} {y} {z}" for x, y, z in points)]
        lines += [f"{len(face)} {' '.join(map(str, face))}" for face in faces]
    path.write_text("\n".join(lines) + "\n")
    mesh = load_mesh(path)
    assert float(mesh.face_vectors().norm(dim=-1).sum() / 2) == pytest.approx(0.0302)
    assert volume(mesh) == pytest.approx(0.0051 * 0.05)
    assert is_watertight(mesh)


@pytest.mark.parametrize("bend", [0, 1e-6, 0.02])
def test_faces_without_a_notch_are_cut_as_ever(bend, tmp_path):
    """Also where a corner lies on a side but for rounding, and where a face is bent."""
    corners = f"v 0 0 0\nv 0.1 0 {bend}\nv 0.1 0.1 0\nv 0.0500001 0.049999 0\nv 0 0.1 {-bend}\n"
    (tmp_path / "flat.obj").write_text(corners + "f 1 2 3 4\nf 1 4 3 5\n")
    mesh = load_mesh(tmp_path / "flat.obj")
    assert mesh.faces.tolist() == [[0, 1, 2], [0, 3, 2], [2, 3, 0], [2, 4, 0]]


@pytest.mark.parametrize(
    "content",
    [
        b"\xef\xbb\xbf" + TRIANGLES,
        TRIANGLES.replace(b"\n", b"\n\t "),
        TRIANGLES.replace(b"\n", b" # 0 -1\n"),
        TRIANGLES.replace(b"\n", b"\r"),
    ],
)
def test_an_obj_may_be_written_in_an_unusual_way(content, tmp_path):
    (tmp_path / "other.obj").write_bytes(content)
    (tmp_path / "plain.obj").write_bytes(TRIANGLES)
    other, plain = (load_mesh(tmp_path / name) for name in ("other.obj", "plain.obj"))
    assert torch.equal(other.corners(), plain.corners())


@pytest.mark.parametrize(("suffix", "encoding"), [("off", {}), ("ply", {"encoding": "ascii"})])
@pytest.mark.parametrize("lines", [1, 150])
def test_a_text_of_fewer_faces_than_it_says_is_refused(ball, suffix, encoding, lines, tmp_path):
    """As of a copy that broke off: a part of the object was missing, and nothing said so."""
    path = tmp_path / f"ball.{suffix}"
    ball.export(path, **encoding)
    load_mesh(path)
    kept = path.read_text().splitlines()[:-lines]
    path.write_text("\n".join(kept))
    with pytest.raises(InputError, match=r"the file breaks off, .* copy or export it again"):
        load_mesh(path)


@pytest.mark.parametrize(("usual", "other"), [(b"\n", b"\r\n"), (b" ", b"\t")])
def test_polygons_may_go_on_in_another_line_of_windows_or_have_tabs(usual, other, tmp_path):
    corners = b"v 0 0 0\nv 0.1 0 0\nv 0.1 0.1 0\nv 0 0.1 0\nv 0.1 0.1 0.1\n"
    text = corners + b"f 1 2 \\\n 3 4\nf 1 2 3 5\n"
    (tmp_path / "other.obj").write_bytes(text.replace(usual, other))
    assert len(load_mesh(tmp_path / "other.obj").faces) == 4


@pytest.mark.parametrize("face", ["f 0 1 2", "f 0/1 1/2 2/3", "f 1 2 0"])
def test_an_obj_whose_faces_count_from_0_is_refused(face, tmp_path):
    (tmp_path / "zero.obj").write_text(VERTS + face + "\nf 1 2 3\n")
    with pytest.raises(InputError, match=r"got a point 0; add 1 to each$"):
        load_mesh(tmp_path / "zero.obj")


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("text.obj", "hello", "got 0 vertices and no face"),
        ("lost.obj", VERTS + "f 1 2 7\n", "cannot be read as OBJ"),
        ("empty.stl", "", "no face"),
        ("cut.ply", "ply\n", "cannot be read as PLY"),
        ("cut.glb", "12", "cannot be read as GLB"),
        (
            "far.off",
            "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 7\n",
            "cannot be read as OFF",
        ),
        ("nan.obj", VERTS.replace("1", "nan", 1) + "f 1 2 3\n", "got NaN or infinity in 1 of 3"),
        ("flat.obj", VERTS + "f 1 2 2\n", "got no area in all of its faces, 1"),
        ("folded.obj", "v 0.1 0.7 0.3\nv 0.37 0.1 0.9\nf 1 2 2\nf 2 1 2\nf 2 2 1\n", "got no area"),
        ("cloud.obj", VERTS, "got 3 points and no face"),
        ("huge.obj", VERTS.replace("1", "3e38") + "f 1 2 3\n", "in metres, got 3e+38"),
        ("model.fbx", "", "expected a mesh file"),
    ],
)
def test_useless_file_is_refused_in_one_sentence_that_names_it(name, content, said, tmp_path):
    (tmp_path / name).write_text(content)
    with pytest.raises(InputError) as caught:
        load_mesh(tmp_path / name)
    message = str(caught.value)
    assert message.startswith(str(tmp_path / name))
    assert said in message
    assert "\n" not in message


PRISM = [[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0], [0, 0, 0.1], [0.1, 0, 0.1], [0, 0.1, 0.1]]
PRISM_FACES = [[0, 2, 1], [3, 4, 5], [0, 1, 4, 3], [1, 2, 5, 4], [2, 0, 3, 5]]


def binary_ply(order):
    """A prism of three quads and two triangles, with properties and elements of other programs."""
    kind = {"<": "little", ">": "big"}[order]
    axes = "".join(f"property float {name}\n" for name in ("x", "y", "z", "nx"))
    head = (
        f"ply\nformat binary_{kind}_endian 1.0\ncomment made by hand\nelement vertex 6\n{axes}"
        "property uchar red\nelement face 5\nproperty uchar flags\n"
        "property list uint8 int32 vertex_indices\nelement edge 1\nproperty int vertex1\n"
        "end_header\n"
    )
    data = b"".join(struct.pack(f"{order}4fB", *point, 1.0, 255) for point in PRISM)
    for face in PRISM_FACES:
        data += struct.pack(f"{order}BB{len(face)}i", 7, len(face), *face)
    return head.encode() + data + struct.pack(f"{order}i", 0)


@pytest.mark.parametrize("order", ["<", ">"])
def test_faces_of_a_binary_ply_may_have_as_many_corners_as_they_like(order, tmp_path):
    """trimesh reads those of one length alone, and called the others damaged."""
    path = tmp_path / "prism.ply"
    path.write_bytes(binary_ply(order))
    mesh = load_mesh(path)
    torch.testing.assert_close(mesh.verts, torch.tensor(PRISM))
    assert len(mesh.faces) == 8
    assert is_watertight(mesh)
    assert volume(mesh) == pytest.approx(0.0005)
    path.write_bytes(binary_ply(order)[:-30])
    with pytest.raises(InputError, match="cannot be read as PLY"):
        load_mesh(path)


def test_a_pointer_of_git_lfs_is_no_mesh_without_faces(tmp_path):
    (tmp_path / "cup.obj").write_text("version https://git-lfs.github.com/spec/v1\n")
    with pytest.raises(InputError, match="git lfs pull"):
        load_mesh(tmp_path / "cup.obj")


def test_missing_file_is_refused(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        load_mesh(tmp_path / "none.obj")


@pytest.mark.parametrize(("unit", "scale"), [("mm", 1000), ("cm", 100)])
def test_a_mesh_in_another_unit_is_read_in_metres(ball, unit, scale, tmp_path):
    ball.export(tmp_path / "metres.obj")
    ball.apply_scale(scale).export(tmp_path / "ball.obj")
    metres, read = load_mesh(tmp_path / "metres.obj"), load_mesh(tmp_path / "ball.obj", unit)
    torch.testing.assert_close(read.verts, metres.verts, rtol=0, atol=1e-6)
    assert read.source == tmp_path / "ball.obj"


def test_what_a_reader_says_of_a_damaged_file_is_cut_to_one_sentence(tmp_path):
    path = tmp_path / "long.ply"
    path.write_text(f"ply\nformat ascii 1.0\nelement vertex {'x' * 2000}\nend_header\n")
    with pytest.raises(InputError, match="open it in a mesh editor and save it again") as told:
        load_mesh(path)
    assert len(str(told.value)) < 400 + len(str(path))
