"""Preconditioning of a denoiser by noise level (Karras et al. 2022, table 1), around an anchor.

The clean sample is expected within `scale` of `anchor`, so that the network reads and predicts
numbers of order one. As sigma goes to 0 the skip path takes over and the denoiser becomes the
identity.
"""

from collections.abc import Callable
from dataclasses import dataclass

from jaxtyping import Float
from torch import Tensor


@dataclass(frozen=True)
class Scaling:
    """Coefficients for one batch of noise levels, shaped to broadcast against the sample."""

    skip: Float[Tensor, "*S"]
    out: Float[Tensor, "*S"]
    inp: Float[Tensor, "*S"]
    level: Float[Tensor, "*S"]
    """Noise level as the network reads it: a quarter of the log noise-to-scale ratio."""

    @classmethod
    def of(cls, sigma: Float[Tensor, "*S"], scale: Float[Tensor, "*S"]) -> "Scaling":
        """Coefficients for noise `sigma` on data of standard deviation `scale`, same unit."""
        total = (sigma**2 + scale**2).sqrt()
        level = 0.25 * (sigma.clamp(min=1e-6) / scale).log()
        return cls(scale**2 / total**2, sigma * scale / total, 1 / total, level)


def preconditioned(
    network: Callable[[Tensor, Tensor], Tensor],
    x: Float[Tensor, "*S"],
    anchor: Float[Tensor, "*#S"],
    sigma: Float[Tensor, "*N"],
    scale: Float[Tensor, "*N"],
) -> Float[Tensor, "*S"]:
    """Estimate of the clean sample of `x` = clean + sigma * noise, in the unit of `x`.

    `network` maps (scaled input, `Scaling.level`) to the scaled output.
    """
    scaling = Scaling.of(sigma, scale)
    residual = x - anchor
    return (
        anchor
        + scaling.skip * residual
        + scaling.out * network(scaling.inp * residual, scaling.level)
    )


def loss_weight(sigma: Float[Tensor, "*N"]) -> Float[Tensor, "*N"]:
    """Loss weight that makes the squared error of `preconditioned` of unit size at any noise, for
    data of unit scale."""
    return 1 / sigma.clamp(max=1.0) ** 2
