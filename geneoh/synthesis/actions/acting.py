"""From grasps to actions: one or two hands perform a verb with the object that they hold."""

from dataclasses import dataclass, field
from typing import ClassVar

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from geneoh.bundle import Bundle
from geneoh.config import Limited, Limits
from geneoh.errors import ConfigError
from geneoh.geometry.mirror import mirror_points, mirror_rotations
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.spheres import hand_spheres
from geneoh.synthesis.actions.action import LONGEST, VERBS, Actions
from geneoh.synthesis.actions.setups import ActionSetup, SetupConfig, draw_setups, draw_verb
from geneoh.synthesis.actions.verbs import Moves, VerbConfig, moves_of
from geneoh.synthesis.draws import Draws
from geneoh.synthesis.grasping.bimanual import HandPairs
from geneoh.synthesis.grasping.contact_pads import OtherHands
from geneoh.synthesis.grasping.grasps import Grasps
from geneoh.synthesis.motions.clearance import ClearanceConfig, MovingSolids, clear_ways
from geneoh.synthesis.motions.hand_motion import HandMotionConfig, HandPath, hand_ways
from geneoh.synthesis.motions.object_motion import Schedule, Standing, held_part
from geneoh.synthesis.shapes.solids import Solids

NEVER = 1000.0  # a time that lies outside of every action, frames


@dataclass(frozen=True)
class ActingConfig(Limited):
    """Settings of how hands perform verbs."""

    LIMITS: ClassVar[Limits] = {"left": (0, 1)}

    verbs: VerbConfig = field(default_factory=VerbConfig)
    hand: HandMotionConfig = field(
        default_factory=lambda: HandMotionConfig(
            reach_frames=(14.0, 22.0),
            opening_frames=(8.0, 14.0),
            wrist_delay=0.05,
            lift_share=0.0,
            repeat_share=0.0,
            tremor=0.002,
            open_tremor=0.01,
            shift_noise=0.0005,
            turn_noise=0.004,
        )
    )
    clearance: ClearanceConfig = field(default_factory=ClearanceConfig)
    setup: SetupConfig = field(default_factory=SetupConfig)
    reach: tuple[float, float] = (25.0, 31.0)  # range of the frames until the hand has closed
    leave: float = 26.0  # frames after the release
    grip: float = 4.0  # frames from the closed hand to the first move, and from the last to release
    held: tuple[float, float] = (8.0, 24.0)  # range of frames in which a lifted object is held up
    overlap: float = 0.003  # largest penetration of two hands into each other, metres
    offset: float = 3.0  # largest delay between two hands that grasp together, frames
    left: float = 0.45  # share of the actions that are mirrored, one-handed ones to the left hand

    def __post_init__(self) -> None:
        """Also refuse times before and after the moves that leave none for these."""
        super().__post_init__()
        before, after = self.reach[1] + self.offset + self.grip, self.grip + self.leave
        if (around := before + max(after, self.held[1])) >= LONGEST:
            raise ConfigError(
                "ActingConfig: 'reach', 'offset', 'grip', and 'leave' or 'held' must be below "
                f"{LONGEST} frames together, got {around:g}; lower them"
            )


@dataclass(frozen=True)
class ActionTiming(Bundle):
    """Times of N actions, in frames from their start; columns are first and second hand."""

    close: Float[Tensor, "N 2"]  # the hand has closed
    release: Float[Tensor, "N 2"]  # it starts to open
    start: Float[Tensor, " N"]  # the first move begins
    length: Float[Tensor, " N"]

    def schedule(self, hand: int) -> Schedule:
        """The schedule of the first (0) or second (1) hand."""
        never = torch.zeros(len(self.start), dtype=torch.bool)
        close, release = self.close[:, hand], self.release[:, hand]
        return Schedule(LONGEST, close, release, close, release, release, never, 1.0)


def act(
    grasps: Grasps,
    solids: Solids,
    families: list[str],
    numbers: dict[str, int],
    points: int,
    config: ActingConfig | None = None,
    *,
    generator: torch.Generator,
    pairs: HandPairs | None = None,
) -> Actions:
    """An action for every grasp, or pair of grasps, that is possible on a table; those whose hands
    penetrate each other are left out.

    `families` names the family or scan of each grasp's object; `numbers` maps these names to
    `Actions.name`.
    """
    config = config or ActingConfig()
    pairs = pairs or HandPairs.none(len(grasps.pose))
    surface, normals = solids.surface_points(points, generator=generator)
    joints, _ = grasps.posed()
    held = held_part(solids, joints, config.setup.parts)
    setup = draw_setups(
        grasps, joints, surface, families, pairs, held, solids, config.setup, generator
    )
    first, draws = setup.first, Draws(len(setup.first), generator)
    verb, solids = draw_verb(setup.possible, draws), solids.take(first, "B")

    stood, ground = stood_on_table(surface[first] @ setup.standing.mT)
    middle = stood.mean(1) * torch.eye(3)[2]
    radius = (stood - middle[:, None]).norm(dim=-1).amax(1)
    moves, timing = _draw_timing(verb, setup.paired, radius, config, draws)
    rotation, translation, opened = motion_around(middle, moves.path(timing.start, LONGEST))
    joint = joint_values(verb, held.travel[first], opened)

    moving = MovingSolids.on_joint(solids, *solids.joint_pose(joint))
    second_part = held.index[first] == 1
    hands = [
        hand.moved(setup.standing[:, None], -ground[:, None]).moved(rotation, translation)
        for hand in hand_paths(grasps, setup, timing, moving, second_part, config, draws)
    ]
    present = torch.stack([setup.paired, torch.ones_like(setup.paired)], 1)
    jointed = solids.jointed[:, None]
    actions = Actions(
        verb=verb,
        name=torch.tensor([numbers[families[i]] for i in first.tolist()], dtype=torch.long),
        hands=present,
        length=timing.length.round().long().clamp(max=LONGEST),
        pose=torch.stack([hand.pose for hand in hands], 1) * present[:, :, None, None, None],
        wrist=torch.stack([hand.wrist for hand in hands], 1) * present[:, :, None, None],
        rotation=rotation,
        translation=translation,
        joint=joint,
        points=stood,
        normals=normals[first] @ setup.standing.mT,
        part=solids.nearest_part(surface[first]) * jointed,
        axis=(setup.standing @ solids.axis[..., None])[..., 0] * jointed,
        pivot=((setup.standing @ solids.pivot[..., None])[..., 0] - ground) * jointed,
        slides=solids.slides,
    ).ended()
    actions = actions.mirrored(draws.chance(config.left))
    return actions.take(overlap_of_hands(actions) < config.overlap, "B")


def stood_on_table(
    points: Float[Tensor, "N P 3"],
) -> tuple[Float[Tensor, "N P 3"], Float[Tensor, "N 3"]]:
    """Points of upright objects (z up) in the frame of `Actions`, and the offset subtracted."""
    ground = torch.cat([points[..., :2].mean(1), points[..., 2].amin(1, keepdim=True)], -1)
    return points - ground[:, None], ground


def motion_around(
    middle: Float[Tensor, "N 3"], path: Float[Tensor, "N T 7"]
) -> tuple[Float[Tensor, "N T 3 3"], Float[Tensor, "N T 3"], Float[Tensor, "N T"]]:
    """Rotations, translations and opening of objects that turn about the point `middle`.

    `path` holds the shift in metres, the turn as axis-angle, and the opening from 0 to 1.
    """
    shift, turn, opened = path.split([3, 3, 1], -1)
    rotation = axis_angle_to_matrix(turn)
    translation = shift + middle[:, None] - (rotation @ middle[:, None, :, None])[..., 0]
    return rotation, translation, opened[..., 0]


def joint_values(
    verb: Int[Tensor, " N"], travel: Float[Tensor, "N 2"], opened: Float[Tensor, "N T"]
) -> Float[Tensor, "N T"]:
    """Joint states, radians or metres, which change only for the verbs "open" and "close"."""
    works = (verb == VERBS.index("open")) | (verb == VERBS.index("close"))
    travel = travel * works[:, None]
    return torch.lerp(travel[:, :1], travel[:, 1:], opened)


def _draw_timing(
    verb: Int[Tensor, " N"],
    paired: Bool[Tensor, " N"],
    radius: Float[Tensor, " N"],
    config: ActingConfig,
    draws: Draws,
) -> tuple[Moves, ActionTiming]:
    """Moves of objects and times of hands; actions beyond `LONGEST` frames are sped up."""
    moves = moves_of(verb, radius, config.verbs, draws)
    close = draws.uniform(config.reach, 1) + config.offset * draws.share(2)
    close = torch.where((verb == VERBS.index("put down"))[:, None], -NEVER, close)
    held = draws.uniform(config.held)
    timing = _timing(verb, paired, moves, close, held, config)
    too_long = (timing.length - LONGEST).clamp(min=0)
    moves = moves.quicker(1 - too_long / moves.duration.clamp(min=1))
    return moves, _timing(verb, paired, moves, close, held, config)


def _timing(
    verb: Int[Tensor, " N"],
    paired: Bool[Tensor, " N"],
    moves: Moves,
    close: Float[Tensor, "N 2"],
    held: Float[Tensor, " N"],
    config: ActingConfig,
) -> ActionTiming:
    """The times at which hands close before, and open after, the passed moves."""
    passed, lifted = (verb == VERBS.index(name) for name in ("pass", "lift"))
    last = torch.where(paired & ~passed, close.amax(1), close[:, 0])
    start = last.clamp(min=0) + config.grip
    end = start + moves.duration
    meet = start + moves.frames[:, 1]  # the object has come to where it is passed
    close = torch.where(
        passed[:, None], torch.stack([close[:, 0], meet + 0.3 * moves.rest[:, 2]], 1), close
    )
    let_go = torch.where(passed, meet + 0.7 * moves.rest[:, 2], end + config.grip)
    release = torch.stack([let_go, end + config.grip], 1)
    release = torch.where(lifted[:, None], NEVER, release)
    length = torch.where(lifted, end + held, end + config.grip + config.leave)
    return ActionTiming(close, release, start, length)


def overlap_of_hands(actions: Actions) -> Float[Tensor, " B"]:
    """Largest penetration between the two hands of each action, metres; 0 for one hand."""
    deepest = torch.zeros(len(actions.verb))
    (two,) = torch.nonzero(actions.hands.all(1), as_tuple=True)
    if len(two):
        sides = actions.take(two, "B").keypoints().transpose(0, 1).flatten(1, 2)
        left, right = (hand_spheres(side, torch.ones(len(side), 1)) for side in sides)
        depth = OtherHands(*left).depth(*right).unflatten(0, (len(two), -1))
        deepest[two] = depth.amax((1, 2)).clamp(min=0)
    return deepest


def hand_paths(
    grasps: Grasps,
    setup: ActionSetup,
    timing: ActionTiming,
    moving: MovingSolids,
    second_part: Bool[Tensor, " N"],
    config: ActingConfig,
    draws: Draws,
) -> tuple[HandPath, HandPath]:
    """Left and right hands of actions in the frame of their object, whose parts move as in
    `moving`. Motions avoid the object (see `clear_ways`).

    The first hand, which becomes the right one, holds the object's second part where `second_part`.
    Without a second hand the left one is meaningless.
    """
    first = grasps.take(setup.first, "B")
    stands = Standing(setup.standing, torch.ones_like(setup.paired))
    drawn = hand_ways(first, stands, timing.schedule(0), config.hand, draws)

    def on_part(clips: Int[Tensor, " C"]) -> HandPath:
        """First hands, moved with the part that they hold."""
        part = second_part[clips].long()
        return drawn(clips).moved(
            moving.rotation[clips, :, part], moving.translation[clips, :, part]
        )

    right = clear_ways(on_part, moving, first.offsets, config.clearance)
    (two,) = torch.nonzero(setup.paired, as_tuple=True)
    pairs = setup.take(two, "N")
    other = grasps.take(pairs.second, "B")
    upright = mirror_rotations(pairs.standing @ pairs.image)
    stands = Standing(upright, torch.ones_like(pairs.paired))
    later, own = timing.take(two, "N").schedule(1), Draws(len(two), draws.generator)
    others = hand_ways(other, stands, later, config.hand, own)

    def mirrored(clips: Int[Tensor, " C"]) -> HandPath:
        """Second hands, which are drawn as right hands on the mirrored object, as left hands."""
        return others(clips).mirrored().moved(pairs.image[clips, None], torch.zeros(1, 1, 3))

    left = clear_ways(
        mirrored, moving.take(two, "B"), mirror_points(other.offsets), config.clearance
    )
    return right.replaced(two, left), right
