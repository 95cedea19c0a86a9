"""From a sentence and a mesh to an interaction: Text2HOI as a whole (paper, figure 2)."""

from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.arguments import checked_call, given_options
from geneoh.bundle import ByValue, show_text
from geneoh.choices import DRAWS, GENERATION, GUIDANCE, SIDES, STEPS, Axis, Refiner
from geneoh.config import check_fields
from geneoh.errors import numbered
from geneoh.files.npz import Arrays
from geneoh.generators.text2hoi.choosing import fault_note, missed_motion, missing_notes
from geneoh.generators.text2hoi.networks.library import (
    Text2HoiNetworks,
    load_refiner,
    load_text2hoi,
)
from geneoh.generators.text2hoi.networks.refiner import refined_by
from geneoh.generators.text2hoi.physics.jointed import JointedObject, asked_joint, joined
from geneoh.generators.text2hoi.physics.opening import rigid_part
from geneoh.generators.text2hoi.physics.resting import eased_time, finished, kept_on_table, retimed
from geneoh.generators.text2hoi.physics.settling import settled
from geneoh.generators.text2hoi.physics.standing import StandingObject, stand_on_table
from geneoh.generators.text2hoi.sampling import Text2HoiSampling, sample_actions
from geneoh.generators.text2hoi.sentences.prompt import JOINTED, Prompt, read_prompt
from geneoh.geometry.joint import Joint
from geneoh.geometry.mesh import Mesh
from geneoh.geometry.mesh_files import MeshInput, meshes_of
from geneoh.nn.devices import named_device
from geneoh.pipeline.denoise import clean_interaction
from geneoh.pipeline.options import Options
from geneoh.pipeline.results import Denoised
from geneoh.pipeline.retiming import result_at_times
from geneoh.progress import OnProgress
from geneoh.seeds import seeded_generator
from geneoh.sequence.sequence import HandTrack, ObjectTrack, Sequence
from geneoh.synthesis.actions.action import FPS, Actions

LENGTHS = 32  # lengths drawn for a sentence; their range is what it has in training


@dataclass(frozen=True)
class GenerateOptions:
    """The settings of `geneoh.generate`; the defaults are those of `geneoh generate`."""

    up: Axis = "z"
    """Axis of the mesh's frame that points up when the object stands on the table."""
    frames: int | None = None
    """Length at 30 frames a second, 2 to 150; None draws one that suits the sentence."""
    steps: int = STEPS
    """Denoising steps, 1 to 1,000."""
    guidance: float = GUIDANCE
    """Classifier-free guidance scale, 0 to 10: 1 takes the prediction with the sentence, in half
    the sampling time; more extrapolates beyond it, away from the one without the sentence."""
    draws: int = DRAWS
    """Motions that are sampled, 1 to 64. The one that is kept is like the others; its hands carry
    the object and do not penetrate it deeply."""
    refine: Refiner = "geneoh"
    """How hands are refined: "paper" is one pass of Text2HOI's refiner network; "geneoh" then also
    brings hands to the surface that they hold and cleans them with `geneoh.denoise`; or "none"."""
    weights: Path | None = None
    """Folder of networks, as `geneoh train` writes it; missing ones are the shipped ones."""
    text_encoder: Path | None = None
    """Folder of a CLIP or sentence-transformers model, for networks that were trained with it."""
    seed: int = 0
    """Seed of all random numbers; another one makes another interaction."""
    device: str = "cpu"
    """Device of the networks and the cleaner, as torch names it. Results are on the CPU."""

    def __post_init__(self) -> None:
        """Take paths given as text, and refuse values that no setting has."""
        check_fields(self, GENERATION)


@dataclass(frozen=True, eq=False, repr=False)
class Generated(ByValue):
    """An interaction that was made for a sentence. As text it is what the command prints."""

    sequence: Sequence
    """Hands and object, world frame with z up, the table at z = 0, 30 frames a second."""
    contact: Float[Tensor, " V"]
    """Contact map that the hands were made for: probability of contact at each mesh vertex."""
    prompt: Prompt
    refined: Denoised | None
    """The result of the cleaner; None if it did not run."""

    _repr_pretty_ = show_text

    def __str__(self) -> str:
        made, hands = self.sequence, " and ".join(hand.side for hand in self.sequence.hands)
        length = f"{numbered(made.frames, 'frame')}, {made.frames / made.fps:.1f} s"
        lines = [f"note: {note}" for note in self.prompt.notes]
        lines.append(f"{self.prompt.verb} with the {hands} hand: {length}")
        lines += self.refined.measures() if self.refined else ()
        return "\n".join(lines)

    def extra_arrays(self) -> Arrays:
        """`contact` (V,), `prompt`, `verb` and `notes` (N,), for `geneoh.save`."""
        notes = (*self.prompt.notes, *(self.refined.notes_on_made_hands() if self.refined else ()))
        return {
            "contact": self.contact.numpy(),
            "prompt": np.array(self.prompt.sentence),
            "verb": np.array(self.prompt.verb),
            "notes": np.array(notes, str),
        }


@checked_call
def generate(
    sentence: str,
    mesh: MeshInput,
    options: GenerateOptions | None = None,
    *,
    joint: Joint | str | None = None,
    on_progress: OnProgress | None = None,
) -> Generated:
    """Make hands do with an object what a sentence says.

        made = geneoh.generate("lift the mug with the left hand", "mug.obj")
        geneoh.view(made)

    Args:
        sentence: such as "pour from the kettle with the right hand"; English, of one action.
        mesh: the object or its file, metres; or two for the parts of an object in its closed state,
            in one frame, the resting part first.
        options: see `GenerateOptions`.
        joint: how the second part moves, a `Joint` or its text such as "hinge:0,0.05,0.07:-1,0,0"
            (see `geneoh.geometry.joint.FORM`); None finds the joint from the meshes.
        on_progress: called for the stage "motion" and for those of the cleaner.

    Raises:
        InputError: the sentence is empty, not English or contradicts itself, the object is too
            large or too small for hands, or parts and joint do not fit each other.
        ConfigError: the options are invalid, or they name no device of this machine.
        CheckpointError: weights are missing or damaged.
    """
    chosen = GenerateOptions() if options is None else options
    options = given_options(chosen, GenerateOptions, "geneoh.generate")
    device = named_device(options.device)
    meshes = meshes_of(mesh)
    known = asked_joint(meshes, joint)
    prompt = read_prompt(sentence, frames=options.frames, jointed=len(meshes) > 1)
    networks = load_text2hoi(options.weights, text_encoder=options.text_encoder, device=device)
    points = seeded_generator(options.seed, "points")
    stood = stand_on_table(joined(meshes), options.up, generator=points)
    notes: tuple[str, ...] = ()
    jointed: JointedObject | None = None
    if len(meshes) == 2 and prompt.verb in JOINTED:
        pair = meshes[0], meshes[1]
        jointed, notes = JointedObject.of(pair, stood, known, closes=prompt.verb == "close")
        stood = jointed.stood
    actions, contact = _sampled(networks, prompt, stood, jointed, options, on_progress)
    if jointed is not None:
        actions = jointed.guided(actions)
    elif missed_motion(actions) > 0:
        fault = "hands are not always at the object while it should move, and it then rests"
        notes = (fault_note(options.draws, fault),)
    if options.refine != "none":
        actions = refined_by(load_refiner(options.weights), actions, contact)
    hold = seeded_generator(options.seed, "hold")
    settles = options.refine == "geneoh"
    if jointed is not None:
        actions, faults = jointed.finished(actions, hold if settles else None)
        notes = (*notes, *faults)
    else:
        settle = partial(settled, stood=stood, generator=hold)
        actions = kept_on_table(actions, prompt.verb)
        actions = finished(actions, settle if settles else None)
    notes = (*notes, *missing_notes(actions, prompt, options.draws))
    prompt = replace(prompt, notes=(*prompt.notes, *notes))
    sequence, refined = placed_sequence(actions, stood, meshes, prompt.sentence), None
    if options.refine == "geneoh":
        refined = _cleaned(sequence, options, on_progress)
        sequence = replace(refined.sequence, source=sequence.source)
    return Generated(sequence, stood.on_vertices(contact[0]), prompt, refined)


def _sampled(
    networks: Text2HoiNetworks,
    prompt: Prompt,
    stood: StandingObject,
    jointed: JointedObject | None,
    options: GenerateOptions,
    on_progress: OnProgress | None,
) -> tuple[Actions, Float[Tensor, "1 P"]]:
    """What the networks make of a prompt: one action, and the probability of contact at each point
    of the object.

    In a length that the verb does not have in training, networks do something else. So the action
    is sampled in the nearest usual length, and then brought to the requested one.
    """
    usual = _lengths_of(networks, prompt, options)
    frames = options.frames or prompt.frames or usual[0]
    learned = min(max(frames, min(usual)), max(usual))
    objects = stood.objects if jointed is None else jointed.objects
    actions, contact = sample_actions(
        networks,
        objects.to(options.device),
        [prompt.network_text],
        [prompt.hands],
        torch.tensor([learned]),
        Text2HoiSampling(steps=options.steps, guidance=options.guidance, draws=options.draws),
        generator=seeded_generator(options.seed, "motion"),
        giver=[prompt.giver],
        fitting=None if jointed is None else jointed.reached,
        on_step=on_progress and partial(on_progress, "motion"),
    )
    actions = actions.to("cpu")
    if learned != frames:
        actions = retimed(actions, torch.tensor([frames]))
    return actions, contact.to("cpu")


def _cleaned(
    sequence: Sequence, options: GenerateOptions, on_progress: OnProgress | None
) -> Denoised:
    """The sequence after `geneoh.denoise`, from rest to rest."""
    # no tracker lost these hands: a hand that stands still at the object is intended
    cleaning = Options(trust_object=True, seed=options.seed, device=options.device)
    refined = clean_interaction(sequence, cleaning, on_progress)
    # the cleaner may leave a hand in motion at either end, so that time is eased again
    last = sequence.frames - 1.0
    return result_at_times(refined, eased_time(sequence.frames, torch.tensor([[last]]))[0])


def _lengths_of(networks: Text2HoiNetworks, prompt: Prompt, options: GenerateOptions) -> list[int]:
    """Random numbers of frames that suit the sentence."""
    text = networks.text.encode([prompt.network_text])
    generator = seeded_generator(options.seed, "length")
    return [int(networks.length.sample(text, generator=generator)) for _ in range(LENGTHS)]


def placed_sequence(
    actions: Actions, stood: StandingObject, meshes: tuple[Mesh, ...], sentence: str
) -> Sequence:
    """The first action as a sequence, with the poses of the meshes in the frames of their files."""
    sequence = action_sequence(actions, meshes, f"generated: {sentence}")
    moved = [rigid_part(actions, part) for part in range(len(meshes))]
    poses = zip(*map(stood.poses, moved), strict=True)
    rotation, translation = (torch.stack(each, 1)[: sequence.frames] for each in poses)
    motion = replace(sequence.object, rotation=rotation, translation=translation)
    return replace(sequence, object=motion)


def action_sequence(actions: Actions, meshes: tuple[Mesh, ...], source: str = "") -> Sequence:
    """The first action as a sequence with hands of the mean shape and the object.

    `meshes` has one mesh for each part, in the object frame of `Actions`; with one mesh the joint
    is ignored.
    """
    frames = slice(int(actions.length[0]))
    hands = tuple(
        HandTrack(
            side=side,
            valid=actions.valid[0, frames],
            pose=actions.pose[0, number, frames],
            wrist=actions.wrist[0, number, frames],
            betas=torch.zeros(10),
            hand_model="embedded",
        )
        for number, side in enumerate(SIDES)
        if bool(actions.hands[0, number])
    )
    rotation, translation = actions.part_poses()
    parts = slice(len(meshes))
    track = ObjectTrack(meshes, rotation[0, frames, parts], translation[0, frames, parts])
    return Sequence(hands, track, FPS, source)
