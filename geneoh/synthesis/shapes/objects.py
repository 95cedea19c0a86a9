"""Random graspable objects as `Solids`: of analytic families such as mugs, and scanned ones."""

import torch
from torch import Tensor

from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.synthesis.shapes.families import RIGID, UNUSED, Drawn, Shape, family_named
from geneoh.synthesis.shapes.scans import Scans
from geneoh.synthesis.shapes.solids import SCAN, SOLIDS, Solids

SCALES = (0.9, 1.1)  # range of the scale factor of a scanned object


def draw_objects(
    families: list[str], *, generator: torch.Generator, scans: Scans | None = None
) -> Solids:
    """One random object per name of a family or a scan, centred near the origin of its own frame.

    Scanned objects are scaled by a factor from `SCALES`.
    """
    numbers = {} if scans is None else {name: SCAN + n for n, name in enumerate(scans.names)}

    def uniform(low: float, high: float) -> float:
        return low + (high - low) * float(torch.rand((), generator=generator))

    drawn = [
        [Shape(numbers[name], (size := uniform(*SCALES), size, size), rounding=0.0)]
        if name in numbers
        else family_named(name)(uniform)
        for name in families
    ]
    return _solids_of(drawn, scans)


def scanned_object(scans: Scans) -> Solids:
    """The first scanned object, unscaled; its bounding box is centred at the origin."""
    return _solids_of([[Shape(SCAN, (1.0, 1.0, 1.0), rounding=0.0)]], scans)


def _solids_of(drawn: list[Drawn], scans: Scans | None) -> Solids:
    """A batch from the solids of each object, and the joint of those that have one."""
    pairs = [each if isinstance(each, tuple) else (each, RIGID) for each in drawn]
    solids = [[*each, *[UNUSED] * (SOLIDS - len(each))] for each, _ in pairs]

    def of_solids(name: str) -> Tensor:
        return torch.tensor([[getattr(solid, name) for solid in each] for each in solids])

    def of_joints(name: str) -> Tensor:
        return torch.tensor([getattr(joint, name) for _, joint in pairs])

    return Solids(
        **{name: of_solids(name) for name in ("kind", "size", "center", "part")},
        rounding=of_solids("bevel"),
        rotation=axis_angle_to_matrix(of_solids("turn")),
        **{name: of_joints(name) for name in ("axis", "pivot", "slides", "travel")},
        scans=scans,
    )
