"""What can be read, with the licence of each and where to get it; imports no adapter until asked."""

from dataclasses import dataclass
from importlib import import_module
from types import ModuleType


@dataclass(frozen=True)
class Source:
    """A data set or an estimator whose files are read as they are distributed."""

    name: str
    """On the command line; the module of its adapter has the same name."""
    title: str
    holds: str
    licence: str
    where: str

    def adapter(self) -> ModuleType:
        """The module with `find(path)` and `read(clip, known)`."""
        return import_module(f"geneoh.datasets.{self.name}")


NON_COMMERCIAL = "non-commercial research"
SOURCES: dict[str, Source] = {
    source.name: source
    for source in (
        Source("grab", "GRAB", "two hands, object", NON_COMMERCIAL, "grab.is.tue.mpg.de"),
        Source(
            "hoi4d",
            "HOI4D",
            "hands, rigid or articulated object",
            "CC BY-NC 4.0",
            "hoi4d.github.io",
        ),
        Source(
            "arctic", "ARCTIC", "two hands, two-part object", NON_COMMERCIAL, "arctic.is.tue.mpg.de"
        ),
        Source(
            "taco",
            "TACO",
            "right hand with tool, left with target",
            "CC BY 4.0",
            "taco2024.github.io",
        ),
        Source(
            "taco_pickle",
            "TACO, simplified pickle",
            "one hand, object",
            "CC BY 4.0",
            "github.com/Meowuu7/GeneOH-Diffusion",
        ),
    )
}
