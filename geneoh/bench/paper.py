"""Networks of the sizes that GeneOH Diffusion publishes, to time one step of each.

Their weights are random, because speed does not depend on them; nothing is cleaned. MotionDiff and
SpatialDiff have the layers of the released code: two trunks of 8 transformer layers, 512 wide, with
the noise level added in between. TemporalDiff was not released. The paper gives the widths of its
PointNet (32, 64, 128, 256, three layers each) and of its transformer (256). The depth of its
autoencoder and of its latent denoiser is assumed to be that of the other trunks. The times include
neither the optimisation of the keypoints after TemporalDiff nor the hand fit.

`geneoh.bench.run` runs this file in a separate process, like `geneoh.bench.measure`.
"""

from collections.abc import Callable
from statistics import median
from typing import Any

import torch
from jaxtyping import Float
from torch import Tensor, nn

from geneoh.bench.measure import ZERO, Found, Tell, answer, now, took
from geneoh.nn.blocks import fourier, mlp

FRAMES, POINTS = 60, 2000  # the paper's window in frames, and its contact points at inference
STEPS = {"motion": 400, "spatial": 200, "temporal": 100}  # denoiser calls of each stage
POINTS_ON_CPU = 20
"""Contact points that are timed on a CPU. Time is linear in their number, because each has its own
diffusion chain; all points together need 8 TFLOP a step."""
DEPTH, HEADS, FEED = 8, 4, 1024
TIMES = 3  # timed repetitions, of which the median counts


class PaperDenoiser(nn.Module):
    """Two transformers over frames; between them the noise level is added to every token."""

    def __init__(self, into: nn.Module, out: nn.Module, width: int) -> None:
        """Build the trunks between the layers `into` and `out`.

        In the released code, the second trunk has no activation between its linear layers and a
        learned scale of its residuals (ReZero), which is left out here.
        """
        super().__init__()
        self.into, self.out, self.width = into, out, width
        self.before = trunk(width, 0.1, activation="gelu")
        self.level = mlp(width, width, width)
        self.after = trunk(width, 0.2, activation=nn.Identity(), norm_first=True)
        self.norm = nn.LayerNorm(width)

    def forward(
        self, x: Float[Tensor, "B T F"], level: Float[Tensor, " B"]
    ) -> Float[Tensor, "B T F"]:
        """One call of the denoiser."""
        tokens = self.into(x)
        tokens = tokens + fourier(torch.linspace(0, 1, x.shape[1]).to(x), self.width)
        tokens = self.before(tokens) + self.level(fourier(level, self.width))[:, None]
        return self.out(self.norm(self.after(tokens)))


class PaperAutoencoder(nn.Module):
    """TemporalDiff's autoencoder: relations at all points to one latent per frame, and back."""

    def __init__(self, width: int = 256) -> None:
        """Build a PointNet on 69 features of a point, a trunk over frames, and linear heads."""
        super().__init__()
        self.points = mlp(69, *(size for size in (32, 64, 128, width) for _ in range(3)))
        self.trunk = trunk(width, 0.0)
        self.heads = nn.Linear(width + 6, 63)

    def forward(
        self, relations: Float[Tensor, "T K 69"], places: Float[Tensor, "T K 6"]
    ) -> Float[Tensor, "T K 63"]:
        """Encode and decode once."""
        latent = self.trunk(self.points(relations).amax(1)[None])[0]
        around = latent[:, None].expand(-1, places.shape[1], -1)
        return self.heads(torch.cat([around, places], dim=-1))


def trunk(width: int, dropout: float, **how: Any) -> nn.Module:
    """Transformer layers of the paper's size; dropout acts in training only."""
    layer = nn.TransformerEncoderLayer(width, HEADS, FEED, dropout, batch_first=True, **how)
    return nn.TransformerEncoder(layer, DEPTH, enable_nested_tensor=False)


def paper_networks() -> dict[str, nn.Module]:
    """The denoiser of each stage, and the autoencoder of TemporalDiff."""
    deep = nn.Sequential(mlp(63, 512, 512), mlp(512, 512, 512))
    networks = {
        "motion": PaperDenoiser(nn.Linear(63, 512), nn.Linear(512, 63), 512),
        "spatial": PaperDenoiser(deep, mlp(512, 256, 63), 512),
        "temporal": PaperDenoiser(nn.Identity(), nn.Identity(), 256),
        "autoencoder": PaperAutoencoder(),
    }
    return {name: network.eval() for name, network in networks.items()}


def parameter_count(network: nn.Module) -> int:
    """Number of a network's parameters."""
    return sum(parameter.numel() for parameter in network.parameters())


def measured_networks(device: str, tell: Tell, points: int | None = None) -> Found:
    """Time of one window and one sample with such networks: the time of one step times the steps.

    `points` is the number of contact points that are timed: by default all of them on a GPU,
    `POINTS_ON_CPU` on a CPU.
    """
    timed = points or (POINTS if device.startswith("cuda") else POINTS_ON_CPU)
    networks = {name: network.to(device) for name, network in paper_networks().items()}
    pairs, places = (torch.randn(FRAMES, POINTS, size, device=device) for size in (69, 6))
    once = times(lambda: networks["autoencoder"](pairs, places), device)
    chains = {"motion": (1, 63), "spatial": (timed, 63), "temporal": (1, 256)}
    whole, found = ZERO | {"parameters": 0, "points_timed": timed}, Found()
    for done, (stage, (count, features)) in enumerate(chains.items(), 1):
        x = torch.randn(count, FRAMES, features, device=device)
        level = torch.full((count,), 0.5, device=device)
        spent = times(lambda x=x, level=level, net=networks[stage]: net(x, level), device)
        step = {name: value * (POINTS / timed if count > 1 else 1) for name, value in spent.items()}
        size, steps = parameter_count(networks[stage]), STEPS[stage]
        found[stage] = {name: steps * value for name, value in step.items()}
        if stage == "temporal":
            size += parameter_count(networks["autoencoder"])
            found[stage] = {name: value + once[name] for name, value in found[stage].items()}
        found[stage] |= {"parameters": size, "steps": steps, "step": step}
        whole |= {name: whole[name] + found[stage][name] for name in (*spent, "parameters")}
        tell(f"{stage} of the paper's size", done, len(chains))
    return {**found, "whole": whole | {"peak_mb": now(device).peak_mb}}


@torch.no_grad()
def times(work: Callable[[], Any], device: str) -> dict[str, float]:
    """Median times of `work` over `TIMES` calls, after one call that is not counted."""
    work()
    spent: list[dict[str, float]] = []
    for _ in range(TIMES):
        before = now(device)
        work()
        spent.append(took(before, now(device)))
    return {name: median(each[name] for each in spent) for name in ("seconds", "processor")}


if __name__ == "__main__":
    answer(lambda point, tell: measured_networks(point["device"], tell))
