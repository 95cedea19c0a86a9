"""Objects of two parts, closed: a box with a lid and a case with a drawer, made with trimesh."""

import trimesh

from geneoh.geometry.mesh import Mesh
from geneoh.geometry.mesh_files import from_trimesh

WIDE, DEEP, HIGH, WALL = 0.16, 0.11, 0.07, 0.004  # of the box, metres
HINGE = f"hinge:0,{DEEP / 2},{HIGH}:-1,0,0:100"
"""At the back of the box, y > 0."""
DRAWER = "slide:0,-1,0:10"


def cuboid(sides, middle) -> trimesh.Trimesh:
    """A box at a place."""
    return trimesh.creation.box(sides).apply_translation(middle)


def tray(wide: float, deep: float, high: float, wall: float, low: float = 0.0) -> trimesh.Trimesh:
    """An open box that stands at the height `low`, of five plates."""
    walls = high - wall
    middle = low + wall + walls / 2
    plates = [cuboid((wide, deep, wall), (0, 0, low + wall / 2))]
    for side in (-1, 1):
        plates.append(cuboid((wall, deep, walls), (side * (wide - wall) / 2, 0, middle)))
        across = (wide - 2 * wall, wall, walls)
        plates.append(cuboid(across, (0, side * (deep - wall) / 2, middle)))
    return trimesh.util.concatenate(plates)


def box_with_lid(overhang: float = 0.0) -> tuple[Mesh, Mesh]:
    """A box with a flat lid, which reaches over its front at y < 0 by `overhang` metres."""
    lid = cuboid((WIDE, DEEP + overhang, WALL), (0, -overhang / 2, HIGH + WALL / 2 + 0.0003))
    return from_trimesh(tray(WIDE, DEEP, HIGH, WALL)), from_trimesh(lid)


def case_with_drawer() -> tuple[Mesh, Mesh]:
    """A case that is open at y < 0, with a drawer that has a bar for a handle there."""
    wide, deep, high, wall = 0.14, 0.16, 0.08, 0.005
    case = tray(wide, high, deep, wall)  # stands on its back; its opening is up
    turn = trimesh.transformations.rotation_matrix(1.5707963267948966, [1, 0, 0])
    case = case.apply_transform(turn).apply_translation((0, deep / 2, high / 2))
    inner = wide - 2 * wall - 0.002, deep - wall - 0.001, high - 2 * wall - 0.002
    drawer = tray(*inner, wall, low=wall + 0.001).apply_translation((0, -(wall + 0.001) / 2, 0))
    bar = cuboid((0.06, 0.025, 0.015), (0, -deep / 2 - 0.0125, high / 2))
    return from_trimesh(case), from_trimesh(trimesh.util.concatenate([drawer, bar]))
