"""What is fuzzed: sound files in every format that geneoh reads, and the command that reads them.

Each target is a folder with nine frames of one interaction, poses of its object included, and the
command that cleans it. Data sets and estimators come from tests/support/trees.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import trees
import trimesh
from made_grasps import ANY_GRASP
from trees.cases import Case
from trees.interaction import flat

from geneoh.config import as_dict
from geneoh.denoisers.motion import MotionConfig
from geneoh.denoisers.spatial import SpatialConfig
from geneoh.denoisers.temporal import TemporalConfig
from geneoh.nn.checkpoint import Checkpoint, save_checkpoint
from geneoh.synthesis.data_config import SynthesisConfig
from geneoh.synthesis.shards import write_shards
from geneoh.training.config import TrainConfig
from geneoh.training.stages import build_model

from .bodies_and_hands import body_targets
from .generators import generator_targets
from .target import Target

QUICK = ("--preset", "fast", "--samples", "1", "--steps", "1", "-o", "{out}/clean.npz")
MESHES = (".obj", ".ply", ".stl", ".glb", ".off")
TINY_TRAINING = TrainConfig(
    motion=MotionConfig(width=16, depth=1, heads=2),
    spatial=SpatialConfig(width=16, frames=4),
    temporal=TemporalConfig(width=16, depth=1, heads=2),
)
ONE_STEP = ("steps=1", "batch=2", "warmup=1", "validation_batches=1", "motion.width=16")


def kind_of(name: str) -> str:
    """What the table calls a file."""
    ending = Path(name).suffix
    if "MANO" in name or "SMPLH" in name:
        return "MANO"
    if ending in (".npz", ".npy", ".json", ".csv", ".safetensors", *MESHES):
        return ending[1:]
    return "pickle" if ending in (".pkl", ".pickle", ".p", ".pt", ".pth") else "text"


def write_targets(folder: Path) -> list[Target]:
    """Every target, with its files written."""
    mano = trees.write_mano(folder / "mano")
    made = [*own_layouts(folder), *mesh_files(folder), weights(folder), shards(folder)]
    made += [with_mano(folder), *generator_targets(folder), *body_targets(folder)]
    for case in trees.CASES:
        made += tree_target(case, folder / case.build.__name__, mano)
    return made


def write_object(root: Path) -> None:
    """The mesh of the object and its poses."""
    root.mkdir(parents=True, exist_ok=True)
    s = trees.scene()
    trees.write_mesh(root / "object.obj", s.verts, s.faces)
    np.save(root / "pose.npy", s.matrices())


def own_layouts(folder: Path) -> Iterator[Target]:
    """The layouts of npz that are read without --from."""
    s, moving = trees.scene(), {"obj_pose": trees.scene().matrices().astype("f4"), "fps": 30.0}
    pose, wrist = flat(s.pose["right"]).astype("f4"), s.wrist["right"].astype("f4")
    hand = {"side": "right", "joints": s.joints["right"].astype("f4")}
    betas, seen = s.betas["right"].astype("f4"), np.ones(s.frames, bool)
    layouts = {
        "joints": {**hand, "valid": seen, "confidence": np.full((s.frames, 21), 0.9)},
        "smplx": {
            **hand,
            **{"global_orient": pose[:, :3], "hand_pose": pose[:, 3:], "transl": wrist},
            **{"betas": betas, "flat_hand_mean": True},
        },
        "taco": {
            **{"side": "right", "hand_pose": pose, "hand_trans": wrist, "hand_shape": betas},
            **{"hand_joints": hand["joints"], "hand_valid": seen},
        },
        "own": {
            **{"format": "geneoh-sequence", "version": 1, "hand_model": "mano", "source": "fuzz"},
            **{f"{side}_{name}": value for side in ("right", "left") for name, value in {
                "pose": flat(s.pose[side]).astype("f4"), "wrist": s.wrist[side].astype("f4"),
                "betas": s.betas[side].astype("f4"), "joints": s.joints[side].astype("f4"),
                "valid": seen}.items()},
        },
    }  # fmt: skip
    for name, fields in layouts.items():
        root = folder / f"npz_{name}"
        write_object(root)
        np.savez(root / "hand.npz", **fields, **moving)
        yield npz_target(f"npz {name}", root, "hand.npz", "object.obj")


def npz_target(name: str, root: Path, changed: str, mesh: str) -> Target:
    """A target whose hand is hand.npz."""
    files = ("{in}/hand.npz", "--obj", f"{{in}}/{mesh}")
    return Target(
        *(name, kind_of(changed), root, (changed,), ("denoise", *files, *QUICK)),
        (("view", *files, "-o", "{out}/page.html"), ("view", *files, "-o", "{out}/scene.glb")),
    )


def mesh_files(folder: Path) -> Iterator[Target]:
    """The object in every format of meshes."""
    s = trees.scene()
    box = trimesh.Trimesh(s.verts, s.faces, process=False)
    lid = trimesh.Trimesh(s.verts + [0.0, 0.08, 0.0], s.faces, process=False)
    written: dict[str, tuple[str, Callable[[], bytes | str]]] = {
        "obj": (".obj", lambda: box.export(file_type="obj")),
        "ply": (".ply", lambda: box.export(file_type="ply")),
        "ply text": (".ply", lambda: box.export(file_type="ply", encoding="ascii")),
        "stl": (".stl", lambda: box.export(file_type="stl")),
        "stl text": (".stl", lambda: box.export(file_type="stl_ascii")),
        "off": (".off", lambda: box.export(file_type="off")),
        "glb": (".glb", lambda: box.export(file_type="glb")),
        "glb two": (".glb", lambda: trimesh.Scene([box, lid]).export(file_type="glb")),
    }
    for name, (ending, write) in written.items():
        root = folder / f"mesh_{name.replace(' ', '_')}"
        write_object(root)
        data = write()
        (root / f"mesh{ending}").write_bytes(data.encode() if isinstance(data, str) else data)
        np.savez(root / "hand.npz", joints=s.joints["right"], side="right", obj_pose=s.matrices())
        yield npz_target(f"mesh {name}", root, f"mesh{ending}", f"mesh{ending}")


def weights(folder: Path) -> Target:
    """Small networks in place of the shipped ones."""
    root = folder / "weights"
    target = next(own_layouts(folder))
    for stage in ("motion", "spatial", "temporal"):
        tensors = build_model(stage, TINY_TRAINING).state_dict()
        record = {"config": as_dict(TINY_TRAINING), "step": 1}
        save_checkpoint(root / f"{stage}.safetensors", Checkpoint(tensors, record))
    write_object(root)
    np.savez(root / "hand.npz", **dict(np.load(target.root / "hand.npz")))
    stages = tuple(f"{stage}.safetensors" for stage in ("motion", "spatial", "temporal"))
    command = (*npz_target("", root, "hand.npz", "object.obj").command, "--weights", "{in}")
    return Target("weights", "safetensors", root, stages, command)


def shards(folder: Path) -> Target:
    """Interactions to learn from, and one step of learning from them."""
    root = folder / "shards"
    config = SynthesisConfig(count=4, frames=62, points=8, shard=2, grasps=ANY_GRASP)
    write_shards(root, config, seed=0)
    files = tuple(path.name for path in sorted(root.glob("*.safetensors")))
    settings = [word for setting in ONE_STEP for word in ("--set", setting)]
    train = ("train", "--stage", "motion", "--data", "{in}", "-o", "{out}/run", *settings)
    return Target("shards", "safetensors", root, files, train)


def with_mano(folder: Path) -> Target:
    """MANO's files, which the result is fitted with."""
    root = folder / "with_mano"
    trees.write_mano(root / "mano")
    write_object(root)
    fields = dict(np.load(folder / "npz_smplx" / "hand.npz"))
    np.savez(root / "hand.npz", **{n: v for n, v in fields.items() if n != "joints"})
    command = npz_target("", root, "hand.npz", "object.obj").command
    extra = ("--hand", "mano", "--mano", "{in}/mano")
    return Target("MANO", "MANO", root, ("mano/MANO_RIGHT.pkl",), (*command, *extra))


def tree_target(case: Case, root: Path, mano: Path) -> list[Target]:
    """A data set in miniature: a target for each kind of its files."""
    (data := root / "data").mkdir(parents=True)
    case.build(data, trees.scene(case.left), False)
    files = sorted(str(path.relative_to(root)) for path in root.rglob("*") if path.is_file())
    start = f"{{in}}/data/{case.start}"
    options = ["--mano", "{in}/../mano"]
    if not case.object:
        write_object(root)
        options += ["--obj", "{in}/object.obj", "--object-pose", "{in}/pose.npy"]
        files += ["pose.npy"] if case.source == "keypoints" else []
    for name, value in case.options(Path("{in}/data")).items():
        options += [f"--{name.replace('_', '-')}", str(value)]
    clip = clip_name(case, data, mano)
    denoise = ("denoise", start, "--from", case.source, *clip, *options, *QUICK)
    convert = ("convert", case.source, start, "-o", "{out}/all", *options)
    whole = Target(case.build.__name__, "", root, (), denoise, (convert,))
    kinds = sorted({kind_of(name) for name in files})
    return [
        replace(whole, kind=kind, changed=tuple(n for n in files if kind_of(n) == kind))
        for kind in kinds
    ]


def clip_name(case: Case, root: Path, mano: Path) -> tuple[str, ...]:
    """The option that chooses one recording, where a source holds several."""
    names = [recording.name for recording in case.read(root, mano)]
    return ("--clip", names[0]) if len(names) > 1 else ()
