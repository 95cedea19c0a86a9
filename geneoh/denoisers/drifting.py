"""An error that drifts: what comes and goes over the object that a hand holds is taken for one.

A hand that holds an object keeps its place on it but for a few millimetres. Where it seems to
wander further, within half a second, the estimate of its place wanders: as a whole, or along the
ray of the camera. Under each of some sizes of the error the wandering that is seen has a
probability (as a Gaussian process), and the answer is the mean of all by these, so that a hand
which keeps its place is left alone.
"""

from collections.abc import Iterator

import torch
from jaxtyping import Float, Float64
from torch import Tensor

from geneoh.denoisers.holding import HeldPlace

OWN, OWN_FRAMES = 0.002, 60.0
"""Deviation along each axis of a hand's own sliding over what it holds, metres, and the frames over
which it stays alike."""
QUICK, QUICK_FRAMES = 0.003, 2.0
"""The same of quicker sliding, which is left as it is."""
DRIFT_FRAMES = 10.0
"""Frames over which an error that drifts stays alike."""
SIZES = (0.0, 0.003, 0.006, 0.01)
"""Deviations along each axis that are tried for the error of the whole hand, metres."""
RAY_SIZES = (0.0, 0.005, 0.01)
"""The same along the ray of the camera, where it is known."""
LOOSE, LEAST_HELD = 0.02, 1e-6
"""Deviation of the place of a hand that is as surely free as it holds the object, metres; and how
surely it holds it at least, so that one that is free tells nothing, but is a number."""
FAR = 0.04
"""Distance from its usual place on the object from which on a hand is taken for one that holds it
elsewhere, or the object's pose for a wrong one, metres."""
EVERY = 3
"""Frames from one that is looked at to the next."""


def drift(
    held: HeldPlace, noise: Float[Tensor, "B 1"], ray: Float[Tensor, "B T 3"] | None = None
) -> Float[Tensor, "B T 3"]:
    """The error of each hand's place that drifts, in each frame, world frame, metres.

    Args:
        held: where the middle of each hand is on the part of the object that it holds.
        noise: mean square distance by which noise of the object moves it there, square metres.
        ray: unit direction from the camera to the hand, world; None where it is not known.
    """
    frames = torch.arange(held.place.shape[1], device=held.place.device).double()
    some = slice(None, None, EVERY)
    place, turn, sure = (x[:, some].double() for x in (held.place, held.rotation, held.sure))
    apart = (frames[:, None] - frames[some]).abs()
    alike = torch.exp(-apart / DRIFT_FRAMES)
    own = OWN**2 * torch.exp(-apart[some] / OWN_FRAMES)
    own = own + QUICK**2 * torch.exp(-apart[some] / QUICK_FRAMES)
    usual = torch.where(sure[..., None] > 0.5, place, torch.nan).nanmedian(1, keepdim=True).values
    away = (place - usual).nan_to_num().norm(dim=-1)
    sure = (sure / (1 + (away / FAR).pow(8))).clamp(min=LEAST_HELD)
    unsure = LOOSE**2 * (1 / sure - 1) + noise.double() / 3
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
    # where nothing is held at all there is none, to the last bit
    shares = shares * (held.sure > 0).any(1)[:, None, None]
    return (shares * torch.stack(found)).sum(0).to(held.place)


def _ways_to_drift(
    held: HeldPlace, ray: Float[Tensor, "B T 3"] | None
) -> Iterator[Float64[Tensor, "B T 3 K"]]:
    """The errors that are tried: K vectors of the world, of as many independent parts of each."""
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
    """Places as a Gaussian process around a mean that is not known, M = 3N: what the inverse of the
    covariance makes of them, and the logarithm of their probability up to a constant."""
    root = torch.linalg.cholesky(covariance)
    mean = _axes(place).repeat(place.shape[1], 1).expand(len(place), -1, 3)
    flat = place.flatten(1)[..., None]
    of_mean, of_place = (torch.cholesky_solve(x, root) for x in (mean, flat))
    known = mean.mT @ of_mean
    weight = of_place - of_mean @ torch.linalg.solve(known, mean.mT @ of_place)
    spread = root.diagonal(dim1=-2, dim2=-1).log().sum(-1) + 0.5 * torch.logdet(known)
    return weight.view_as(place), -spread - 0.5 * (flat * weight).sum((1, 2))


def _flat(covariance: Float64[Tensor, "B N 3 N 3"]) -> Float64[Tensor, "B M M"]:
    """The covariance of M = 3N numbers."""
    return covariance.flatten(3).flatten(1, 2)


def _axes(beside: Tensor) -> Float64[Tensor, "3 3"]:
    """The identity, on the device of a tensor."""
    return torch.eye(3, dtype=torch.float64, device=beside.device)
