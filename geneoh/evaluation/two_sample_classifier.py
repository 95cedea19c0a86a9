"""Can a classifier tell one source of snippets from another? Half right means that it cannot.

Logistic regression on snippets of keypoints, each class of equal weight. Snippets of one recording
overlap, so it is cut into blocks: a fold tests on one block and learns on the others, and no
snippet crosses a border. Of the other source each clip gives one snippet and is in one fold.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
import torch
from jaxtyping import Bool, Float
from scipy.optimize import minimize
from torch import Tensor
from typing_extensions import assert_never

from geneoh.evaluation.distributions import (
    INDEX,
    PINKY,
    WRIST,
    point_acceleration,
    speed,
)

SNIPPET = 30
"""Frames of a snippet: one second."""
BLOCK = 36
"""Frames of a block."""
KEPT = 3
"""Every third frame is a feature: neighbours say nearly the same."""
RIDGE = 1e-3
"""Weight of the squared coefficients against the mean loss, for features of unit length."""
STILL = 1e-3
"""Added to speeds and accelerations before their logarithm, metres per second (squared)."""

View = Literal["place", "hand", "motion"]
VIEWS: tuple[View, ...] = ("place", "hand", "motion")


@dataclass(frozen=True)
class Telling:
    """How well one source is told from another on snippets that were not learned from."""

    accuracy: float
    """Mean of the two classes' shares that were told right; a half is chance."""
    snippets: tuple[int, int]
    """How many of either class were tested."""


def features(snippets: Float[Tensor, "N S 21 3"], view: View, fps: float) -> Float[Tensor, "N D"]:
    """What the classifier sees of snippets in the object's frame.

    "place" is the keypoints as they are; "hand" the keypoints in the frame of the palm at the
    snippet's middle, which does not tell where on the object the hand is; "motion" the logarithms
    of each keypoint's mean speed and acceleration.
    """
    match view:
        case "place":
            return snippets[:, ::KEPT].flatten(1)
        case "hand":
            middle = snippets[:, snippets.shape[1] // 2]
            local = snippets - middle[:, None, WRIST, None]
            return (local @ palm_axes(middle)[:, None])[:, ::KEPT].flatten(1)
        case "motion":
            moved = [measure(snippets, fps).mean(1) for measure in (speed, point_acceleration)]
            return (torch.cat(moved, dim=-1) + STILL).log()
        case _:
            assert_never(view)


def palm_axes(joints: Float[Tensor, "*B 21 3"]) -> Float[Tensor, "*B 3 3"]:
    """Axes of the palm as columns: to the index finger's base, across, and the palm's normal."""
    index = joints[..., INDEX, :] - joints[..., WRIST, :]
    pinky = joints[..., PINKY, :] - joints[..., WRIST, :]
    normal = torch.linalg.cross(index, pinky)
    axes = [index, torch.linalg.cross(normal, index), normal]
    return torch.stack([torch.nn.functional.normalize(axis, dim=-1) for axis in axes], dim=-1)


def block_snippets(
    joints: Float[Tensor, "T 21 3"], usable: Bool[Tensor, " T"]
) -> list[Float[Tensor, "N S 21 3"]]:
    """All snippets of one recording, block by block; blocks without a usable one are left out."""
    found = []
    for start in range(0, len(joints) - BLOCK + 1, BLOCK):
        block, fine = joints[start : start + BLOCK], usable[start : start + BLOCK]
        windows = block.unfold(0, SNIPPET, 1).permute(0, 3, 1, 2)
        kept = windows[fine.unfold(0, SNIPPET, 1).all(-1)]
        if len(kept):
            found.append(kept)
    return found


def tell_apart(
    blocks: list[Float[Tensor, "N S 21 3"]],
    others: Float[Tensor, "M S 21 3"],
    view: View,
    fps: float,
) -> Telling:
    """Accuracy over the folds: one per block.

    Args:
        blocks: snippets of the one recording; at least two blocks.
        others: snippets of the other source, one per clip.
        view: what the classifier sees.
        fps: frames a second.
    """
    assert len(blocks) > 1, "a fold needs a block to learn on and one to test on"
    assert len(others) >= len(blocks), "every fold tests on some of the others"
    one = [features(block, view, fps).double().numpy() for block in blocks]
    rest = features(others, view, fps).double().numpy()
    fold_of_rest = np.arange(len(rest)) % len(blocks)
    right: tuple[list[bool], list[bool]] = ([], [])
    for fold, block in enumerate(one):
        learned = np.concatenate([each for i, each in enumerate(one) if i != fold])
        model = fit_logistic(learned, rest[fold_of_rest != fold])
        right[0].extend(model.score(block) > 0)
        right[1].extend(model.score(rest[fold_of_rest == fold]) <= 0)
    shares = [float(np.mean(told)) for told in right]
    return Telling(sum(shares) / 2, (len(right[0]), len(right[1])))


@dataclass(frozen=True)
class Logistic:
    """A fitted logistic regression."""

    mean: Float[np.ndarray, " D"]
    scale: Float[np.ndarray, " D"]
    weight: Float[np.ndarray, " D"]
    bias: float

    def score(self, values: Float[np.ndarray, "N D"]) -> Float[np.ndarray, " N"]:
        """Above zero for the first class."""
        return (values - self.mean) / self.scale @ self.weight + self.bias


def fit_logistic(first: Float[np.ndarray, "N D"], second: Float[np.ndarray, "M D"]) -> Logistic:
    """Ridge-penalised logistic regression; both classes weigh the same, however many there are."""
    values = np.concatenate([first, second])
    mean = (first.mean(0) + second.mean(0)) / 2
    # features of unit length on average, so that the ridge does not depend on their number
    scale = (values.std(0) + 1e-9) * np.sqrt(values.shape[1])
    x = (values - mean) / scale
    sign = np.repeat([1.0, -1.0], [len(first), len(second)])
    share = np.repeat([0.5 / len(first), 0.5 / len(second)], [len(first), len(second)])

    def loss(unknown: Float[np.ndarray, " U"]) -> tuple[float, Float[np.ndarray, " U"]]:
        weight, bias = unknown[:-1], unknown[-1]
        margin = sign * (x @ weight + bias)
        wrong = share * sign / (1 + np.exp(np.clip(margin, -500, 500)))
        value = share @ np.logaddexp(0, -margin) + RIDGE / 2 * weight @ weight
        return value, np.append(RIDGE * weight - wrong @ x, -wrong.sum())

    found = minimize(loss, np.zeros(x.shape[1] + 1), jac=True, method="L-BFGS-B").x
    return Logistic(mean, scale, found[:-1], float(found[-1]))
