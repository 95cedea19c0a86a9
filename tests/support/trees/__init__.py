"""Data sets in miniature: one known interaction, written in the exact layout of each source."""

from trees.cases import CASES, Case, case_of, written
from trees.estimators import dynhamr, hamer, hawor, landmarks
from trees.interaction import FRAMES, Scene, cameras, opened, scene
from trees.mano_files import FLIP, mano_arrays, write_mano
from trees.mocap import arctic, arctic_processed, grab, grab_clips, grab_clips_left
from trees.videos import (
    HOI_ID,
    dexycb,
    h2o,
    hoi4d,
    hoi4d_articulated,
    hoi4d_cases,
    hoi4d_hands,
    taco,
    taco_pickle,
)
from trees.writers import dump, write_mesh

__all__ = [
    "CASES",
    "FLIP",
    "FRAMES",
    "HOI_ID",
    "Case",
    "Scene",
    "arctic",
    "arctic_processed",
    "cameras",
    "case_of",
    "dexycb",
    "dump",
    "dynhamr",
    "grab",
    "grab_clips",
    "grab_clips_left",
    "h2o",
    "hamer",
    "hawor",
    "hoi4d",
    "hoi4d_articulated",
    "hoi4d_cases",
    "hoi4d_hands",
    "landmarks",
    "mano_arrays",
    "opened",
    "scene",
    "taco",
    "taco_pickle",
    "write_mano",
    "write_mesh",
    "written",
]
