"""Signed distance to a solid on a GPU, by NVIDIA Warp (extra `gpu`), in float32.

The same answers as libigl's in `distance.py`, to rounding, without a copy of the points to the CPU.
Warp runs on a CPU as well, where the tests compare the two.
"""

# kernels are in Warp's language, which type checkers of Python do not know
# pyright: reportAttributeAccessIssue=false

import inspect
from typing import Any

import torch
import warp as wp  # pyright: ignore[reportMissingImports]  # an optional extra
from jaxtyping import Bool, Float, Int
from torch import Tensor

from geneoh.geometry.mesh import Mesh
from geneoh.geometry.solid import Solid

ACCURACY = 2.0  # of the winding number, as libigl's own default
FARTHEST = 1e6  # largest distance of the search for the surface, metres

wp.config.quiet = True
wp.init()


def _nearest(surface, body, turned, low, high, within, points, closest, face, inside):
    number = wp.tid()
    point = points[number]
    boxed = wp.max(wp.min(point, high), low)
    apart = wp.length(point - boxed)
    # no search for points that are not finite or far from the box
    closest[number] = boxed
    face[number] = 0
    if apart <= within:
        found = wp.mesh_query_point_no_sign(surface, point, FARTHEST)
        closest[number] = wp.mesh_eval_position(surface, found.face, found.u, found.v)
        face[number] = found.face
    here = apart == 0.0
    if here:
        # inside by the absolute winding number, so faces may point either way
        own = wp.mesh_query_point_sign_winding_number(body, point, FARTHEST, ACCURACY, 0.5)
        other = wp.mesh_query_point_sign_winding_number(turned, point, FARTHEST, ACCURACY, 0.5)
        here = own.sign < 0.0 or other.sign < 0.0
    inside[number] = here


def _kernel() -> Any:
    """`_nearest` as a Warp kernel, with the annotations from which Warp reads its types.

    They are set here because they are no Python types, on which runtime type checkers would fail.
    """
    function = inspect.unwrap(_nearest)
    trees = dict.fromkeys(("surface", "body", "turned"), wp.uint64)
    box = dict.fromkeys(("low", "high"), wp.vec3)
    types = {"points": wp.vec3, "closest": wp.vec3, "face": wp.int32, "inside": wp.bool}
    arrays = {name: wp.array(dtype=each) for name, each in types.items()}
    function.__annotations__ = trees | box | {"within": float} | arrays
    return wp.kernel(function)


KERNEL = _kernel()


class WarpField:
    """A solid whose surface is searched on one device."""

    def __init__(self, solid: Solid, device: torch.device) -> None:
        """Build the trees on the device."""
        body = solid.body
        device = torch.empty(0, device=device).device  # which GPU "cuda" means: Warp wants a number
        self.device = device
        self._low, self._high = wp.vec3(*solid.low.tolist()), wp.vec3(*solid.high.tolist())
        self._surface = _tree(solid.surface, device, winding=False)
        self._body = _tree(body, device, winding=True)
        self._turned = _tree(Mesh(body.verts, body.faces.flip(-1)), device, winding=True)

    def nearest(
        self, points: Float[Tensor, "N 3"], within: float | None = None
    ) -> tuple[Float[Tensor, "N 3"], Int[Tensor, " N"], Bool[Tensor, " N"]]:
        """Closest surface point, its face, and whether each point is inside; on the device.

        For points farther than `within` from the bounding box, the closest point of that box.
        """
        points = points.detach().to(self.device, torch.float32).contiguous()
        closest = torch.empty_like(points)
        face = torch.empty(len(points), dtype=torch.int32, device=self.device)
        inside = torch.empty(len(points), dtype=torch.bool, device=self.device)
        reach = FARTHEST if within is None else within
        trees = [tree.id for tree in (self._surface, self._body, self._turned)]
        vectors = [wp.from_torch(each, dtype=wp.vec3) for each in (points, closest)]
        outputs = [vectors[1], wp.from_torch(face), wp.from_torch(inside)]
        with _stream(self.device):
            wp.launch(
                KERNEL,
                dim=len(points),
                inputs=[*trees, self._low, self._high, reach, vectors[0]],
                outputs=outputs,
                device=wp.device_from_torch(self.device),
            )
        return closest, face.long(), inside


def _tree(mesh: Mesh, device: torch.device, *, winding: bool) -> wp.Mesh:
    verts = mesh.verts.to(device, torch.float32).contiguous()
    faces = mesh.faces.to(device, torch.int32).flatten().contiguous()
    return wp.Mesh(
        wp.clone(wp.from_torch(verts, dtype=wp.vec3)),
        wp.clone(wp.from_torch(faces)),
        support_winding_number=winding,
    )


def _stream(device: torch.device) -> Any:
    """Warp on torch's current CUDA stream, so that each waits for the other; or on the CPU."""
    if device.type != "cuda":
        return wp.ScopedDevice("cpu")
    return wp.ScopedStream(wp.stream_from_torch(torch.cuda.current_stream(device)))
