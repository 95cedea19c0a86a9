"""The presets: every choice that separates the paper's method from the best we have."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from typing_extensions import assert_never

from geneoh.choices import Ablation, PresetName, Selection
from geneoh.diffusion.samplers import SamplerName
from geneoh.fitting.adam import AdamFitConfig
from geneoh.fitting.align import AlignConfig
from geneoh.fitting.fit import KEYPOINTS_ALONE, FitConfig


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

    motion: StagePlan | None
    """None leaves a stage out."""
    spatial: StagePlan | None
    temporal: StagePlan | None
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
    canonical: bool = True
    """Whether the stages see the hand from the contact points' frame, or from a still one."""

    def with_steps(self, steps: int) -> "Preset":
        """The preset with another number of denoiser calls per stage, never above its level."""
        return self._with_plans(lambda plan: replace(plan, steps=min(steps, plan.level)))

    def without(self, part: Ablation) -> "Preset":
        """The preset with one of its parts left out, to see what that part is worth."""
        match part:
            case "motion" | "spatial" | "temporal":
                return replace(self, **{part: None})
            case "canonical":
                return replace(self, canonical=False)
            case "diffusion":
                return self._with_plans(lambda plan: replace(plan, sampler="direct"))
            case "fit":
                return replace(self, fit=KEYPOINTS_ALONE, contact=False)
            case _:
                assert_never(part)

    def _with_plans(self, changed: Callable[[StagePlan], StagePlan]) -> "Preset":
        plans = {"motion": self.motion, "spatial": self.spatial, "temporal": self.temporal}
        kept = {stage: changed(plan) for stage, plan in plans.items() if plan is not None}
        return replace(self, **kept)


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
                # starting lower counts the observation twice; more steps leave more of the noise
                motion=StagePlan(650, 4),
                spatial=StagePlan(200, 3),
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
