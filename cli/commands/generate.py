"""`geneoh generate`: a sentence and a mesh, or a body, become hands that do what it says."""

from pathlib import Path
from typing import Any

import click
from click import Choice

from geneoh.choices import AXES, DRAWS, GENERATION, GUIDANCE, REFINERS, STEPS

from .. import bodies, options, progress


@click.command()
@click.argument("sentence")
@options.many(
    "--obj: Mesh file of the object. Give it twice for an object of two parts, closed and in one "
    "frame, first the part that rests; then it can be opened and closed.",
    options.FILE,
)
@options.option(
    "--joint: How the second part moves, in metres of that frame: hinge:X,Y,Z:AX,AY,AZ turns about "
    "an axis through a point by the right-hand rule, slide:AX,AY,AZ slides; :DEGREES or "
    ":CENTIMETRES behind it says how far.  [default: as found from the meshes]"
)
@options.option(
    "--body: Moving body to give hands: npz by smplx names or of AMASS, BVH, BOTH57M, Motion-X.",
    options.FILE,
)
@options.many(
    "-o --output outputs: File to write, .npz; with --body also .bvh and .glb, and may be "
    "repeated. One that geneoh wrote before is replaced when the new one is complete.",
    options.FILE,
)
@options.overwrite
@options.option(
    "--up: Axis that points up: of the mesh when it stands, by default z; of the body's world, by "
    "default as its file or its spine says.",
    Choice(AXES),
)
@options.unit
@options.option(
    "--frames: Length at 30 frames a second.  [default: as the sentence says]",
    click.IntRange(*GENERATION["frames"]),
)
@options.option("--steps: Denoising steps.", click.IntRange(*GENERATION["steps"]), STEPS)
@options.option(
    "--guidance: How much more the sentence counts than it was learned to; 1 is plain.",
    click.FloatRange(*GENERATION["guidance"]),
    GUIDANCE,
)
@options.option(
    "--draws: Motions to draw; one is kept whose hands carry the object, like the others and not "
    "deep in it.",
    click.IntRange(*GENERATION["draws"]),
    DRAWS,
)
@options.option(
    "--refine: What mends hands that hold an object: paper is the refiner of Text2HOI; after it "
    "geneoh brings them to the surface and cleans them as `geneoh denoise` does; none leaves them "
    "as the network made them.",
    Choice(REFINERS),
    "geneoh",
)
@options.option(
    "--weights: Folder of networks of `geneoh train` to use instead of the shipped ones.",
    options.FOLDER,
)
@options.option(
    "--text-encoder: Folder of a CLIP or sentence-transformers model, for networks of --weights "
    "that were trained with it.",
    options.FOLDER,
)
@bodies.reading_options
@options.seed
@options.device
def generate(
    sentence: str,
    obj: tuple[Path, ...],
    joint: str | None,
    body: Path | None,
    outputs: tuple[Path, ...],
    overwrite: bool,
    unit: Any,
    **chosen: Any,
) -> None:
    """Make hands that do what SENTENCE says, with an object (--obj) or on a body (--body).

    With --obj, such as "lift the mug with the left hand": writes hands, the poses of the object,
    `contact`, the probability that each vertex of the mesh is touched, `prompt` and `verb`. Known
    verbs: lift, put down, carry, slide, rotate, pour, tilt, shake, inspect, press, pass, and with
    the parts of an object open and close; sentences with others are taken for the nearest one.

    With --body, such as "the right hand waves, the left rests": writes both hands of the body, and
    the body with its fingers under smplx names. An object that the body's file holds, or --obj with
    --object-pose, makes the hands go through the cleaner.

    `geneoh view` shows both, and `geneoh denoise` takes them. Without -o the file stands beside the
    mesh, with `_generated` added to its name, or beside the body, with `_hands`. SENTENCE may also
    be a text file, as @FILE.
    """
    bodies.refuse_others(body, obj)
    files = {"outputs": outputs, "overwrite": overwrite, "unit": unit}
    if body is not None:
        bodies.make_hands(sentence, body, obj=obj, **files, **chosen)
        return
    from geneoh.errors import InputError
    from geneoh.files.outputs import check_outputs

    output, *more = outputs or (obj[0].with_name(f"{obj[0].stem}_generated.npz"),)
    if more:
        raise InputError(f"{more[0]}: expected one file with --obj, got {len(outputs)}; name one")
    check_outputs([output], endings=(".npz",), inputs=obj, overwrite=overwrite)

    from geneoh.generators.sentences import prompt_text
    from geneoh.generators.text2hoi.generate import GenerateOptions, generate
    from geneoh.geometry.mesh_files import meshes_of
    from geneoh.pipeline.results import save

    meshes = meshes_of(obj, unit)
    own = {name: value for name, value in chosen.items() if name not in bodies.FOR_BODIES}
    settings = GenerateOptions(up=own.pop("up") or "z", **own)
    words = prompt_text(sentence)
    with progress.progress_bars() as on_progress:
        made = generate(words, meshes, settings, joint=joint, on_progress=on_progress)
    save(made, output, overwrite=overwrite)
    click.echo(made)
    click.echo(f"wrote {output}")
