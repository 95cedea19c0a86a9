"""The sources that can be read, with the licence of each and where to get it.

A source's own module is imported only when its reader is requested, so that `--help` stays fast.
"""

from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from geneoh.readers.dataset_reader import DatasetReader


@dataclass(frozen=True)
class Source:
    """A data set or an estimator whose files are read as they are distributed."""

    name: str
    """Name on the command line, and of the reader in its module."""
    title: str
    holds: str
    licence: str
    where: str
    """Where to get it."""

    def reader(self) -> "DatasetReader":
        """The source's reader."""
        module = import_module(f"geneoh.readers.sources.{IN_MODULE.get(self.name, self.name)}")
        return getattr(module, self.name)


IN_MODULE = {
    **{"grab_clips": "grab", "hoi4d_cases": "hoi4d", "taco_pickle": "taco", "oakink2": "oakink"},
    "h2o3d": "ho3d",
    **dict.fromkeys(("arctic_processed", "arcticnet"), "arctic"),
    **dict.fromkeys(("keypoints", "parameters"), "bare_arrays"),
}
"""The module of each source whose module has another name than the source."""

TABLE = """
grab | GRAB | two hands, object | non-commercial research | grab.is.tue.mpg.de
grab_clips | GRAB in clips of TOCH and GeneOH | one hand, object | non-commercial research | \
github.com/kzhou23/toch, github.com/Meowuu7/GeneOH-Diffusion
hoi4d | HOI4D | hands, rigid or articulated object | CC BY-NC 4.0 | hoi4d.github.io
hoi4d_cases | HOI4D in cases of GeneOH | right hand, rigid or articulated object | CC BY-NC 4.0 | \
github.com/Meowuu7/GeneOH-Diffusion
arctic | ARCTIC | two hands, two-part object | non-commercial research | arctic.is.tue.mpg.de
taco | TACO | right hand with tool, left with target | CC BY 4.0 | taco2024.github.io
taco_pickle | TACO, simplified pickle | one hand, object | CC BY 4.0 | \
github.com/Meowuu7/GeneOH-Diffusion
arctic_processed | ARCTIC, processed | two hands, two-part object | non-commercial research | \
arctic.is.tue.mpg.de
arcticnet | ArcticNet predictions | two hands, two-part object | non-commercial research | \
github.com/zc-alexfan/arctic
h2o | H2O | two hands, object | non-commercial research | taeinkwon.com/projects/h2o
dexycb | DexYCB | one hand, object | CC BY-NC 4.0 | dex-ycb.github.io
hocap | HO-Cap | two hands, objects | see the site | irvlutd.github.io/HOCap
hot3d | HOT3D | two hands, objects | see the site | facebookresearch.github.io/hot3d
ho3d | HO-3D v3 | right hand, object | non-commercial research | github.com/shreyashampali/ho3d
h2o3d | H2O-3D | two hands, object | non-commercial research | github.com/shreyashampali/ho3d
oakink | OakInk, images | right hand, object | non-commercial research | oakink.net
gigahands | GigaHands | two hands, object | CC BY-NC 4.0 | \
github.com/Kristen-Z/GigaHands
oakink2 | OakInk2 | two hands, objects | see the site | oakink.net/v2
fphab | FPHAB with Hasson's fits | right hand, object | non-commercial research | \
guiggh.github.io/publications/first-person-hands
both57m | BOTH57M | two hands on a body | CC BY-NC-SA 4.0 | github.com/Godheritage/BOTH2Hands
hamer | HaMeR and WiLoR dumps | hands | HaMeR MIT, WiLoR CC BY-NC-ND 4.0 | \
github.com/geopavlakos/hamer, github.com/rolpotamias/WiLoR
hawor | HaWoR world results | two hands | CC BY-NC-ND 4.0 | github.com/ThunderVVV/HaWoR
dynhamr | Dyn-HaMR world results | two hands | see the site | github.com/ZhengdiYu/Dyn-HaMR
video_to_data | NVIDIA's video_to_data results | two hands, object | see the site | \
github.com/nvidia-isaac/video_to_data
egoallo | EgoAllo results | two hands on a body | MIT | github.com/brentyi/egoallo
aria | Aria MPS | hands | your own | facebookresearch.github.io/projectaria_tools
landmarks | MediaPipe, WebXR or OpenXR landmarks | \
hands (JSON, CSV; --side, --joint-order, --keypoint-unit) | \
your own | any program that writes them
keypoints | any keypoints | one hand (npy, npz; --side, --joint-order) | your own | \
any program that writes them
parameters | any MANO parameters | one hand (npy, npz, pkl; --side, --translation) | your own | \
any program that writes them
"""
"""Columns: name, title, contents, licence, and where to get the source."""

SOURCES = {row.split(" | ")[0]: Source(*row.split(" | ")) for row in TABLE.strip().splitlines()}
