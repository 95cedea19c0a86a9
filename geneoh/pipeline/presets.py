"""The presets: all settings in which the paper's method and our own differ."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from typing_extensions import assert_never

from geneoh.choices import Ablation, PresetName, Selection
from geneoh.diffusion.samplers import SamplerName
from geneoh.fitting.adam import AdamFitConfig
from geneoh.fitting.fit_config import KEYPOINTS_ALONE, FitConfig

MOST_ROUNDS = 20  # of SpatialDiff, which finds no better places after the first few


@dataclass(frozen=True)
class StagePlan:
    """Settings of the diffusion of one stage."""

    level: int  # noise level that the input is brought to, 1 to 1000 of the schedule
    steps: int  # denoiser calls from that level down to a clean sample
    sampler: SamplerName = "ddim"
    chains: int = 1  # of each window in the paper's MotionDiff; that closest to the input is kept

    @property
    def calls(self) -> int:
        """Denoiser calls that the sampler makes."""
        return 1 if self.sampler == "direct" else self.steps

    def with_steps(self, steps: int) -> "StagePlan":
        """The plan with another number of calls, never above its level."""
        return replace(self, steps=min(steps, self.level))

    def without_diffusion(self) -> "StagePlan":
        """The plan whose one call answers at once, for an ablation."""
        return replace(self, sampler="direct")


@dataclass(frozen=True)
class PlacePlan:
    """Settings of SpatialDiff where it asks for the place of the hand."""

    places: int  # trial places of each window in each round
    steps: int = 4  # rounds, each of which tries places where those before were probable
    frames: int | None = None  # of each window that are looked at; None for as many as in training
    sliding: bool = True
    """Whether a place over which the hand slides is less probable (`geneoh.denoisers.sliding`), and
    what comes and goes over the object is an error (`geneoh.denoisers.drifting`)."""

    def with_steps(self, steps: int) -> "PlacePlan":
        """The plan with another number of rounds, never above `MOST_ROUNDS`."""
        return replace(self, steps=min(steps, MOST_ROUNDS))

    def without_diffusion(self) -> "PlacePlan":
        """The plan whose one round answers at once, for an ablation."""
        return replace(self, steps=1)


@dataclass(frozen=True)
class DirectPlan:
    """A stage that answers in one call: it has nothing to choose."""


Plan = PlacePlan | StagePlan


@dataclass(frozen=True)
class Preset:
    """Settings of all stages, of the selection among samples and of the fit."""

    motion: StagePlan | None  # None leaves a stage out
    spatial: PlacePlan | StagePlan | None  # `StagePlan`: the paper's form, on contact points
    temporal: StagePlan | DirectPlan | None  # `StagePlan`: the paper's form, on a latent
    observed: bool
    """Whether the networks are shown the input, or only start from it as in the paper."""
    samples: int  # number of diffusion chains, unless the user chooses another
    selection: Selection
    """Which sample is kept. The paper keeps the one closest to the input; the mean of a few samples
    is nearer to the truth than any one of them."""
    fit: FitConfig | AdamFitConfig
    contact: bool  # whether the fit keeps the mesh out of the object
    apart: bool = True  # whether two hands are taken out of each other
    canonical: bool = True
    """Whether the canonical frame moves with the contact points; False, for an ablation, holds it
    still in the world."""
    clean_object: bool = True  # whether noisy poses are smoothed before hands are seen from them
    camera_told: bool = True
    """Whether the stages are shown the direction of the camera that the sequence knows."""
    camera_found: bool = True  # whether it is else looked for in the noise of the hand
    has_object: bool = True  # False cleans the hand by the prior of motion alone

    def with_steps(self, steps: int) -> "Preset":
        """The preset with another number of denoiser calls per stage, never above its level."""
        return self._with_plans(lambda plan: plan.with_steps(steps))

    def alone(self) -> "Preset":
        """The preset for a hand without an object: nothing that asks for its surface."""
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
    """The settings that a preset's name stands for."""
    match name:
        case "paper":
            return Preset(
                motion=StagePlan(400, 400, "ancestral", chains=8),
                spatial=StagePlan(200, 200, "ancestral"),
                temporal=StagePlan(100, 100, "ancestral"),
                observed=False,
                samples=1,
                selection="closest",
                fit=AdamFitConfig(),
                contact=False,
                apart=False,
                camera_found=False,  # its networks are shown no camera
            )
        case "default":
            return Preset(
                # from a lower level the input would count twice; more steps leave more of its noise
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
                motion=StagePlan(650, 1),  # one sample is nearest to the mean of many in one step
                spatial=PlacePlan(64, steps=3, frames=6),
                samples=1,
                fit=FitConfig(iterations=3, contact_rounds=2),
            )
        case _:
            assert_never(name)
