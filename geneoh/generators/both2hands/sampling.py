"""From moving bodies and sentences to hands: BOTH2Hands as a whole (paper, figure 3).

The reverse process of both networks, blended, over windows of the clips.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.body.motion import BodyMotion, pose
from geneoh.body.skeleton import BODY_JOINTS, Skeleton
from geneoh.choices import STEPS
from geneoh.generators.both2hands.features import (
    HANDS,
    PlacedBodies,
    placed,
    with_fingers,
    with_other_fingers,
)
from geneoh.generators.both2hands.library import Both2HandsNetworks
from geneoh.generators.both2hands.limits import within_limits
from geneoh.generators.both2hands.networks import EncodedBody, HandsDenoiser
from geneoh.generators.both2hands.windows import FRAMES, ClipWindows
from geneoh.generators.sampling import Answer, Sampler, from_noise, smoothed_clips
from geneoh.nn.checkpoint import finite_output
from geneoh.progress import OnStep

Branch = Literal["blended", "body", "text"]
"""Which networks make the hands: both, blended, or one alone for comparison."""


@dataclass(frozen=True)
class Both2HandsSampling:
    """How hands are drawn from the networks."""

    sampler: Sampler = "multistep"
    steps: int = STEPS  # denoising steps (paper: 1,000 ancestral ones)
    branch: Branch = "blended"
    guidance: float = 2.5
    """Guidance scale of every step: 1 takes the blended prediction (paper); more extrapolates
    beyond it, away from the body's prediction, so that the sentence counts more."""
    smoothing: float = 1.5
    """Standard deviation in frames of the final Gaussian over hands of the frame "wrist"; 0 for
    none (paper). It removes jitter, and next to nothing of a clap or a wave."""


@dataclass(frozen=True)
class Process:
    """The reverse process over windows of clips."""

    networks: Both2HandsNetworks
    windows: ClipWindows
    scene: PlacedBodies
    conditions: tuple[EncodedBody, EncodedBody]  # conditions of the body's and of the text network
    config: Both2HandsSampling
    generator: torch.Generator
    on_step: OnStep | None

    def hands(self) -> Float[Tensor, "B T 270"]:
        """Hands on the bodies, normalised as in the body's network."""
        if self.config.branch == "body":
            return self.of_body()
        if self.config.branch == "text":
            return self.of_text()
        blend = self.networks.blend
        if blend.config.form == "ours":
            return self.run(self.networks.body, self.blended)
        found, other = self.of_body(), self.windows.cut(self.of_text())
        for _ in range(blend.config.repeats):
            before = self.windows.cut(found)
            found = self.windows.join(blend(before, other, before.new_zeros(len(before))))
        return found

    def of_body(self) -> Float[Tensor, "B T 270"]:
        """Hands that the network of the body makes alone."""
        network = self.networks.body
        return self.run(network, lambda x, level: network.denoised(x, level, self.conditions[0]))

    def of_text(self) -> Float[Tensor, "B T 270"]:
        """Hands that the network of the sentence makes alone, brought onto the bodies."""
        network = self.networks.text
        found = self.run(network, lambda x, level: network.denoised(x, level, self.conditions[1]))
        found = self.networks.on_bodies(self.windows.cut(found), self.scene)
        return self.windows.join(found)

    def blended(
        self, x: Float[Tensor, "W F 270"], level: Float[Tensor, " W"]
    ) -> Float[Tensor, "W F 270"]:
        """Predictions of both networks for the same noisy hands, blended and with guidance."""
        answers = self.networks.answers((x, x), level, self.conditions, self.scene)
        found = self.networks.blend(*answers, level)
        return torch.lerp(answers[0], found, self.config.guidance)

    def run(self, network: HandsDenoiser, answer: Answer) -> Float[Tensor, "B T 270"]:
        """Hands from noise by the denoiser `answer`, which one network or several make up."""

        def clean(x: Tensor, level: Tensor) -> Tensor:
            noisy = self.windows.cut(x)
            found = answer(noisy, level.expand(len(noisy)))
            if network.config.scaling == "range":  # as the paper's code does
                found = found.clamp(-1, 1)
            return self.windows.join(found)

        count = len(self.scene.motion.root) // len(self.windows.starts)
        return from_noise(
            clean,
            (count, self.windows.frames, HANDS),
            network.sigmas,
            sampler=self.config.sampler,
            steps=self.config.steps,
            generator=self.generator,
            on_step=self.on_step,
        )


@torch.no_grad()
def sample_hands(
    networks: Both2HandsNetworks,
    motion: BodyMotion,
    skeleton: Skeleton,
    sentences: Sequence[str],
    config: Both2HandsSampling,
    *,
    generator: torch.Generator,
    on_step: OnStep | None = None,
) -> BodyMotion:
    """B bodies with fingers that fit their motion and one sentence each.

    `motion` has any number of frames at 30 frames a second, on the device of the networks; its
    fingers are ignored. `skeleton` is one for all bodies, or one for each.

    Raises:
        CheckpointError: the networks return NaN, as damaged weights do.
    """
    count, frames = motion.root.shape[:2]
    body, device = networks.body, motion.root.device
    # a clip that is shorter than a window is padded with its last frame
    padded = motion[torch.arange(max(frames, FRAMES), device=device).clamp(max=frames - 1)]
    moved = placed(padded, body.config.frame)
    windows = ClipWindows.of(moved.root.shape[1])
    skeletons = Skeleton(skeleton.offsets.to(device).expand(count, -1, -1))
    scene = PlacedBodies.of(skeletons.map(windows.repeat), moved.map(windows.cut))
    text = windows.repeat(networks.speech(sentences).to(device))
    conditions = body.encode(scene.body), networks.text.encode(text)
    process = Process(networks, windows, scene, conditions, config, generator, on_step)
    features = body.scale.denormalise(finite_output(process.hands()))
    if body.config.frame == "wrist":
        features = smoothed_clips(features, config.smoothing)
    made = with_fingers(moved, pose(skeletons, moved), features, body.config.frame)
    return with_other_fingers(motion, made.rotations[:, :frames, BODY_JOINTS:])


def generate_hands(
    motion: BodyMotion,
    skeleton: Skeleton,
    sentence: str,
    *,
    steps: int = STEPS,
    generator: torch.Generator,
    networks: Both2HandsNetworks,
    on_step: OnStep | None = None,
) -> BodyMotion:
    """One body with fingers inside joint limits; see `sample_hands` and `check_sentence`."""
    made = sample_hands(
        networks,
        BodyMotion(motion.root[None], motion.rotations[None]),
        skeleton,
        [sentence],
        Both2HandsSampling(steps=steps),
        generator=generator,
        on_step=on_step,
    )
    made = BodyMotion(made.root[0], made.rotations[0])
    return with_other_fingers(made, within_limits(made.rotations[:, BODY_JOINTS:]))
