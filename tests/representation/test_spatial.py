import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from geneoh.representation.spatial import SpatialRelations, decode_spatial, encode_spatial

seeds, parts = st.integers(0, 1000), st.integers(1, 2)
few = settings(max_examples=10)  # every one of them a whole scene, or two


@few
@given(seeds, parts)
def test_every_contact_point_alone_implies_the_canonical_hand(make_scene, seed, parts):
    scene = make_scene(seed, parts)
    region = scene.region()
    canon = region.to_canon(scene.joints)
    hands = encode_spatial(canon, region).hands
    torch.testing.assert_close(hands, canon[:, None].expand_as(hands), atol=1e-6, rtol=0)


@few
@given(seeds, parts)
def test_decoding_inverts_encoding(make_scene, seed, parts):
    scene = make_scene(seed, parts)
    region = scene.region()
    canon = region.to_canon(scene.joints)
    decoded = decode_spatial(encode_spatial(canon, region))
    torch.testing.assert_close(decoded, canon, atol=1e-6, rtol=0)


@few
@given(seeds, seeds)
def test_spatial_relations_do_not_change_with_a_motion_of_the_scene(
    make_scene, make_rigid, seed, other
):
    scene = make_scene(seed)
    moved = scene.moved(make_rigid(other))
    here, there = (
        encode_spatial(s.region().to_canon(s.joints), s.region()) for s in (scene, moved)
    )
    for name in SpatialRelations.__dataclass_fields__:
        torch.testing.assert_close(getattr(here, name), getattr(there, name), atol=3e-6, rtol=0)


def test_relations_are_those_of_the_definition(make_scene):
    scene = make_scene(1, parts=2)
    region = scene.region()
    relations = encode_spatial(region.to_canon(scene.joints), region)
    for t, k, j in [(0, 0, 0), (2, 5, 7), (4, 11, 20)]:
        row = region.rotation[t]  # row notation of the paper: x R_k^T with its R_k our transpose
        point, normal, joint = region.points[t, k], region.normals[t, k], scene.joints[t, j]
        torch.testing.assert_close(relations.offsets[t, k, j], (joint - point) @ row)
        torch.testing.assert_close(relations.points[t, k], (point - region.center[t]) @ row)
        torch.testing.assert_close(relations.normals[t, k], normal @ row)


def test_the_decoded_hand_is_the_mean_of_the_implied_ones(make_scene):
    scene = make_scene(2)
    region = scene.region()
    relations = encode_spatial(region.to_canon(scene.joints), region)
    wrong = relations.hands.clone()
    wrong[:, 3] += 0.12  # one of twelve points is off by 12 cm
    decoded = decode_spatial(SpatialRelations(relations.points, relations.normals, wrong))
    torch.testing.assert_close(decoded, region.to_canon(scene.joints) + 0.01, atol=1e-6, rtol=0)


def test_another_hand_at_the_same_points_is_encoded_as_by_their_region(make_scene):
    scene = make_scene(3, parts=2)
    region = scene.region()
    canon = region.to_canon(scene.joints)
    other = encode_spatial(canon, region).of_hand(canon.flip(0))
    want = encode_spatial(canon.flip(0), region)
    for name in SpatialRelations.__dataclass_fields__:
        assert torch.equal(getattr(other, name), getattr(want, name))


def test_relations_in_other_axes_are_those_of_a_frame_with_these_axes(make_scene, make_rigid):
    scene, axes = make_scene(4), make_rigid(5).rotation
    region = scene.region()
    canon = region.to_canon(scene.joints)
    got = encode_spatial(canon, region).turned(axes)
    turned = region.turned(axes)
    want = encode_spatial(turned.to_canon(scene.joints), turned)
    for name in SpatialRelations.__dataclass_fields__:
        torch.testing.assert_close(getattr(got, name), getattr(want, name), atol=1e-6, rtol=0)
