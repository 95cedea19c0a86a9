"""What is fuzzed of hands for bodies: files of bodies in every layout, models, and weights."""

from collections.abc import Callable, Iterator
from pathlib import Path

import bodies
import numpy as np
from made_bodies import SKELETON, WORDS, tiny_networks

from geneoh.body.skeleton import PARENTS
from geneoh.config import as_dict
from geneoh.generators.text import learned_pieces
from geneoh.nn.checkpoint import Checkpoint, save_checkpoint
from geneoh.readers.bodies.bvh import bvh_text

from .target import Target

SENTENCE = "the right hand waves, the left rests"
MOTION = bodies.swaying(12)
FILES: dict[str, Callable[[Path], object]] = {
    "smplx.npz": lambda path: bodies.smplx_names(path, MOTION),
    "amass.npz": lambda path: bodies.amass(path, MOTION),
    "amass_parts.npz": lambda path: bodies.amass(path, MOTION, split=True),
    "both57m.p": lambda path: bodies.both57m(path, MOTION, MOTION),
    "motionx.npy": lambda path: bodies.motion_x(path, MOTION),
    "own.npz": lambda path: bodies.hands_file(path, bodies.recording(12, "z")),
    "body.bvh": lambda path: path.write_text(bvh_text(SKELETON, MOTION, 30.0)),
}


def body_targets(folder: Path) -> Iterator[Target]:
    """Bodies that are given hands, the user's model of a body, and networks."""
    root = folder / "bodies"
    root.mkdir(parents=True)
    write_networks(root)
    write_model(root / "SMPLH.npz")
    for name, write in FILES.items():
        write(root / name)
        yield target(name, root, (name,))
    yield target("body model", root, ("SMPLH.npz",), "--skeleton", "{in}/SMPLH.npz")
    weights = tuple(path.name for path in sorted(root.glob("*.safetensors")))
    yield target("networks of hands", root, weights)


def target(name: str, root: Path, changed: tuple[str, ...], *more: str) -> Target:
    """Hands for one of the bodies."""
    body = name if name in FILES else "smplx.npz"
    command = ("generate", "--body", f"{{in}}/{body}", SENTENCE, "--weights", "{in}", *more)
    command += ("--steps", "1", "-o", "{out}/clip.npz", "-o", "{out}/clip.bvh")
    return Target(name, "body", root, changed, command)


def write_networks(root: Path) -> None:
    """Small networks that learned nothing."""
    networks, words = tiny_networks(), learned_pieces([SENTENCE] * 2, WORDS.pieces)
    built = {"body_hands": networks.body, "text_hands": networks.text, "blend": networks.blend}
    for name, network in built.items():
        record = {"config": {name: as_dict(network.config)}, "tokenizer": words.to_str()}
        save_checkpoint(root / f"{name}.safetensors", Checkpoint(network.state_dict(), record))


def write_model(path: Path) -> None:
    """A body model whose vertices are its joints."""
    places = np.zeros((52, 3))
    for joint, parent in enumerate(PARENTS[1:], 1):
        places[joint] = places[parent] + SKELETON.offsets[joint].numpy()
    tree = np.array([[2**32 - 1, *PARENTS[1:]], range(52)], dtype=np.int64)
    shapes = np.full((52, 3, 10), 0.01)
    np.savez(path, v_template=places, J_regressor=np.eye(52), shapedirs=shapes, kintree_table=tree)
