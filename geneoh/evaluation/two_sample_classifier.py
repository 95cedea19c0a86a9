"""A classifier two-sample test: an accuracy of 0.5 means that two sources cannot be distinguished.

The classifier is a logistic regression on snippets of keypoints, with equal weight for both
sources. Because the snippets of a recording overlap, it is cut into blocks for cross-validation:
each fold tests on one block and trains on the others, and no snippet crosses a block border. Each
clip of the other source contributes one snippet, which is tested in one fold.
"""

from typing import Literal

import numpy as np
import torch
from jaxtyping import Bool, Float
from scipy.optimize import minimize
from torch import Tensor
from typing_extensions import assert_never

from geneoh.evaluation.distributions import WRIST, motion_size, palm_basis

SNIPPET = 30  # frames of a snippet: one second at 30 frames a second
BLOCK = 36  # frames of a block: a snippet, and room for a few start frames
FRAME_STEP = 3  # only every third frame is used, because neighbours are nearly equal
RIDGE = 1e-3  # weight of the squared coefficients in the loss, for feature vectors of unit length
MOTION_FLOOR = 1e-3  # added to speeds (m/s) and accelerations (m/s²) against log(0)

View = Literal["place", "hand", "motion"]
VIEWS: tuple[View, ...] = ("place", "hand", "motion")


def features(snippets: Float[Tensor, "N S 21 3"], view: View, fps: float) -> Float[Tensor, "N D"]:
    """Features of snippets in the object's frame.

    "place": the keypoints; "hand": the keypoints in the palm frame of the snippet's middle frame,
    without the position of the hand on the object; "motion": the logarithms of each keypoint's mean
    speed and acceleration.
    """
    match view:
        case "place":
            return snippets[:, ::FRAME_STEP].flatten(1)
        case "hand":
            middle = snippets[:, snippets.shape[1] // 2]
            local = snippets - middle[:, None, WRIST, None]
            return (local @ palm_basis(middle)[:, None])[:, ::FRAME_STEP].flatten(1)
        case "motion":
            moved = [motion_size(snippets, fps, order).mean(1) for order in (1, 2)]
            return (torch.cat(moved, dim=-1) + MOTION_FLOOR).log()
        case _:
            assert_never(view)


def all_snippets(
    joints: Float[Tensor, "T 21 3"], usable: Bool[Tensor, " T"]
) -> Float[Tensor, "N S 21 3"]:
    """All snippets of a track whose frames are all usable, in the order of their first frames."""
    if len(joints) < SNIPPET:
        return joints.new_zeros(0, SNIPPET, 21, 3)
    windows = joints.unfold(0, SNIPPET, 1).permute(0, 3, 1, 2)
    return windows[usable.unfold(0, SNIPPET, 1).all(-1)]


def block_snippets(
    joints: Float[Tensor, "T 21 3"], usable: Bool[Tensor, " T"]
) -> list[Float[Tensor, "N S 21 3"]]:
    """The usable snippets of one recording by block; blocks without any are left out."""
    starts = range(0, len(joints) - BLOCK + 1, BLOCK)
    blocks = [slice(start, start + BLOCK) for start in starts]
    found = [all_snippets(joints[block], usable[block]) for block in blocks]
    return [snippets for snippets in found if len(snippets)]


def cross_validate(
    blocks: list[Float[Tensor, "N S 21 3"]],
    others: Float[Tensor, "M S 21 3"],
    view: View,
    fps: float,
) -> float:
    """Cross-validated accuracy of the classifier, the mean over both sources; 0.5 is chance.

    There is one fold for each of at least two blocks; `others` are snippets of the other source,
    one per clip.
    """
    assert len(blocks) > 1, "a fold needs a block to train on and one to test on"
    assert len(others) >= len(blocks), "every fold tests on some of the others"
    one = [features(block, view, fps).double().numpy() for block in blocks]
    rest = features(others, view, fps).double().numpy()
    fold_of_rest = np.arange(len(rest)) % len(blocks)
    right: tuple[list[bool], list[bool]] = ([], [])
    for fold, block in enumerate(one):
        trained_on = np.concatenate([each for i, each in enumerate(one) if i != fold])
        weights, bias = fit_logistic(trained_on, rest[fold_of_rest != fold])
        right[0].extend(block @ weights + bias > 0)
        right[1].extend(rest[fold_of_rest == fold] @ weights + bias <= 0)
    return sum(float(np.mean(each)) for each in right) / 2


def fit_logistic(
    first: Float[np.ndarray, "N D"], second: Float[np.ndarray, "M D"]
) -> tuple[Float[np.ndarray, " D"], float]:
    """Fit a logistic regression with a ridge penalty; both classes have the same total weight.

    Returns:
        weights and bias: `values @ weights + bias` is above zero for the first class.
    """
    values = np.concatenate([first, second])
    mean = (first.mean(0) + second.mean(0)) / 2
    # Feature vectors get unit length on average, so that the penalty does not depend on their size.
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
    weights = found[:-1] / scale
    return weights, float(found[-1] - mean @ weights)
