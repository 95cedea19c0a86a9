"""The Wiener estimate of clean tokens, from which the interaction network starts (ours)."""

from dataclasses import dataclass
from functools import cache

import torch
from jaxtyping import Bool, Float
from torch import Tensor, nn

LEAST_VARIANCE = 1e-3  # lower bound along an axis or a wave; features have variance 1


@dataclass(frozen=True)
class Waves:
    """Cosine basis (DCT-II) over the tokens of each clip of a batch."""

    basis: Float[Tensor, "B K S"]  # orthonormal over the clip's tokens, zero behind them
    shares: Float[Tensor, "B K L"]  # weight of the autocovariance at each lag in a wave's variance

    @staticmethod
    def of(valid: Bool[Tensor, "B S"], lags: int) -> "Waves":
        """The basis over the tokens before the end of each clip, of which at most `lags` exist."""
        basis, shares = cosine_waves(lags, valid.device)
        count, steps = valid.sum(1), valid.shape[1]
        return Waves(basis[count, :steps, :steps], shares[count, :steps])


class PrincipalAxes(nn.Module):
    """Principal axes of a token's features, and the autocovariance over tokens along each axis.

    Along each axis and wave the network is preconditioned as by Karras et al. 2022: its output, of
    unit variance, is scaled and added to the best linear estimate (Wiener 1949, with the tokens of
    a clip as a stationary sequence). `interaction.set_axes` fits axes and covariance.
    """

    axes: Tensor
    covariance: Tensor

    def __init__(self, numbers: int, count: int, lags: int) -> None:
        """Space for `count` axes; axes beyond the number of features stay zero."""
        super().__init__()
        self.register_buffer("axes", torch.zeros(count, numbers))
        self.register_buffer("covariance", torch.zeros(lags, count))

    def read(
        self, noisy: Float[Tensor, "B S N"], sigma: Float[Tensor, " B"], waves: Waves
    ) -> tuple[Float[Tensor, "B S C"], Float[Tensor, "B S C"]]:
        """Noisy coordinates along the axes, scaled to unit variance, and their Wiener estimate, in
        units of the clean standard deviation."""
        noise, variance = sigma[:, None, None].square(), self.covariance[0].clamp(LEAST_VARIANCE)
        places = noisy @ self.axes.T
        own = self._spectrum(waves)
        linear = waves.basis.mT @ (own / (own + noise) * (waves.basis @ places))
        return places / (variance + noise).sqrt(), linear / variance.sqrt()

    def write(
        self,
        linear: Float[Tensor, "B S C"],
        answer: Float[Tensor, "B S C"],
        sigma: Float[Tensor, " B"],
        waves: Waves,
    ) -> Float[Tensor, "B S N"]:
        """Clean features from the estimate of `read` and the network's output of unit variance."""
        noise, own = sigma[:, None, None], self._spectrum(waves)
        left = noise * (own / (own + noise.square())).sqrt()
        more = waves.basis.mT @ (left * (waves.basis @ answer))
        return (linear * self.covariance[0].clamp(LEAST_VARIANCE).sqrt() + more) @ self.axes

    def _spectrum(self, waves: Waves) -> Float[Tensor, "B K C"]:
        return (waves.shares @ self.covariance).clamp(LEAST_VARIANCE)


@cache
def cosine_waves(
    most: int, device: torch.device
) -> tuple[Float[Tensor, "N most most"], Float[Tensor, "N most most"]]:
    """For 0 to `most` tokens: orthonormal cosine waves, and the shares of lags in their variances.

    The variance of a wave is the sum of its shares times the autocovariances at lags 0, 1, ...
    """
    place = torch.arange(most, dtype=torch.float64, device=device)
    count = torch.arange(most + 1, dtype=torch.float64, device=device)[:, None, None]
    waves = torch.cos(torch.pi / count.clamp(min=1) * (place + 0.5) * place[:, None])
    waves = torch.where((place < count) & (place[:, None] < count), waves, 0.0)
    basis = waves / waves.norm(dim=-1, keepdim=True).clamp(min=1e-9)
    power = torch.fft.rfft(basis, 2 * most).abs().square()
    shares = torch.fft.irfft(power, 2 * most)[..., :most]  # autocorrelation of a wave
    shares[..., 1:] *= 2
    return basis.float(), shares.float()


def axes_of_most_variance(values: Float[Tensor, "N D"]) -> Float[Tensor, "D D"]:
    """Principal axes of values around zero, not their mean, as unit rows by falling variance."""
    _, axes = torch.linalg.eigh(values.double().T @ values.double())
    return axes.T.flip(0).to(values)
