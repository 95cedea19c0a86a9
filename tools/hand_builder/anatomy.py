"""The shape of the right hand as an implicit surface over its skeleton, millimetres, wrist at 0.

Bones are round rods along the measured skeleton; each finger is a tube whose half width and whose
dorsal and palmar depth follow the phalanges (knuckles, creases, pads), the palm a smooth union of
metacarpals, thenar and hypothenar muscles, webs and a short forearm. Negative is inside.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from geneoh.hand.skeleton import PARENTS, TIP_PARENTS

FloatArray = NDArray[np.float64]

SCALE = 0.93
"""Factor on the measured bones: the measured person is a large adult, this makes an average one."""

MEASURED_OFFSETS = np.array(
    [
        [-91.4, -7.5, 17.3], [-34.0, 0.0, 4.0], [-22.9, -1.5, 1.8],
        [-98.7, -4.9, -6.5], [-31.5, -0.9, -2.9], [-22.5, 0.6, -2.5],
        [-72.9, -6.7, -45.4], [-18.5, 3.3, -11.8], [-17.8, 1.3, -8.0],
        [-84.8, -4.1, -28.9], [-29.1, 1.4, -2.5], [-27.0, 0.9, -3.8],
        [-27.0, -9.8, 25.9], [-23.6, 5.8, 19.3], [-27.0, -3.5, 14.3],
        [-26.3, 0.8, 1.8], [-26.7, 3.6, -2.5], [-19.8, -0.4, -8.0],
        [-25.7, -0.7, -3.8], [-33.5, 1.2, 26.8],
    ]
)  # fmt: skip
"""Rest offsets of 15 bones and 5 tips, mm, right hand: one person of the TACO recording
20231104_017 (CC BY 4.0), measured from the motion of the surface, fit residual 0.25 mm."""

CHAINS = ((1, 2, 3, 16), (4, 5, 6, 17), (7, 8, 9, 18), (10, 11, 12, 19), (13, 14, 15, 20))
"""Knuckle, middle, distal joint and tip of index, middle, pinky, ring, thumb."""
ACROSS = (0, 1, 3, 2)
"""The fingers side by side, from the index to the pinky: indices into CHAINS."""
THUMB = 4

UP = np.array([0.0, 1.0, 0.0])
THUMB_ROLL = np.radians(42.0)
"""Angle between the thumb's nail and the back of the hand, towards the radial side, radians."""


BONE_PARENTS = (*PARENTS[1:], *TIP_PARENTS)
"""The joint that each of the 15 bones and 5 tips starts from."""


def skeleton(offsets: FloatArray = MEASURED_OFFSETS * SCALE) -> FloatArray:
    """Positions (21, 3) of the 16 joints and the 5 tips for rest offsets (20, 3)."""
    points = np.zeros((21, 3))
    for child, parent in enumerate(BONE_PARENTS, start=1):
        points[child] = points[parent] + offsets[child - 1]
    return points


@dataclass(frozen=True)
class Digit:
    """One finger or the thumb as a tube along three bones.

    The place along it is q: 0 at the knuckle, 1 and 2 at the next joints, 3 at the tip.
    """

    points: FloatArray  # (4, 3)
    dorsal: FloatArray  # (3,), towards the nail
    profile: tuple[PchipInterpolator, PchipInterpolator, PchipInterpolator]
    """Half width, dorsal depth and palmar depth over q, mm."""
    squareness: float = 2.25
    """Exponent of the superelliptic cross-sections."""

    def centre(self, q: float) -> FloatArray:
        """The axis point at q."""
        bone = min(int(max(q, 0.0)), 2)
        return self.points[bone] + (q - bone) * (self.points[bone + 1] - self.points[bone])

    def frame(self, q: float) -> FloatArray:
        """Columns: tangent, dorsal, and dorsal x tangent, at q, blended across the joints."""
        steps = np.diff(self.points, axis=0)
        steps /= np.linalg.norm(steps, axis=1, keepdims=True)
        mid = np.clip(q - 0.5, 0.0, 2.0)
        low = min(int(mid), 1)
        tangent = steps[low] + (mid - low) * (steps[low + 1] - steps[low])
        tangent /= np.linalg.norm(tangent)
        up = self.dorsal - tangent * (tangent @ self.dorsal)
        up /= np.linalg.norm(up)
        return np.stack([tangent, up, np.cross(up, tangent)], axis=1)

    def distance(self, points: FloatArray) -> FloatArray:
        """Approximate signed distance (P,) to the tube; its sign is exact."""
        best = np.full(len(points), np.inf)
        for bone in range(3):
            start, step = self.points[bone], self.points[bone + 1] - self.points[bone]
            along = (points - start) @ step / (step @ step)
            along = np.clip(along, 0.0, 1.0)
            offset = points - start - along[:, None] * step
            up = self.dorsal - step * (step @ self.dorsal) / (step @ step)
            up /= np.linalg.norm(up)
            side = np.cross(up, step / np.linalg.norm(step))
            radius = self._radius(bone + along, offset @ side, offset @ up)
            best = np.minimum(best, np.linalg.norm(offset, axis=1) - radius)
        return best

    def _radius(self, q: FloatArray, side: FloatArray, up: FloatArray) -> FloatArray:
        """Length of the cross-section's radius at q in the direction (side, up)."""
        width, dorsal, palmar = (curve(q) for curve in self.profile)
        length = np.hypot(side, up) + 1e-9
        depth = np.where(up > 0, dorsal, palmar)
        n = self.squareness
        width, depth = np.maximum(width, 1e-6), np.maximum(depth, 1e-6)
        ratio = (np.abs(side) / length / width) ** n + (np.abs(up) / length / depth) ** n
        return np.maximum(ratio, 1e-4) ** (-1.0 / n)  # the axis itself has no direction


PROFILE_Q = np.array([-0.6, 0.0, 0.5, 0.85, 1.0, 1.2, 1.5, 1.8, 2.0, 2.2, 2.5])
FINGER_WIDTH = np.array([0.92, 0.93, 0.92, 0.99, 1.02, 0.97, 0.885, 0.89, 0.91, 0.87, 0.84])
FINGER_DORSAL = np.array([1.0, 0.98, 0.86, 0.92, 0.96, 0.89, 0.77, 0.75, 0.76, 0.69, 0.62])
FINGER_PALMAR = np.array([1.0, 1.02, 1.05, 0.93, 0.87, 0.93, 0.97, 0.83, 0.79, 0.85, 0.88])
THUMB_WIDTH = np.array([1.55, 1.5, 1.32, 1.17, 1.12, 1.05, 0.98, 1.0, 1.01, 1.0, 0.98])
THUMB_DORSAL = np.array([1.2, 1.15, 1.05, 1.0, 0.98, 0.92, 0.86, 0.88, 0.88, 0.80, 0.68])
THUMB_PALMAR = np.array([1.5, 1.5, 1.4, 1.2, 1.12, 1.08, 1.04, 0.95, 0.93, 0.96, 0.95])
FINGER_PROFILE = (FINGER_WIDTH, FINGER_DORSAL, FINGER_PALMAR)
THUMB_PROFILE = (THUMB_WIDTH, THUMB_DORSAL, THUMB_PALMAR)
"""At the places PROFILE_Q along a digit: half width, depth to the back and to the pad, in RADII."""

RADII = (9.4, 9.5, 7.9, 9.0, 9.6)
"""Half width at the middle joint of index, middle, pinky, ring, thumb, mm (average adult)."""


def digits(points: FloatArray) -> tuple[Digit, ...]:
    """The five tubes over a skeleton (21, 3)."""
    made = []
    for finger, chain in enumerate(CHAINS):
        joints = points[list(chain)]
        thumb = finger == THUMB
        length = float(np.linalg.norm(joints[3] - joints[2]))
        width, dorsal, palmar = (
            _capped(PROFILE_Q, each * RADII[finger], length)
            for each in (THUMB_PROFILE if thumb else FINGER_PROFILE)
        )
        made.append(Digit(joints, _dorsal(joints, thumb), (width, dorsal, palmar)))
    return tuple(made)


def _dorsal(joints: FloatArray, thumb: bool) -> FloatArray:
    """Direction of the nail: up for a finger, rolled to the radial side for the thumb."""
    if not thumb:
        return UP
    step = joints[3] - joints[1]
    radial = np.cross(UP, step)
    radial /= np.linalg.norm(radial)
    radial *= np.sign(radial[2])
    return np.cos(THUMB_ROLL) * UP + np.sin(THUMB_ROLL) * radial


def _capped(q: FloatArray, radius: FloatArray, length: float) -> PchipInterpolator:
    """The radius over q with a rounded end that closes at the tip."""
    cap = min(1.25 * radius[-1] / length, 0.45)
    angle = np.linspace(0.0, np.pi / 2, 9)
    end = 3.0 - cap + cap * np.sin(angle)
    closing = np.interp(end[:-1], q, radius) * np.cos(angle[:-1]) ** 0.85
    keep = q < 3.0 - cap - 0.03
    return PchipInterpolator(
        np.r_[q[keep], end], np.r_[radius[keep], closing, 0.02], extrapolate=True
    )


def rod(
    points: FloatArray, start: FloatArray, end: FloatArray, radii: tuple[float, float], flat: float
) -> FloatArray:
    """Signed distance to a rod from one round end to another, flattened along UP by `flat`."""
    squeeze = np.array([1.0, flat, 1.0])
    points, start, end = points * squeeze, start * squeeze, end * squeeze
    step = end - start
    along = np.clip((points - start) @ step / (step @ step), 0.0, 1.0)
    gap = np.linalg.norm(points - start - along[:, None] * step, axis=1)
    return gap - (radii[0] + along * (radii[1] - radii[0]))


def smooth_min(distances: list[FloatArray], width: float) -> FloatArray:
    """Union of solids with a fillet of about `width`: minus the log of summed exponentials."""
    stack = np.stack(distances)
    least = stack.min(0)
    return least - width * np.log(np.exp(-(stack - least) / width).sum(0))


def smoothstep(x: FloatArray) -> FloatArray:
    """From 0 at x = 0 to 1 at x = 1, with zero slope at both ends."""
    x = np.clip(x, 0.0, 1.0)
    return x * x * (3 - 2 * x)


def palm_distance(points: FloatArray, bones: FloatArray) -> FloatArray:
    """Signed distance (P,) to the palm with thenar, hypothenar, webs and forearm."""
    rods: list[tuple[FloatArray, FloatArray, tuple[float, float], float]] = []
    for place, finger in enumerate(ACROSS):
        knuckle = bones[CHAINS[finger][0]]
        root = np.array([-6.0, 0.5, (12.0, 4.0, -5.0, -13.0)[place]])
        radius = (11.6, 11.6, 11.2, 10.6)[place]
        rods.append((root, knuckle + 1.0 * UP, (13.5, radius), 1.05))
        rods.append((knuckle + [3.0, 3.2, 0.0], knuckle + [-2.0, 3.2, 0.0], (9.2, 9.0), 1.0))
        # Muscle and fat under the metacarpals: the palm is thicker below than above the bone.
        rods.append((root - 6 * UP, knuckle - 4.5 * UP, (10.0, radius - 2), 1.0))
    webs = [bones[list(CHAINS[finger][:2])] for finger in ACROSS]
    webs = [base + 0.24 * (after - base) - 1.5 * UP for base, after in webs]
    rods += [(left, right, (6.3, 6.3), 1.0) for left, right in pairwise(webs)]
    base, after = bones[list(CHAINS[THUMB][:2])]
    index, pinky = bones[CHAINS[0][0]], bones[CHAINS[2][0]]
    thenar, hypothenar = np.array([-10.0, -9.0, 12.0]), np.array([-8.0, -9.0, -12.0])
    rods.append((thenar, after + 0.1 * (base - after), (14.0, 11.5), 1.0))
    rods.append((hypothenar, pinky + [22.0, -5.0, 2.0], (12.5, 11.0), 1.0))
    # The first web: a thin sheet between thumb and index metacarpals.
    rods.append((after + [4.0, -1.0, -6.0], index + [20.0, -3.0, 2.0], (7.0, 8.0), 1.0))
    for side in (-9.5, 0.0, 9.5):  # the forearm
        ends = np.array([0, -1.5, side]), np.array([45, -1.5, 1.08 * side])
        rods.append((*ends, (17.5, 18.5), 1.05))
    return smooth_min([rod(points, *each) for each in rods], 3.4)


def hand_distance(points: FloatArray, bones: FloatArray, tubes: tuple[Digit, ...]) -> FloatArray:
    """Signed distance (P,) to the whole hand; neighbouring fingers stay separate."""
    fingers = np.min([tube.distance(points) for tube in tubes], axis=0)
    return smooth_min([palm_distance(points, bones), fingers], 2.2)
