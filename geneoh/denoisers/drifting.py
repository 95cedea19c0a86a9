"""Drift of a tracker: temporary motion of a hand over an object that it holds is taken as error.

A hand that holds an object keeps its position on it within a few millimetres. If it seems to move
further within half a second, the tracker drifts: in all directions, or along the camera ray. The
drift is modelled as a Gaussian process, with several candidate sizes. The result is the mean of
their posterior means, weighted by the likelihood of each size, so that a hand which keeps its
position is hardly changed.
"""

from collections.abc import Iterator

import torch
from jaxtyping import Float, Float64
from torch import Tensor

from geneoh.denoisers.holding import HeldPlace

OWN, OWN_FRAMES = 0.002, 60.0
"""Real sliding of a hand over the object: standard deviation per axis, metres, and correlation
time, frames."""
QUICK, QUICK_FRAMES = 0.003, 2.0
"""Standard deviation and correlation time of quick real sliding, which is not removed."""
ERROR_FRAMES = 10.0
"""Correlation time of the drift, frames."""
SIZES = (0.0, 0.003, 0.006, 0.01)
"""Candidate standard deviations per axis of the drift of the whole hand, metres."""
RAY_SIZES = (0.0, 0.005, 0.01)
"""Candidate standard deviations of additional drift along the camera ray, if known, metres."""
LOOSE_HOLD, LEAST_HELD = 0.02, 1e-6
"""Standard deviation of the position of a hand that holds the object with probability 0.5, metres;
and the lower bound of this probability, which keeps the variance of a free hand finite."""
FAR_FROM_MEDIAN = 0.025
"""Distance from the median position on the object, metres, at which a frame loses half its weight:
the hand holds the object elsewhere, as one that screws a lid or takes the object in another way, or
the object's pose is wrong."""
FITTED_EVERY = 3
"""Every third frame enters the Gaussian process."""


def drift(
    held: HeldPlace, noise: Float[Tensor, "B 1"], ray: Float[Tensor, "B T 3"] | None = None
) -> Float[Tensor, "B T 3"]:
    """The drift of each hand in each frame, world frame, metres.

    Args:
        held: position of the centre of each hand on the part of the object that it holds.
        noise: mean square displacement of `held.place` by noise of the object's poses, m^2.
        ray: unit direction from the camera to the hand, world frame; None if unknown.
    """
    frames = torch.arange(held.place.shape[1], device=held.place.device).double()
    some = slice(None, None, FITTED_EVERY)
    place, turn, sure = (x[:, some].double() for x in (held.place, held.rotation, held.sure))
    apart = (frames[:, None] - frames[some]).abs()
    alike = torch.exp(-apart / ERROR_FRAMES)
    own = OWN**2 * torch.exp(-apart[some] / OWN_FRAMES)
    own = own + QUICK**2 * torch.exp(-apart[some] / QUICK_FRAMES)
    usual = torch.where(sure[..., None] > 0.5, place, torch.nan).nanmedian(1, keepdim=True).values
    away = (place - usual).nan_to_num().norm(dim=-1)
    sure = (sure / (1 + (away / FAR_FROM_MEDIAN).pow(8))).clamp(min=LEAST_HELD)
    unsure = LOOSE_HOLD**2 * (1 / sure - 1) + noise.double() / 3
    steady = _flat((own + torch.diag_embed(unsure))[:, :, None, :, None] * _axes(turn)[:, None])
    found, likely = [], []
    for ways in _ways_to_drift(held, ray):
        seen = turn.mT @ ways[:, some]
        drifting = _flat(torch.einsum("baik,ac,bcjk->baicj", seen, alike[some], seen))
        weight, probability = _explained(place, steady + drifting)
        amount = torch.einsum("ta,baik,bai->btk", alike, seen, weight)
        found.append((ways @ amount[..., None])[..., 0])
        likely.append(probability)
    shares = torch.softmax(torch.stack(likely), dim=0)[..., None, None]
    # a hand that never holds the object has exactly zero drift
    shares = shares * (held.sure > 0).any(1)[:, None, None]
    return (shares * torch.stack(found)).sum(0).to(held.place)


def _ways_to_drift(
    held: HeldPlace, ray: Float[Tensor, "B T 3"] | None
) -> Iterator[Float64[Tensor, "B T 3 K"]]:
    """Candidate drifts: factors (K columns) of their covariance in the world frame, metres."""
    axes = _axes(held.place).expand(*held.place.shape[:2], 3, 3)
    for size in SIZES:
        if ray is None:
            yield size * axes
            continue
        for along in RAY_SIZES:
            yield torch.cat([size * axes, along * ray.double()[..., None]], dim=-1)


def _explained(
    place: Float64[Tensor, "B N 3"], covariance: Float64[Tensor, "B M M"]
) -> tuple[Float64[Tensor, "B N 3"], Float64[Tensor, " B"]]:
    """Gaussian process with unknown constant mean over N positions, M = 3N.

    Returns the inverse covariance times the residual of the positions from the estimated mean, and
    the log marginal likelihood up to a constant."""
    root = torch.linalg.cholesky(covariance)
    mean = _axes(place).repeat(place.shape[1], 1).expand(len(place), -1, 3)
    flat = place.flatten(1)[..., None]
    of_mean, of_place = (torch.cholesky_solve(x, root) for x in (mean, flat))
    known = mean.mT @ of_mean
    weight = of_place - of_mean @ torch.linalg.solve(known, mean.mT @ of_place)
    spread = root.diagonal(dim1=-2, dim2=-1).log().sum(-1) + 0.5 * torch.logdet(known)
    return weight.view_as(place), -spread - 0.5 * (flat * weight).sum((1, 2))


def _flat(covariance: Float64[Tensor, "B N 3 N 3"]) -> Float64[Tensor, "B M M"]:
    """The covariance as M x M matrices, M = 3N."""
    return covariance.flatten(3).flatten(1, 2)


def _axes(beside: Tensor) -> Float64[Tensor, "3 3"]:
    """The 3 x 3 identity, on the device of a tensor."""
    return torch.eye(3, dtype=torch.float64, device=beside.device)
