from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
import torch
import trimesh
from scipy.spatial import cKDTree
from smplx.body_models import MANO
from smplx.utils import Struct
from smplx.vertex_ids import vertex_ids

from geneoh.hand.embedded import ASSET, read_arrays
from geneoh.hand.library import load_hand
from geneoh.hand.skeleton import FINGERS, PARENTS
from tools.hand_builder.anatomy import CHAINS, MEASURED_OFFSETS, skeleton
from tools.hand_builder.shape import BONE_PARENTS, shape_directions

RECORDING = Path(__file__).parents[2] / "examples" / "taco_clean.npz"
SIDES = ("right", "left")


def draw(*shape, seed=0, scale=1.0):
    return scale * torch.randn(*shape, generator=torch.Generator().manual_seed(seed))


def as_smplx(model):
    """smplx's own hand on our arrays."""
    fields = {
        "v_template": model.template,
        "shapedirs": model.shape_dirs,
        "posedirs": model.pose_dirs,
        "J_regressor": model.joint_regressor,
        "weights": model.skin_weights,
        "f": model.faces,
        "hands_mean": model.pose_mean[1:].flatten(),
    }
    arrays = {name: tensor.numpy() for name, tensor in fields.items()}
    arrays |= {name: read_arrays()[name] for name in ("kintree_table", "hands_components")}
    return MANO(
        "",
        data_struct=Struct(**arrays),
        is_rhand=model.side == "right",
        use_pca=False,
        flat_hand_mean=True,
    )


@pytest.mark.parametrize("side", SIDES)
def test_smplx_poses_the_embedded_hand_as_we_do(side):
    model = load_hand(side)
    betas, pose, transl = draw(6, 10), draw(6, 16, 3, seed=1, scale=0.6), draw(6, 3, seed=2)
    theirs = as_smplx(model)(
        betas=betas, global_orient=pose[:, 0], hand_pose=pose[:, 1:].flatten(1), transl=transl
    )
    verts = model.template + torch.einsum("vcs,bs->bvc", model.shape_dirs, betas)
    root = torch.einsum("v,bvc->bc", model.joint_regressor[0], verts)
    ours = model.shaped(betas).posed(pose, transl + root)
    assert (ours.verts - theirs.vertices).abs().max() < 1e-5
    openpose = [0, 5, 6, 7, 9, 10, 11, 17, 18, 19, 13, 14, 15, 1, 2, 3]
    assert (ours.joints[:, openpose] - theirs.joints).abs().max() < 1e-5


def test_smplx_finds_our_fingertips_by_its_own_vertex_numbers():
    model = load_hand("right")
    named = tuple(vertex_ids["mano"][finger] for finger in FINGERS)
    assert model.tip_verts == named
    # Palm and fingers lie towards -x: nothing of a finger is further out than its tip.
    for finger, tip in enumerate(model.tip_verts):
        own = model.skin_weights[:, [3, 6, 9, 12, 15][finger]] > 0.9
        bone = model.shaped(torch.zeros(10)).offsets[15 + finger]
        reach = model.template @ (bone / bone.norm())
        assert reach[tip] >= reach[own].max() - 1e-4


@pytest.mark.parametrize("side", SIDES)
def test_mesh_is_one_closed_body_that_faces_outwards(side):
    model = load_hand(side)
    mesh = trimesh.Trimesh(model.template.numpy(), model.faces.numpy(), process=False)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.body_count == 1
    assert mesh.euler_number == 2
    assert len(mesh.vertices) == 778
    # A hand of an average adult to just above the wrist holds about 0.3 to 0.4 litres.
    assert 2.5e-4 < mesh.volume < 4.5e-4


def crossings(verts, faces):
    """Edges that pierce a triangle they share no vertex with."""
    mesh = trimesh.Trimesh(verts, faces, process=False)
    edges, corners = mesh.edges_unique, verts[faces]
    centre, middle = corners.mean(1), verts[edges].mean(1)
    reach = np.linalg.norm(corners - centre[:, None], axis=-1).max()
    reach += mesh.edges_unique_length.max() / 2
    near = cKDTree(centre).query_ball_point(middle, reach)
    edge = np.repeat(np.arange(len(edges)), [len(n) for n in near])
    face = np.concatenate([np.array(n, dtype=int) for n in near])
    apart = ~(faces[face][:, :, None] == edges[edge][:, None, :]).any((1, 2))
    edge, face = edge[apart], face[apart]
    a, b, c = np.moveaxis(corners[face], 1, 0)
    start = verts[edges[edge, 0]]
    step = verts[edges[edge, 1]] - start
    system = np.stack([b - a, c - a, -step], axis=-1)
    flat = np.abs(np.linalg.det(system)) < 1e-18
    system[flat] = np.eye(3)
    u, v, s = np.linalg.solve(system, (start - a)[..., None])[..., 0].T
    return int((~flat & (u >= 0) & (v >= 0) & (u + v <= 1) & (s >= 0) & (s <= 1)).sum())


def test_rest_pose_does_not_cut_itself():
    model = load_hand("right")
    assert crossings(model.template.double().numpy(), model.faces.numpy()) == 0


def test_skin_weights_are_a_partition_with_at_most_four_joints():
    weights = load_hand("right").skin_weights
    assert (weights >= 0).all()
    assert (weights > 0).sum(1).max() <= 4
    torch.testing.assert_close(weights.sum(1), torch.ones(778))


def test_joint_regressor_rows_are_sparse_convex_combinations_near_the_joint():
    model = load_hand("right")
    rows = model.joint_regressor
    assert (rows >= 0).all()
    torch.testing.assert_close(rows.sum(1), torch.ones(16))
    assert (rows > 0).sum(1).max() <= 40
    joints = rows @ model.template
    for joint in range(16):
        near = model.template[rows[joint] > 0]
        assert (near - joints[joint]).norm(dim=-1).max() < 0.05


def test_template_has_the_measured_proportions():
    shaped = load_hand("right").shaped(torch.zeros(10))
    intended = torch.from_numpy(MEASURED_OFFSETS * 0.93 / 1000).float()
    assert (shaped.offsets - intended).norm(dim=-1).max() < 2e-4


def test_betas_move_the_joints_as_the_shape_directions_intend():
    model = load_hand("right")
    verts = model.shaped(torch.zeros(10)).verts.double().numpy() * 1000
    _, intended = shape_directions(verts, model.skin_weights.double().numpy(), skeleton())
    root = model.joint_regressor[0] @ model.template
    for beta in range(10):
        moved = model.shaped(torch.eye(10)[beta]).joints - model.shaped(torch.zeros(10)).joints
        gap = moved.numpy() * 1000 - intended[:16, :, beta]
        assert np.linalg.norm(gap, axis=-1).max() < 0.4, f"beta {beta}, mm per unit"
    assert (root - torch.tensor([0.096, 0.006, 0.006])).norm() < 1e-4


def test_size_scales_the_whole_hand():
    model = load_hand("right")
    mean, large = model.shaped(torch.zeros(10)), model.shaped(torch.eye(10)[0])
    torch.testing.assert_close(large.verts, 1.08 * mean.verts, atol=1e-5, rtol=0)


def shape_basis(model):
    """Change of the rest keypoints per beta, (63, 10), metres."""
    mean = skeleton_of(model.shaped(torch.zeros(10)).offsets)
    each = skeleton_of(model.shaped(torch.eye(10)).offsets)
    return (each - mean).flatten(1).T.double().numpy(), mean.double().numpy()


def skeleton_of(offsets):
    points = [torch.zeros_like(offsets[..., 0, :])]
    for child, parent in enumerate(BONE_PARENTS):
        points.append(points[parent] + offsets[..., child, :])
    return torch.stack(points, dim=-2)


def closest(model, wanted):
    """Mean distance of the keypoints of the best betas to the wanted ones, and the betas."""
    basis, mean = shape_basis(model)
    betas = np.zeros(10)
    seen = np.delete(np.arange(10), 1)  # thickness is not in the skeleton
    betas[seen] = np.linalg.lstsq(basis[:, seen], (wanted - mean).ravel(), rcond=None)[0]
    rest = (mean.ravel() + basis @ betas).reshape(21, 3) - wanted
    return np.linalg.norm(rest, axis=-1).mean(), betas


def test_some_betas_give_the_measured_person():
    gap, betas = closest(load_hand("right"), skeleton(MEASURED_OFFSETS) / 1000)
    assert gap < 3e-4
    assert np.abs(betas).max() < 1.5


def test_joints_tell_every_beta_but_the_thickness():
    basis, _ = shape_basis(load_hand("right"))
    assert np.abs(basis[:, 1]).max() < 2e-4
    strength = np.linalg.svd(np.delete(basis, 1, axis=1), compute_uv=False)
    assert strength[0] / strength[-1] < 30


def test_betas_span_people_whose_bones_differ_one_by_one():
    model = load_hand("right")
    random = np.random.default_rng(0)
    gaps = []
    for _ in range(50):
        length = 1 + 0.05 * random.standard_normal((20, 1))
        length *= 1 + 0.08 * random.standard_normal()
        gaps.append(closest(model, skeleton(MEASURED_OFFSETS * 0.93 * length) / 1000)[0])
    assert np.mean(gaps) < 1e-3


def test_recorded_poses_keep_the_joint_limits():
    data = np.load(RECORDING)
    model = load_hand("left")
    pose = torch.from_numpy(data["left_pose"]).reshape(-1, 16, 3)
    inside = (pose >= model.pose_low) & (pose <= model.pose_high)
    assert inside.all((1, 2)).float().mean() > 0.97


def test_wrist_is_free_and_other_limits_are_finite():
    model = load_hand("right")
    assert torch.isinf(model.pose_low[0]).all()
    assert torch.isinf(model.pose_high[0]).all()
    assert torch.isfinite(model.pose_low[1:]).all()
    assert (model.pose_low[1:] < model.pose_high[1:]).all()


@pytest.mark.parametrize("finger", [0, 1, 2, 3])
def test_positive_z_bends_the_right_hands_fingers_towards_the_palm(finger):
    shaped = load_hand("right").shaped(torch.zeros(10))
    pose = torch.zeros(16, 3)
    pose[CHAINS[finger][1], 2] = 0.8
    moved = (
        shaped.posed(pose, torch.zeros(3)).joints - shaped.posed(0 * pose, torch.zeros(3)).joints
    )
    tip = {0: 8, 1: 12, 2: 20, 3: 16}[finger]
    assert moved[tip, 1] < -0.01


def test_fingers_point_to_minus_x_and_the_thumb_to_plus_z():
    joints = load_hand("right").shaped(torch.zeros(10)).posed(torch.zeros(16, 3), torch.zeros(3))
    assert (joints.joints[[8, 12, 16, 20], 0] < -0.1).all()
    assert joints.joints[4, 2] > 0.05


def test_bent_knuckle_keeps_its_thickness_with_the_correctives():
    model = load_hand("right")
    shaped = model.shaped(torch.zeros(10))
    pose = torch.zeros(16, 3)
    pose[2, 2] = 1.7
    with_bulge = shaped.posed(pose, torch.zeros(3)).verts
    plain = shaped._skin(shaped.verts.T, *_transforms(shaped, pose))
    outwards = (with_bulge - plain).norm(dim=-1)
    # Only round the joint that bends, and by no more than what linear blending takes away.
    assert 0.5e-3 < outwards.max() < 4e-3
    assert (model.skin_weights[outwards > 1e-4][:, [1, 2]] > 0.02).all()


def _transforms(shaped, pose):
    from geneoh.geometry.rotations import axis_angle_to_matrix
    from geneoh.hand.skeleton import MANO_FROM_OPENPOSE, forward_kinematics

    joints, turn = forward_kinematics(axis_angle_to_matrix(pose), torch.zeros(3), shaped.offsets)
    centre = joints[list(MANO_FROM_OPENPOSE[:16])]
    return turn, centre - (turn @ shaped.joints[..., None])[..., 0]


def test_asset_is_small_and_plain():
    asset = files("geneoh.hand") / "assets" / ASSET
    assert len(asset.read_bytes()) < 700_000
    arrays = read_arrays()
    assert all(array.dtype in (np.float32, np.int32) for array in arrays.values())
    assert arrays["kintree_table"][0].tolist() == list(PARENTS)
