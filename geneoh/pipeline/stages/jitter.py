"""Remove the jitter that the networks leave in the samples of a noisy hand."""

from jaxtyping import Float
from torch import Tensor

from geneoh.baselines.filters import Filter, smooth
from geneoh.hand.skeleton import TIP_KEYPOINTS
from geneoh.objects.smoothing import noise_level
from geneoh.pipeline.stages.context import StageContext

QUIET, NOISY = 0.0015, 0.003
"""White noise of the observed fingertips per axis, metres: up to the first bound the samples are
unchanged, from the second on they are fully smoothed. Recorded hands have 0.0012."""
GENTLE = Filter("gaussian", 1.0)
"""Filter for a hand alone; its size is in frames."""
STEADY, SHAKY = 0.0006, 0.0012
"""The same bounds for the remaining noise of samples in the object frame, metres; the fingertips of
hands that hold have up to 0.0004."""
SHAPE_KEEPING = Filter("savgol", 7.0)
"""Filter for a hand that moves over its object; it keeps motion of up to 3 Hz."""


def without_jitter(
    samples: Float[Tensor, "S T 21 3"], observed: Float[Tensor, "T 21 3"], fps: float
) -> Float[Tensor, "S T 21 3"]:
    """Samples of a hand alone, smoothed in proportion to the white noise of the observed hand.

    Windows are denoised differently and no contact constrains the hand, so jitter remains in noisy
    inputs. Quiet inputs keep their motion.
    """
    share = share_of_jitter(observed, QUIET, NOISY)
    return samples + share * (_smoothed(samples, GENTLE, fps) - samples)


def without_jitter_over_object(
    context: StageContext, samples: Float[Tensor, "S T 21 3"], observed: Float[Tensor, "T 21 3"]
) -> Float[Tensor, "S T 21 3"]:
    """Samples of a hand with an object, smoothed where the observed and the cleaned hand jitter.

    MotionDiff is trained on hands that hold, and leaves half of the noise of a hand that moves fast
    over its object, such as one that wipes a table. Jitter is measured and removed in the object
    frame, in which a hand that holds rests, however fast both move.
    """
    turn, place = context.rotation[:, 0], context.translation[:, 0, None]
    local, seen = (samples - place) @ turn, (observed - place) @ turn
    if not (noisy := share_of_jitter(seen, QUIET, NOISY)):
        return samples
    left = [share_of_jitter(each, STEADY, SHAKY) for each in context.cut(local.mean(0), 0)]
    if not any(left):
        return samples
    share = context.blend(samples.new_tensor(left)[:, None, None].expand(-1, context.size, 1))
    change = _smoothed(local, SHAPE_KEEPING, context.fps) - local
    return samples + noisy * share[0, :, None] * change @ turn.mT


def share_of_jitter(joints: Float[Tensor, "T 21 3"], quiet: float, noisy: float) -> float:
    """White noise of the fingertips as a share: 0 up to `quiet`, 1 from `noisy` (metres per axis).

    Also 0 for fewer than five frames, from which it cannot be estimated.
    """
    if len(joints) < 5:
        return 0.0
    noise = noise_level(joints[:, list(TIP_KEYPOINTS)].cpu().double().numpy())
    return min(max((noise - quiet) / (noisy - quiet), 0.0), 1.0)


def _smoothed(
    samples: Float[Tensor, "S T 21 3"], by: Filter, fps: float
) -> Float[Tensor, "S T 21 3"]:
    return smooth(samples.movedim(1, 0), by, fps).movedim(0, 1)
