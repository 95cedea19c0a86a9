"""What `geneoh info` reports: versions, devices, hand models and weights."""

import os
import platform
from collections.abc import Iterator, Mapping
from itertools import product
from pathlib import Path
from typing import Any

from geneoh.errors import numbered


def facts(mano_dir: Path | None) -> dict[str, dict[str, Any]]:
    """All facts about this installation, in a form that JSON can hold."""
    from geneoh.denoisers import library as denoisers
    from geneoh.generators.both2hands import library as both2hands
    from geneoh.generators.text2hoi.networks import library as text2hoi

    return {
        "versions": versions(),
        "devices": devices(),
        "hands": hands(mano_dir),
        "weights": networks(denoisers.SHIPPED),
        "generators": networks(text2hoi.SHIPPED) | networks(both2hands.SHIPPED),
    }


def versions() -> dict[str, Any]:
    """Python, the system, and the packages; None for a package that is not installed."""
    from geneoh.files.fingerprints import package_versions

    machine = {"python": platform.python_version(), "system": platform.platform()}
    return machine | package_versions("smplx")


def devices() -> dict[str, Any]:
    """The names that `--device` takes, each with a description."""
    import torch

    cores, threads = os.cpu_count() or 1, torch.get_num_threads()
    found = {"cpu": f"{numbered(cores, 'core')}, {numbered(threads, 'thread')}"}
    for index in range(torch.cuda.device_count()):
        gpu = torch.cuda.get_device_properties(index)
        found[f"cuda:{index}"] = f"{gpu.name}, {gpu.total_memory / 2**30:.0f} GiB"
    return found


def hands(mano_dir: Path | None) -> dict[str, Any]:
    """The hand models, each with its size or the reason why it cannot be loaded."""
    from geneoh.choices import RESULT_HANDS, SIDES
    from geneoh.errors import GeneOHError
    from geneoh.hand.library import load_hand

    found: dict[str, Any] = {}
    for source, side in product(RESULT_HANDS, SIDES):
        try:
            model = load_hand(side, source=source, mano_dir=mano_dir)
            found[f"{source} {side}"] = {"vertices": len(model.template), "faces": len(model.faces)}
        except GeneOHError as error:
            found[f"{source} {side}"] = {"problem": f"not available, {error}"}
    return found


def networks(folder: Path) -> dict[str, Any]:
    """The networks in a folder, each with its size and how it was trained."""
    from geneoh.errors import CheckpointError
    from geneoh.nn.checkpoint import load_checkpoint

    found: dict[str, Any] = {}
    for path in sorted(folder.glob("*.safetensors")):
        try:
            checkpoint = load_checkpoint(path)
        except CheckpointError as error:
            found[path.stem] = {"problem": f"not usable, {error}"}
            continue
        found[path.stem] = {
            "parameters": sum(tensor.numel() for tensor in checkpoint.tensors.values()),
            "bytes": path.stat().st_size,
            "training": dict(checkpoint.record),
        }
    return found


def facts_as_text(found: Mapping[str, Mapping[str, Any]]) -> Iterator[str]:
    """The facts as lines of text that fit on one screen."""
    versions = {name: text or "not installed" for name, text in found["versions"].items()}
    yield f"python {versions.pop('python')} on {versions.pop('system')}"
    yield ", ".join(f"{name} {text}" for name, text in versions.items())
    yield from ("devices", *(f"  {name}: {text}" for name, text in found["devices"].items()))
    yield "hands"
    for name, hand in found["hands"].items():
        size = f"{hand.get('vertices')} vertices, {hand.get('faces')} faces"
        yield f"  {name}: {hand.get('problem') or size}"
    yield "weights" if found["weights"] else "weights: none are installed"
    for name, network in found["weights"].items():
        size = (network.get("parameters", 0) / 1e6, network.get("bytes", 0) / 2**20)
        text = "{:.2f} M parameters, {:.1f} MiB".format(*size)
        yield f"  {name}: {network.get('problem') or text}"
