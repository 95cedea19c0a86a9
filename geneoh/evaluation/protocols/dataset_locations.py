"""Where the user's copy of a data set is found, and the error for a copy that is not there."""

import os
from dataclasses import dataclass
from pathlib import Path

from geneoh.errors import MissingAssetError
from geneoh.readers.registry import SOURCES


@dataclass(frozen=True)
class DatasetLocation:
    """How a data set must look on disk."""

    source: str
    """Its name among the readers."""
    layout: str
    """Where its files are below the root, in words."""
    pattern: str
    """Matches a file or folder in every complete copy."""

    @property
    def variable(self) -> str:
        """Environment variable that names a copy."""
        return f"GENEOH_DATA_{self.source.upper()}"

    def root(self, given: Path | None) -> Path | None:
        """The folder that an option or the environment names."""
        named = os.environ.get(self.variable)
        return given or (Path(named) if named else None)

    def require(self, given: Path | None) -> Path:
        """The root of the user's copy.

        Raises:
            MissingAssetError: no folder is named, or it holds no copy; the message says where to
                get the data set, how to unpack it and how to name its folder.
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


DATASET_LOCATIONS = {
    location.source: location
    for location in (
        DatasetLocation("grab", "grab/s1 to s10 and tools/object_meshes", "grab/s*/*.npz"),
        DatasetLocation(
            "hoi4d",
            "HOI4D_annotations, handpose/refinehandpose_right and HOI4D_CAD_Model_for_release",
            "HOI4D_annotations/*/*/*/*/*/*/*/objpose",
        ),
        DatasetLocation(
            "arctic", "raw_seqs/s01 and meta/object_vtemplates", "raw_seqs/s01/*.mano.npy"
        ),
        DatasetLocation(
            "taco", "Hand_Poses, Object_Poses and Object_Models", "Hand_Poses/*/*/*_hand.pkl"
        ),
    )
}
