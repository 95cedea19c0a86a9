import base64
import json
import os
import re
import shutil
import subprocess
import zlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from geneoh.metrics.report import measure_posed
from geneoh.viz.page import page_html
from geneoh.viz.scene import make_scene

pytestmark = pytest.mark.usefixtures("few_directions")

NOTES = ("left hand: <b>1</b> & 'two'", "a {{TITLE}}")


@pytest.fixture(scope="module")
def page(scene):
    return page_html(replace(scene, title="a <b> & c"))


def unpacked(page: str) -> tuple[dict, bytes]:
    described = json.loads(re.search(r'type="application/json">(.*?)</script>', page, re.S)[1])
    data = re.search(r'type="text/plain">(.*?)</script>', page, re.S)[1]
    return described, zlib.decompress(base64.b64decode(data))


def array(place: dict, raw: bytes) -> np.ndarray:
    """What the viewer does: bytes back in order, then summed over frames."""
    kind = np.dtype(place["type"])
    count = int(np.prod(place["shape"]))
    block = np.frombuffer(raw, np.uint8, count * kind.itemsize, place["at"])
    values = np.ascontiguousarray(block.reshape(kind.itemsize, count).T).view(kind)
    values = values.reshape(place["shape"])
    return values.cumsum(0, dtype=kind) if place["delta"] else values


def test_vertices_come_back_to_a_hundredth_of_a_millimetre(scene, page):
    described, raw = unpacked(page)
    for version, shown in zip(scene.versions, described["versions"], strict=True):
        for hand, kept in zip(version.hands, shown["hands"], strict=True):
            verts = array(kept["verts"], raw) * described["step"] + np.array(described["low"])
            np.testing.assert_allclose(verts, hand.verts.numpy(), atol=1e-5)
            assert kept["valid"] == hand.valid.int().tolist()


def test_samples_and_parts_are_in_the_page(scene, page):
    described, raw = unpacked(page)
    assert len(described["parts"]) == 2
    assert described["scales"]["spread"]["title"] == "expected error of the result (RMS)"
    steps = array(described["samples"]["right"], raw)
    joints = steps * described["step"] + np.array(described["low"])
    np.testing.assert_allclose(joints, scene.samples["right"].transpose(0, 1).numpy(), atol=1e-5)


def test_means_of_the_page_are_those_that_the_command_prints(scene):
    """Fingertips are averaged over the frames with contact, in the page as in the report."""
    version = replace(scene.versions[1], hands=scene.versions[1].hands[:1])
    hand, surface = version.hands[0], scene.object.surface()
    # the hand leaves the object in the second half, so that not all frames have contact
    verts, joints = hand.verts.clone(), hand.joints.clone()
    verts[3:, :, 1] += 0.1
    joints[3:, :, 1] += 0.1
    moved = replace(hand, verts=verts, joints=joints)
    alone = replace(scene, versions=(replace(version, hands=(moved,)),), samples={})
    means = unpacked(page_html(alone))[0]["versions"][0]["means"]
    report, _ = measure_posed(
        verts.__getitem__, joints, surface, scene.fps, hand.valid, faces=hand.model.faces
    )
    assert 0 < report.contact_fraction < 1
    assert means == {
        "penetration": pytest.approx(report.penetration_mean_mm, abs=1e-3),
        "contact": pytest.approx(report.fingers_in_contact, abs=1e-3),
        "acceleration": pytest.approx(report.acceleration_mm, abs=1e-3),
    }


def test_the_title_is_text_and_never_markup(page):
    assert "<h1>a &lt;b&gt; &amp; c</h1>" in page
    assert "{{" not in page


@pytest.fixture(scope="module")
def long_page(sequences):
    """300 frames of two hands before and after, which tremble differently in each."""
    generator = torch.Generator().manual_seed(0)
    frames = torch.linspace(0, 5, 300).long()
    before, after = sequences
    scene = make_scene({"noisy": before[frames], "clean": after[frames]})

    def shaken(hand):
        return replace(hand, verts=hand.verts + 0.01 * torch.randn(300, 1, 3, generator=generator))

    versions = tuple(replace(t, hands=tuple(map(shaken, t.hands))) for t in scene.versions)
    return page_html(replace(scene, versions=versions))


def test_300_frames_of_two_hands_before_and_after_stay_under_6_mb(long_page):
    assert len(long_page.encode()) < 6e6


@pytest.fixture(scope="module")
def drive(node_modules, tmp_path_factory):
    """Run one of the scripts beside this file on a page in a browser; what it saw."""
    chromium = os.environ.get("CHROMIUM") or shutil.which("chromium") or "chromium"
    if shutil.which(chromium) is None:
        pytest.skip(f"no browser {chromium}; install chromium, or let CHROMIUM name one")

    def run_script(name: str, page: str) -> dict:
        folder = tmp_path_factory.mktemp("page")
        (folder / "page.html").write_text(page, encoding="utf-8")
        script = Path(__file__).with_name(name)
        run = subprocess.run(
            ["node", script, shutil.which(chromium), folder / "page.html", folder],
            env={**os.environ, "NODE_PATH": str(node_modules)},
            capture_output=True,
            text=True,
            timeout=900,
        )
        assert run.returncode == 0, run.stderr
        return json.loads(run.stdout)

    return run_script


def test_in_a_browser_it_plays_scrubs_and_switches_without_network_or_error(page, drive):
    seen = drive("drive_page.cjs", page)
    assert seen["messages"] == []
    assert seen["requests"] == []
    assert seen["scrubbed"] == 5
    assert seen["played"] != 5
    assert seen["layout"] == "overlaid"
    assert seen["sample"] == 0
    assert seen["legend"].startswith("distance to the object")
    # the left half shows the hand that sank, in red; the right half one that did not
    before, after = seen["first"]["red"]
    assert before > 200
    assert before > 4 * after
    assert min(seen["first"]["skin"]) > 2000
    assert min(seen["first"]["object"]) > 2000
    assert seen["turned"] > 0.02
    assert seen["painted"] > 0.001
    # a phone shows one above the other, and nothing is wider than its screen
    assert seen["phone"]["red"][0] > 200
    assert seen["phone"]["red"][0] > 4 * seen["phone"]["red"][1]
    assert seen["phone"]["overflow"] == 0
    assert seen["narrow"] == {"follow": False, "keys": True, "overflow": 0}


@pytest.fixture(scope="module")
def reached(scene, drive):
    """What was seen of a body with an object, two notes and long times, also on paper."""
    filled = torch.tensor([0, 0, 1, 1, 0, 0]).bool()
    shown = replace(scene, limbs=("arm",), filled=filled, notes=NOTES, fps=1e-7)
    return drive("reach_page.cjs", page_html(shown))


def test_a_body_and_its_object_have_two_colours(reached):
    assert min(reached["parts"].values()) > 1000


def test_notes_are_text_that_is_hidden_until_it_is_asked_for(reached):
    assert reached["notes"] == {"atFirst": False, "texts": list(NOTES), "open": True}


def test_a_page_without_notes_has_no_list_of_them(page):
    assert 'id="notes"' not in page


def test_frames_that_were_filled_in_are_shaded_in_the_curves(reached):
    assert reached["shades"] == [False, False, True, True, False, False]


def test_the_time_ends_before_the_slider_which_stays_in_its_place(reached):
    (first_end, first_slider), (last_end, last_slider) = reached["columns"]
    assert first_end <= last_end < last_slider
    assert last_slider == first_slider


def test_keys_are_left_to_the_control_that_has_the_focus(reached):
    keys = reached["keys"]
    assert keys["button"] == {"seeThrough": False}
    assert keys["play"]["playing"] is True
    assert keys["list"] == {"colouring": "spread"}
    assert keys["ten"] == {"frame": 5, "playing": False}


def test_escape_closes_the_keys_and_the_notes(reached):
    opened, closed = reached["keys"]["open"], reached["keys"]["closed"]
    assert (opened["help"], opened["open"]) == ("true", [True, True])
    assert (closed["help"], closed["open"]) == ("false", [False, False])


def test_keys_turn_and_zoom_the_picture(reached):
    turned, nearer = reached["keys"]["turned"], reached["keys"]["nearer"]
    assert turned.keys() == {"yaw", "pitch"}
    assert turned["yaw"] < 0
    assert nearer == {"zoom": pytest.approx(1.15)}


def test_colours_with_a_meaning_stay_where_the_user_forces_colours(reached):
    forced = reached["forced"]
    assert "gradient" in forced["legend"]
    assert forced["dot"] not in ("rgb(255, 255, 255)", "rgb(0, 0, 0)")
    assert (forced["name"], forced["value"]) == ("rgb(185, 77, 18)", "rgb(20, 99, 165)")
    assert forced["border"] == "2px"


def test_at_400_percent_zoom_all_can_be_scrolled_to_and_titles_keep_to_their_panels(reached):
    assert reached["magnified"]["overflow"] == "visible"
    assert reached["magnified"]["wide"] == 320
    assert reached["magnified"]["beside"] < 0


def test_on_paper_the_picture_keeps_its_shape_and_the_legend_its_colours(reached):
    assert reached["paper"] == {"fit": "contain", "colours": ["exact", "exact"]}


def test_without_a_gpu_300_frames_open_in_2_s_and_play_at_30_a_second(long_page, drive):
    seen = drive("time_page.cjs", long_page)
    # of the page's thread's own time, so that what else the machine does is not counted
    assert seen["opening"] < 2
    assert seen["playing"] < 1 / 30
