"""What `geneoh info` tells: versions, devices, hands and weights, each as lines of text."""

import os
import platform
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path

PACKAGES = ("geneoh", "torch", "numpy", "scipy", "trimesh", "libigl", "smplx")


def versions() -> Iterator[str]:
    """Python, the system, and the packages whose version changes results."""
    yield f"python {platform.python_version()} on {platform.platform()}"
    for name in PACKAGES:
        try:
            yield f"{name} {metadata.version(name)}"
        except metadata.PackageNotFoundError:
            yield f"{name} is not installed"


def devices() -> Iterator[str]:
    """What `--device` may name."""
    import torch

    yield f"cpu: {os.cpu_count()} cores, {torch.get_num_threads()} threads"
    for index in range(torch.cuda.device_count()):
        found = torch.cuda.get_device_properties(index)
        yield f"cuda:{index}: {found.name}, {found.total_memory / 2**30:.0f} GiB"


def hands(mano_dir: Path | None) -> Iterator[str]:
    """The hand models that can be loaded, and why the others cannot."""
    from geneoh.errors import GeneOHError
    from geneoh.hand.library import load_hand

    for source in ("embedded", "mano"):
        for side in ("right", "left"):
            try:
                model = load_hand(side, source=source, mano_dir=mano_dir)
            except GeneOHError as error:
                yield f"{source} {side}: not available, {error}"
            else:
                yield f"{source} {side}: {len(model.template)} vertices, {len(model.faces)} faces"


def weights() -> Iterator[str]:
    """The shipped networks, with how they were trained."""
    from geneoh.config import flat
    from geneoh.denoisers.library import SHIPPED
    from geneoh.errors import CheckpointError
    from geneoh.nn.checkpoint import load_checkpoint

    paths = sorted(SHIPPED.glob("*.safetensors"))
    for path in paths:
        try:
            checkpoint = load_checkpoint(path)
        except CheckpointError as error:
            yield f"{path.stem}: not usable, {error}"
            continue
        count = sum(tensor.numel() for tensor in checkpoint.tensors.values())
        size = path.stat().st_size / 2**20
        yield f"{path.stem}: {count / 1e6:.2f} M parameters, {size:.1f} MiB"
        yield from (f"  {name} = {value}" for name, value in flat(checkpoint.record).items())
    if not paths:
        yield f"none in {SHIPPED}"
