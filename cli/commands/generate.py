"""`geneoh generate`: a sentence and a mesh become two hands and a moving object."""

from pathlib import Path
from typing import Any

import click
from click import Choice

from geneoh.choices import AXES, REFINERS

from .. import options, progress


@click.command()
@click.argument("sentence")
@options.option("--obj: Mesh file of the object.", options.FILE, required=True)
@options.output
@options.option("--up: Axis of the mesh that points up when it stands.", Choice(AXES), "z")
@options.unit
@options.option(
    "--frames: Length at 30 frames a second.  [default: as the sentence says]",
    click.IntRange(2, 150),
)
@options.option("--steps: Denoising steps; 1000 are the paper's.", click.IntRange(1, 1000), 25)
@options.option(
    "--guidance: How much more the sentence counts than it was learned to; 1 is plain.",
    click.FloatRange(0, 10),
    1.0,
)
@options.option(
    "--refine: What mends the hands: geneoh brings them to the surface and cleans them as `geneoh "
    "denoise` does; none leaves them as the network made them.",
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
@options.seed
def generate(
    sentence: str, obj: Path, output: Path | None, overwrite: bool, unit: Any, **chosen: Any
) -> None:
    """Make hands do with an object what SENTENCE says, such as "lift the mug with the left hand".

    Writes a sequence that `geneoh view` shows and `geneoh denoise` takes: hands, the poses of the
    object, `contact`, the probability that each vertex of the mesh is touched, and `prompt`.
    Without -o it is written beside the mesh, with `_generated` added to its name. SENTENCE may also
    be a text file, as @FILE. Known verbs: lift, put down, carry, slide, rotate, pour, tilt, shake,
    inspect, press, pass; sentences with others are taken for the nearest one.
    """
    from geneoh.files.outputs import check_ending, check_outputs

    output = output or obj.with_name(f"{obj.stem}_generated.npz")
    check_ending(output, (".npz",))
    check_outputs([output], inputs=[obj], overwrite=overwrite)

    from geneoh.generators.text2hoi.generate import GenerateOptions, generate, save_generated
    from geneoh.generators.text2hoi.prompt import prompt_text
    from geneoh.geometry.mesh import load_mesh

    from .. import reports

    mesh = load_mesh(obj, unit=unit)
    with progress.progress_bars() as on_progress:
        made = generate(
            prompt_text(sentence), mesh, GenerateOptions(**chosen), on_progress=on_progress
        )
    save_generated(made, output)
    for line in reports.generated(made, output):
        click.echo(line)
