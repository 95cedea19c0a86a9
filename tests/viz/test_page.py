import base64
import json
import os
import re
import subprocess
import zlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from geneoh.geometry.mesh import Mesh
from geneoh.viz.page import coarser, page_html
from geneoh.viz.strip import UP


@pytest.fixture(scope="module")
def page(scene):
    return page_html(scene, "a <b> & c", up=UP)


def unpacked(page: str) -> tuple[dict, bytes]:
    told = json.loads(re.search(r'type="application/json">(.*?)</script>', page, re.S)[1])
    data = re.search(r'type="text/plain">(.*?)</script>', page, re.S)[1]
    return told, zlib.decompress(base64.b64decode(data))


def array(place: dict, raw: bytes) -> np.ndarray:
    """What the viewer does: bytes back in order, then summed over frames."""
    kind = np.dtype(place["type"])
    count = int(np.prod(place["shape"]))
    block = np.frombuffer(raw, np.uint8, count * kind.itemsize, place["at"])
    values = np.ascontiguousarray(block.reshape(kind.itemsize, count).T).view(kind)
    values = values.reshape(place["shape"])
    return values.cumsum(0, dtype=kind) if place["delta"] else values


def test_vertices_come_back_to_a_hundredth_of_a_millimetre(scene, page):
    told, raw = unpacked(page)
    for take, shown in zip(scene.takes, told["takes"], strict=True):
        for hand, kept in zip(take.hands, shown["hands"], strict=True):
            verts = array(kept["verts"], raw) * told["step"] + np.array(told["low"])
            np.testing.assert_allclose(verts, hand.verts.numpy(), atol=1e-5)
            assert kept["valid"] == hand.valid.int().tolist()


def test_samples_and_parts_are_in_the_page(scene, page):
    told, raw = unpacked(page)
    assert len(told["parts"]) == 2
    steps = array(told["samples"]["right"], raw)
    joints = steps * told["step"] + np.array(told["low"])
    np.testing.assert_allclose(joints, scene.samples["right"].transpose(0, 1).numpy(), atol=1e-5)


def test_the_title_is_text_and_never_markup(page):
    assert "<h1>a &lt;b&gt; &amp; c</h1>" in page
    assert "{{" not in page.replace(unfilled_three(page), "")


def unfilled_three(page: str) -> str:
    """The library's own text, which may hold braces."""
    start = page.index("three.js, https://threejs.org")
    return page[start : page.index("</script>", start)]


def test_the_page_carries_the_licence_of_what_it_holds(page):
    assert "The MIT License" in page
    assert "three.js authors" in page


def test_300_frames_of_two_hands_before_and_after_stay_under_6_mb(scene):
    generator = torch.Generator().manual_seed(0)
    frames = torch.linspace(0, 5, 300).long()

    def long(hand):
        shake = 0.01 * torch.randn(300, 1, 3, generator=generator)
        return replace(
            hand,
            verts=hand.verts[frames] + shake,
            distance=hand.distance[frames] + shake[..., 0],
            joints=hand.joints[frames],
            depth=hand.depth[frames],
            fingers=hand.fingers[frames],
            acceleration=hand.acceleration[frames],
            pose=hand.pose[frames],
            wrist=hand.wrist[frames],
            track=replace(
                hand.track,
                valid=hand.valid[frames],
                pose=hand.track.pose[frames],
                wrist=hand.track.wrist[frames],
                joint_spread=hand.track.joint_spread[frames],
            ),
        )

    takes = tuple(replace(t, hands=tuple(long(h) for h in t.hands)) for t in scene.takes)
    moving = replace(
        scene.object,
        rotation=scene.object.rotation[frames],
        translation=scene.object.translation[frames],
    )
    text = page_html(replace(scene, takes=takes, object=moving, samples={}), "long", up=UP)
    assert len(text.encode()) < 6e6


def test_a_mesh_of_too_many_faces_is_drawn_coarser_and_in_place():
    side = torch.linspace(0, 0.1, 61)
    grid = torch.cartesian_prod(side, side)
    verts = torch.cat([grid, torch.zeros(len(grid), 1)], -1)
    at = torch.arange(61 * 61).reshape(61, 61)
    a, b, c, d = at[:-1, :-1], at[1:, :-1], at[:-1, 1:], at[1:, 1:]
    faces = torch.cat([torch.stack(t, -1).reshape(-1, 3) for t in ((a, b, c), (b, d, c))])
    mesh = Mesh(verts, faces)
    small = coarser(mesh, 2000)
    assert 500 < len(small.faces) <= 2000
    torch.testing.assert_close(small.extent(), mesh.extent(), atol=0.004, rtol=0)
    assert coarser(mesh, 10_000) is mesh


def test_in_a_browser_it_plays_scrubs_and_switches_without_network_or_error(
    page, node_modules, tmp_path
):
    chromium = os.environ.get("CHROMIUM", "/usr/bin/chromium")
    if not Path(chromium).exists():
        pytest.skip(f"no browser at {chromium}; CHROMIUM may name one")
    (tmp_path / "page.html").write_text(page, encoding="utf-8")
    script = Path(__file__).with_name("drive_page.cjs")
    run = subprocess.run(
        ["node", script, chromium, tmp_path / "page.html", tmp_path],
        env={**os.environ, "NODE_PATH": str(node_modules)},
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert run.returncode == 0, run.stderr
    seen = json.loads(run.stdout)
    assert seen["messages"] == []
    assert seen["requests"] == []
    assert seen["scrubbed"] == 5
    assert seen["played"] != 5
    assert seen["layout"] == "overlaid"
    assert seen["sample"] == 0
    assert seen["legend"].startswith("distance to the object")
    # the left half shows the hand that sank, in red; the right half one that did not
    before, after = seen["red"]
    assert before > 50
    assert before > 4 * after
    assert seen["changed"] > 1000
