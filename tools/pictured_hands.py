"""A real estimator on pictures of known hands: `python -m tools.pictured_hands`.

    render FOLDER   clean clips before a camera: their pictures, truth and object
    detect FOLDER   MediaPipe's results on the pictures, as hands.json
    table FOLDER    the table of errors

Clips are the example recording from two sides, and synthetic ones of held-out families and scans.
The pictures are plain: smooth shading, one colour for hand, forearm and object, a blurred
background and white noise. `detect` needs MediaPipe (pip install mediapipe==0.10.14).
"""

import json
import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
import trimesh
from jaxtyping import Float, Shaped
from PIL import Image
from scipy.ndimage import gaussian_filter

import geneoh
from geneoh.geometry.rigid import Rigid
from geneoh.sequence.placing import placed
from geneoh.sequence.sequence import HandTrack, Sequence
from geneoh.synthesis.data_config import SynthesisConfig
from geneoh.synthesis.shapes.scans import read_folder
from geneoh.viz.raster import at_pixels, rasterise
from geneoh.viz.scene import Scene, make_scene
from tools.noisy_objects.clips import EXAMPLES, RECORDING, clip_of, made_clips, scans_of

SIZE, FOCAL = (640, 480), 600.0
"""Width and height of the pictures, and focal length, pixels."""
DISTANCES = (0.45, 0.6, 0.8, 0.5)  # least distance of the camera from the middle of the hand's way
IN_VIEW = 0.9  # least share of the frames in which the picture shows all keypoints
NEAREST = 0.2  # least depth of a keypoint in these, metres
ASIDE = (
    0.35  # standard deviation of each coordinate by which it looks aside of the back of the hand
)
FRAMES, EACH, FIRST = 75, 4, 8500
"""Frames of a synthetic clip, clips of families and of scans, number of the first one."""
SUPERSAMPLING = 2
SKIN, SLEEVE, OBJECT = (226, 174, 142), (224, 172, 140), (70, 90, 130)
ARM_LENGTH, ARM_RADIUS = 0.3, 0.024  # of the forearm, metres
LIGHT = (-0.4, -0.7, -0.6)  # direction to the light, in the camera's frame
AMBIENT, SHADOW = 0.62, 0.3  # brightness without light; share of it on the far side
GRAIN = 4.0  # standard deviation of the noise of a pixel, of 255
PALM = [0, 5, 9, 13, 17]

Picture = Shaped[np.ndarray, "H W 3"]


def clean_clips() -> Iterator[tuple[str, Sequence]]:
    """The clips by name; the word before the first blank is their group."""
    yield from ((f"recording {view}", clip_of(RECORDING)) for view in range(2))
    scans = scans_of(folder := read_folder(EXAMPLES / "objects"), folder.held_out)
    families = made_clips(SynthesisConfig().held_out, EACH, FIRST, FRAMES)
    yield from ((f"families {n}", clip) for n, clip in enumerate(families))
    of_scans = made_clips(scans.names, EACH, FIRST, FRAMES, scans)
    yield from ((f"scans {n}", clip) for n, clip in enumerate(of_scans))


def before_camera(clip: Sequence, distance: float, random: np.random.Generator) -> Sequence:
    """The clip in the frame of a camera that sees the back of the hand, a little from aside."""
    (hand,) = clip.hands
    assert hand.joints is not None, "every clip has joints"
    joints = hand.joints.double().numpy()
    wrist, index, little = joints[len(joints) // 2, [0, 5, 17]]
    normal = np.cross(index - wrist, little - wrist) * (1 if hand.side == "left" else -1)
    back = normal / np.linalg.norm(normal) + ASIDE * random.normal(size=3)
    back /= np.linalg.norm(back)
    right = np.cross(-back, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    axes = torch.from_numpy(np.stack([right, np.cross(-back, right), -back])).float()
    middle = (joints.min((0, 1)) + joints.max((0, 1))) / 2
    while True:
        eye = torch.from_numpy(middle + distance * back).float()
        seen = (hand.joints - eye) @ axes.T
        pixels = FOCAL * seen[..., :2] / seen[..., 2:]
        inside = (pixels.abs() < torch.tensor(SIZE) / 2).all(-1) & (seen[..., 2] > NEAREST)
        if float(inside.all(-1).float().mean()) >= IN_VIEW:
            break
        distance *= 1.05
    pose = Rigid(axes.expand(clip.frames, 3, 3), (-axes @ eye).expand(clip.frames, 3))
    return placed(clip, pose)


@dataclass(frozen=True)
class Photographer:
    """Takes pictures of one clip that is in the frame of the camera."""

    scene: Scene
    joints: Float[np.ndarray, "T 21 3"]
    background: Picture
    random: np.random.Generator

    def picture(self, frame: int) -> Picture:
        """The picture of one frame, bytes."""
        width, height = (SUPERSAMPLING * side for side in SIZE)
        picture, nearness = self.background.copy(), np.zeros((height, width), np.float32)
        for verts, faces, colour in self.surfaces(frame):
            screen = projected(verts)
            raster = rasterise(screen, faces, (width, height))
            normals = trimesh.Trimesh(verts, faces, process=False).vertex_normals
            seen = at_pixels(raster, screen, faces, np.asarray(normals, np.float32))
            light = seen @ (np.array(LIGHT) / np.linalg.norm(LIGHT))
            bright = AMBIENT + (1 - AMBIENT) * np.where(light < 0, SHADOW * light, light)
            row, column = np.nonzero(raster.covered)
            near = raster.nearness[row, column]
            front = near > nearness[row, column]
            row, column = row[front], column[front]
            picture[row, column] = bright[front, None] * colour
            nearness[row, column] = near[front]
        blocks = gaussian_filter(picture, (1.0, 1.0, 0)).reshape(
            SIZE[1], SUPERSAMPLING, SIZE[0], SUPERSAMPLING, 3
        )
        taken = blocks.mean((1, 3)) + GRAIN * self.random.normal(size=(*SIZE[::-1], 3))
        return taken.clip(0, 255).astype(np.uint8)

    def surfaces(self, frame: int) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """Vertices, faces and colour of the object, the forearm and the hand."""
        for part, mesh in enumerate(self.scene.object.meshes):
            yield self.scene.object_verts(part, frame).numpy(), mesh.faces.numpy(), np.array(OBJECT)
        wrist, middle = self.joints[frame, [0, 9]]
        way = (wrist - middle) / np.linalg.norm(wrist - middle)
        arm = trimesh.creation.capsule(ARM_LENGTH, ARM_RADIUS, count=[16, 24])
        turn = np.asarray(trimesh.geometry.align_vectors([0, 0, 1], way))[:3, :3]
        start = arm.vertices - [0, 0, arm.vertices[:, 2].min()]
        yield start @ turn.T + wrist, np.asarray(arm.faces), np.array(SLEEVE)
        (hand,) = self.scene.versions[0].hands
        yield hand.verts[frame].numpy(), hand.model.faces.numpy(), np.array(SKIN)


def projected(points: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, "N 3"]:
    """Pixel column, pixel row and 1 / depth in the picture before it is reduced."""
    nearness = 1 / points[:, 2:]
    pixels = FOCAL * points[:, :2] * nearness + np.array(SIZE) / 2
    return np.concatenate([SUPERSAMPLING * pixels, nearness], axis=1)


def render(folder: Path) -> None:
    """Write the clips with their pictures, each in a folder of its name."""
    for number, (name, clip) in enumerate(clean_clips()):
        random = np.random.default_rng(number)
        seen = before_camera(clip, DISTANCES[number % len(DISTANCES)], random)
        grey = gaussian_filter(random.normal(size=(SIZE[1] * 2, SIZE[0] * 2, 3)), (120, 120, 0))
        background = 150 + 5 * grey / grey.std()
        (hand,) = seen.hands
        assert hand.joints is not None, "every clip has joints"
        photographer = Photographer(make_scene({"": seen}), hand.joints.numpy(), background, random)
        place = folder / name
        place.mkdir(parents=True, exist_ok=True)
        (mesh,) = seen.object.meshes
        trimesh.Trimesh(mesh.verts, mesh.faces, process=False).export(place / "object.ply")
        geneoh.save(seen, place / "truth.npz")
        for frame in range(seen.frames):
            Image.fromarray(photographer.picture(frame)).save(place / f"{frame:06d}.png")
        print(name, flush=True)


def detect(folder: Path) -> None:
    """Write MediaPipe's results on the pictures of each clip."""
    from google.protobuf.json_format import MessageToDict  # pyright: ignore
    from mediapipe.python.solutions.hands import Hands  # pyright: ignore

    names = ("multi_hand_landmarks", "multi_hand_world_landmarks", "multi_handedness")
    for place in sorted(each.parent for each in folder.glob("*/truth.npz")):
        tracker = Hands(max_num_hands=1, min_detection_confidence=0.3, min_tracking_confidence=0.3)
        results = []
        for file in sorted(place.glob("*.png")):
            found = tracker.process(np.asarray(Image.open(file)))
            listed = {name: getattr(found, name) or [] for name in names}
            results.append({n: [MessageToDict(each) for each in x] for n, x in listed.items()})
        (place / "hands.json").write_text(json.dumps(results))
        print(place.name, sum(bool(each[names[0]]) for each in results), "of", len(results))


def by_least_squares(results: list[dict[str, Any]]) -> Float[np.ndarray, "T 21 3"]:
    """World landmarks moved to where they are seen best in each frame, as is common; NaN in frames
    without a hand."""
    found = np.full((len(results), 21, 3), np.nan)
    for frame, result in enumerate(results):
        if not result["multi_hand_landmarks"]:
            continue
        image, world = (
            np.array([[p["x"], p["y"], p["z"]] for p in result[name][0]["landmark"]])
            for name in ("multi_hand_landmarks", "multi_hand_world_landmarks")
        )
        rays = (image[:, :2] - 0.5) * SIZE / FOCAL
        rows = np.zeros((21, 2, 3))
        rows[:, [0, 1], [0, 1]], rows[:, :, 2] = 1, -rays
        goal = rays * world[:, 2:] - world[:, :2]
        shift, *_ = np.linalg.lstsq(rows.reshape(-1, 3), goal.ravel(), rcond=None)
        found[frame] = world + shift
    return found


def errors_of(hand: HandTrack, truth: Sequence) -> list[float]:
    """Mean errors in mm over the frames with the hand: of the keypoints, along the camera's ray in
    the mean, of keypoints relative to the palm; and acceleration, mm/frame²."""
    (exact,) = truth.hands
    assert hand.joints is not None, "every version has joints"
    assert exact.joints is not None, "every clip has joints"
    off = 1e3 * (hand.joints - exact.joints)[hand.valid]
    ray = torch.nn.functional.normalize(exact.joints[hand.valid].mean(1), dim=-1)
    along = (off.mean(1) * ray).sum(-1)
    formed = off - off[:, PALM].mean(1, keepdim=True)
    jerk = 1e3 * hand.joints.diff(n=2, dim=0).norm(dim=-1).mean(-1)
    jerk = jerk[hand.valid[2:] & hand.valid[1:-1] & hand.valid[:-2]]
    means = (off.norm(dim=-1), along.abs(), formed.norm(dim=-1), jerk)
    return [float(each.mean()) for each in means]


def versions_of(place: Path) -> dict[str, list[float]]:
    """The errors of each version of a clip."""
    truth = geneoh.load(place / "truth.npz", obj=place / "object.ply")
    (hand,) = truth.hands
    apart = by_least_squares(json.loads((place / "hands.json").read_text()))
    pose = torch.eye(4).repeat(truth.frames, 1, 1)
    pose[:, :3, :3], pose[:, :3, 3] = truth.object.rotation[:, 0], truth.object.translation[:, 0]
    read = geneoh.read(
        "landmarks",
        place / "hands.json",
        focal=FOCAL,
        image_size=SIZE,
        fps=truth.fps,
        obj=place / "object.ply",
        object_pose=pose.numpy(),
    )
    (seen,) = read.hands
    single = HandTrack(hand.side, seen.valid, torch.from_numpy(np.nan_to_num(apart)).float())
    alone = replace(read, object=replace(read.object, meshes=()))
    found = {"each frame by least squares": single, "as read": seen}
    for words, noisy in (("cleaned without the object", alone), ("cleaned", read)):
        (clean,) = geneoh.denoise(noisy).sequence.hands
        found[words] = replace(clean, valid=seen.valid)
    return {words: errors_of(track, truth) for words, track in found.items()}


def table(folder: Path) -> Iterator[str]:
    """The lines of the table: a row for each version, a column for each group of clips."""
    groups: dict[str, list[dict[str, list[float]]]] = {}
    for place in sorted(each.parent for each in folder.glob("*/hands.json")):
        groups.setdefault(place.name.split()[0], []).append(versions_of(place))
        print(place.name, groups[place.name.split()[0]][-1], file=sys.stderr, flush=True)
    yield "| | " + " | ".join(groups) + " |"
    yield "|---|" + "---|" * len(groups)
    for words in next(iter(groups.values()))[0]:
        cells = (np.mean([each[words] for each in clips], axis=0) for clips in groups.values())
        yield f"| {words} | " + " | ".join(" / ".join(f"{x:.1f}" for x in c) for c in cells) + " |"


def main(step: str, folder: str) -> None:
    """Run one step."""
    torch.set_num_threads(1)
    if step == "table":
        for line in table(Path(folder)):
            print(line, flush=True)
    else:
        {"render": render, "detect": detect}[step](Path(folder))


if __name__ == "__main__":
    if len(sys.argv) != 3 or sys.argv[1] not in ("render", "detect", "table"):
        raise SystemExit("usage: python -m tools.pictured_hands render|detect|table FOLDER")
    main(*sys.argv[1:])
