"""The presets: all settings in which the paper's method and our own differ."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from typing_extensions import assert_never

from geneoh.choices import Ablation, PresetName, Selection
from geneoh.diffusion.samplers import SamplerName
from geneoh.fitting.adam import AdamFitConfig
from geneoh.fitting.fit_config import KEYPOINTS_ALONE, FitConfig

MOST_ROUNDS = 20  # upper bound of SpatialDiff's rounds; it converges after the first few


@dataclass(frozen=True)
class StagePlan:
    """Settings of the diffusion of one stage."""

    level: int  # noise level to which the input is diffused, 1 to 1000 of the schedule
    steps: int  # denoiser calls from that level down to a clean sample
    sampler: SamplerName = "ddim"
    chains: int = 1  # chains per window in the paper's MotionDiff
    kept: Selection = "closest"  # chain that is kept: the closest to the input, or their mean

    @property
    def calls(self) -> int:
        """Denoiser calls that the sampler makes."""
        return 1 if self.sampler == "direct" else self.steps

    def with_steps(self, steps: int) -> "StagePlan":
        """The plan with another number of denoiser calls, at most its level."""
        return replace(self, steps=min(steps, self.level))

    def without_diffusion(self) -> "StagePlan":
        """The plan with a single denoiser call instead of diffusion, for an ablation."""
        return replace(self, sampler="direct")


@dataclass(frozen=True)
class PlacePlan:
    """Settings of SpatialDiff in our form, which estimates a shift of the hand."""

    places: int  # trial shifts per window and round
    steps: int = 4  # rounds of importance sampling, each around the probable shifts of the last
    frames: int | None = None  # input frames per window; None for as many as in training
    sliding: bool = True
    """Whether sliding over a held object makes a shift less probable (`geneoh.denoisers.sliding`),
    and drift over the object is removed (`geneoh.denoisers.drifting`)."""

    def with_steps(self, steps: int) -> "PlacePlan":
        """The plan with another number of rounds, at most `MOST_ROUNDS`."""
        return replace(self, steps=min(steps, MOST_ROUNDS))

    def without_diffusion(self) -> "PlacePlan":
        """The plan with a single round, for an ablation."""
        return replace(self, steps=1)


@dataclass(frozen=True)
class DirectPlan:
    """A stage of one network call, without settings."""


Plan = PlacePlan | StagePlan


@dataclass(frozen=True)
class Preset:
    """Settings of all stages, of the selection among samples and of the fit."""

    motion: StagePlan | None  # None leaves the stage out
    spatial: PlacePlan | StagePlan | None  # `StagePlan`: the paper's form, on contact points
    temporal: StagePlan | DirectPlan | None  # `StagePlan`: the paper's form, on a latent
    observed: bool
    """Whether the networks are conditioned on the input, or only start from it as in the paper."""
    samples: int  # number of diffusion chains, unless the user chooses another
    selection: Selection
    """Which sample is kept, and in the preset `paper` which chain. The paper keeps the one closest
    to the input; the mean of a few is nearer to the truth than any one of them."""
    fit: FitConfig | AdamFitConfig
    contact: bool  # whether the fit removes penetration of the object
    apart: bool = True  # whether penetration between two hands is removed
    canonical: bool = True
    """Whether the canonical frame moves with the contact points; False, for an ablation, fixes it
    in the world frame."""
    clean_object: bool = True
    """Whether noisy object poses are smoothed before the stages, and a mesh is left out in which
    fingers stay deep."""
    camera_told: bool = True
    """Whether the stages get the camera ray that the sequence contains."""
    camera_found: bool = True  # whether a missing camera ray is estimated from the hand's noise
    has_object: bool = True  # False cleans the hand by the prior of motion alone

    def with_steps(self, steps: int) -> "Preset":
        """The preset with another number of calls or rounds per stage; see the plans' limits."""
        return self._with_plans(lambda plan: plan.with_steps(steps))

    def alone(self) -> "Preset":
        """The preset for a hand without an object: without the parts that need a surface."""
        return replace(
            self, spatial=None, temporal=None, contact=False, clean_object=False, has_object=False
        )

    def without(self, part: Ablation) -> "Preset":
        """The preset with one of its parts left out, to measure what the part contributes."""
        match part:
            case "motion" | "spatial" | "temporal":
                return replace(self, **{part: None})
            case "sliding" if isinstance(self.spatial, PlacePlan):
                return replace(self, spatial=replace(self.spatial, sliding=False))
            case "sliding":
                return self
            case "canonical":
                return replace(self, canonical=False)
            case "diffusion":
                return self._with_plans(lambda plan: plan.without_diffusion())
            case "fit":
                return replace(self, fit=KEYPOINTS_ALONE, contact=False, apart=False)
            case "object":
                return replace(self, clean_object=False)
            case "camera":
                return replace(self, camera_told=False, camera_found=False)
            case "told-camera":
                return replace(self, camera_told=False)
            case "mesh":
                return self.alone()
            case _:
                assert_never(part)

    def _with_plans(self, changed: Callable[[Plan], Plan]) -> "Preset":
        plans = {"motion": self.motion, "spatial": self.spatial, "temporal": self.temporal}
        chosen = {stage: changed(p) for stage, p in plans.items() if isinstance(p, Plan)}
        return replace(self, **chosen)


def preset(name: PresetName) -> Preset:
    """The settings of a named preset."""
    match name:
        case "paper":
            return Preset(
                motion=StagePlan(400, 400, "ancestral", chains=8, kept="mean"),
                spatial=StagePlan(200, 200, "ancestral"),
                temporal=StagePlan(100, 100, "ancestral"),
                observed=False,
                samples=1,
                selection="mean",
                fit=AdamFitConfig(),
                contact=False,
                apart=False,
                camera_found=False,  # the paper's networks do not use a camera ray
            )
        case "default":
            return Preset(
                # a lower level would use the input twice; more steps keep more of its noise
                motion=StagePlan(650, 4),
                spatial=PlacePlan(96),
                temporal=DirectPlan(),
                observed=True,
                samples=4,
                selection="mean",
                fit=FitConfig(),
                contact=True,
            )
        case "fast":
            return replace(
                preset("default"),
                motion=StagePlan(650, 1),  # a single sample is nearest to the mean with one step
                spatial=PlacePlan(64, steps=3, frames=6),
                samples=1,
                fit=FitConfig(iterations=3, contact_rounds=2),
            )
        case _:
            assert_never(name)
