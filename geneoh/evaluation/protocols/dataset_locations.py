"""Where the user's copy of a data set lies, and the one sentence for when it is not there."""

import os
from dataclasses import dataclass
from pathlib import Path

from geneoh.errors import MissingAssetError
from geneoh.readers.registry import SOURCES


@dataclass(frozen=True)
class Home:
    """What a data set must look like on disk."""

    source: str
    """Its name among the readers."""
    variable: str
    """Environment variable that points to a copy."""
    layout: str
    """Where its files lie below the root, in words."""
    pattern: str
    """Matches something in every complete copy."""

    def root(self, given: Path | None) -> Path | None:
        """The folder that was named, by an option or by the environment."""
        named = os.environ.get(self.variable)
        return given or (Path(named) if named else None)

    def require(self, given: Path | None) -> Path:
        """The root of the user's copy.

        Raises:
            MissingAssetError: none is named, or what is named is none; the message says what to
                get, where it must lie and how to point to it.
        """
        root = self.root(given)
        if root is not None and next(root.glob(self.pattern), None) is not None:
            return root
        about = SOURCES[self.source]
        got = "no folder was named" if root is None else f"there is none in {root}"
        raise MissingAssetError(
            f"{about.title}: expected a copy of the data set ({about.licence}), {got}; get it at "
            f"{about.where}, unpack it so that ROOT holds {self.layout}, and name it with "
            f"--root ROOT or {self.variable}=ROOT"
        )


HOMES = {
    home.source: home
    for home in (
        Home(
            "grab",
            "GENEOH_DATA_GRAB",
            "grab/s1 to s10 and tools/object_meshes",
            "grab/s*/*.npz",
        ),
        Home(
            "hoi4d",
            "GENEOH_DATA_HOI4D",
            "HOI4D_annotations, handpose/refinehandpose_right and HOI4D_CAD_Model_for_release",
            "HOI4D_annotations/*/*/*/*/*/*/*/objpose",
        ),
        Home(
            "arctic",
            "GENEOH_DATA_ARCTIC",
            "raw_seqs/s01 and meta/object_vtemplates",
            "raw_seqs/s01/*.mano.npy",
        ),
        Home(
            "taco",
            "GENEOH_DATA_TACO",
            "Hand_Poses, Object_Poses and Object_Models",
            "Hand_Poses/*/*/*_hand.pkl",
        ),
    )
}
