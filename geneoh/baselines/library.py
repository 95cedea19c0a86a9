"""The trained baselines: where their weights are and how they are loaded."""

from pathlib import Path
from typing import get_args

from geneoh.baselines.regression import RegressionConfig, RegressionDenoiser
from geneoh.baselines.toch import TochAutoencoder, TochConfig
from geneoh.choices import BaselineName
from geneoh.nn.weights import file_or_shipped, load_network

SHIPPED = Path(__file__).parent / "assets"  # NAME.safetensors inside the package
BASELINES: tuple[BaselineName, ...] = get_args(BaselineName)

Baseline = TochAutoencoder | RegressionDenoiser


def baseline_weights(name: BaselineName, folder: Path | None) -> Path:
    """The file of a baseline: in the folder that the user names, else the shipped one."""
    return file_or_shipped(name, folder, SHIPPED)


def load_baseline(name: BaselineName, folder: Path | None = None) -> Baseline:
    """The network of a baseline that `geneoh eval` scores, the shipped one by default."""
    path = (folder or SHIPPED) / f"{name}.safetensors"
    if name == "toch":
        return load_network(path, TochAutoencoder, TochConfig)
    return load_network(path, RegressionDenoiser, RegressionConfig)
