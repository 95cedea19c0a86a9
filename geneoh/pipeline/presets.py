"""The presets: every choice that separates the paper's method from the best we have."""

from dataclasses import dataclass, replace
from typing import Literal

from typing_extensions import assert_never

from geneoh.diffusion.samplers import SamplerName
from geneoh.fitting.adam import AdamFitConfig
from geneoh.fitting.align import AlignConfig
from geneoh.fitting.fit import FitConfig

PresetName = Literal["default", "paper", "fast"]
Selection = Literal["closest", "mean"]


@dataclass(frozen=True)
class StagePlan:
    """How one stage denoises via diffusion."""

    level: int
    """Level of the 1000-step schedule that the input is noised to."""
    steps: int
    """Denoiser calls on the way back."""
    sampler: SamplerName = "ddim"


@dataclass(frozen=True)
class Preset:
    """All stages, the selection among samples and the fit."""

    motion: StagePlan
    spatial: StagePlan
    temporal: StagePlan
    observed: bool
    """Whether the networks see the observation, or only start from it as in the paper."""
    samples: int
    """Diffusion chains drawn when the user names no number."""
    selection: Selection
    """Which of them is kept: the paper keeps the one closest to the input; the mean of a few is
    nearer to the truth than any one of them."""
    align: AlignConfig
    correct: bool
    """Temporal stage: apply the change the denoiser makes to the decoded relations (True) or aim at
    the decoded relations themselves as in the paper (False)."""
    fit: FitConfig | AdamFitConfig
    contact: bool
    """Whether the fit keeps the mesh out of the object."""

    def with_steps(self, steps: int) -> "Preset":
        """The preset with another number of denoiser calls per stage, never above its level."""
        return replace(
            self,
            **{
                stage: replace(plan, steps=min(steps, plan.level))
                for stage, plan in (
                    ("motion", self.motion),
                    ("spatial", self.spatial),
                    ("temporal", self.temporal),
                )
            },
        )


def preset(name: PresetName) -> Preset:
    """The settings that a preset's name stands for."""
    match name:
        case "paper":
            return Preset(
                motion=StagePlan(400, 400, "ancestral"),
                spatial=StagePlan(200, 200, "ancestral"),
                temporal=StagePlan(100, 100, "ancestral"),
                observed=False,
                samples=1,
                selection="closest",
                align=AlignConfig(steps=100),
                correct=False,
                fit=AdamFitConfig(),
                contact=False,
            )
        case "default":
            return Preset(
                motion=StagePlan(200, 8),
                spatial=StagePlan(100, 6),
                temporal=StagePlan(100, 6),
                observed=True,
                samples=4,
                selection="mean",
                align=AlignConfig(),
                correct=True,
                fit=FitConfig(),
                contact=True,
            )
        case "fast":
            quick = preset("default").with_steps(3)
            return replace(
                quick,
                samples=1,
                align=AlignConfig(steps=10, rate=2e-3),
                fit=FitConfig(iterations=5, contact_rounds=2),
            )
        case _:
            assert_never(name)
