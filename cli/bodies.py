"""`geneoh generate --body`: hands for a moving body."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from . import options, progress

if TYPE_CHECKING:
    from geneoh.generators.both2hands.on_body import BodyWithHands

ENDINGS = (".npz", ".bvh", ".glb")
reading_options = options.together(
    options.option(
        "--skeleton: Your SMPL-H or SMPL-X model, for the exact bones of the body; without it "
        "those of its file, else of a typical adult.",
        options.FILE,
    ),
    options.option("--fps: Frames a second of the body, where its file does not say.", float),
    options.option(
        "--clip: Which body of a file with several, from 0.  [default: the first]",
        click.IntRange(min=0),
    ),
    options.option(
        "--object-pose: Poses of the object, object to the body's world, for --obj with --body: "
        "npy of (T, 4, 4) matrices, or one pose for each frame as `geneoh denoise` takes them.",
        options.FILE_OR_FOLDER,
    ),
)
FOR_OBJECTS = ("frames", "guidance", "draws", "joint")
FOR_BODIES = ("skeleton", "clip", "fps", "object_pose")
"""Parameters of `geneoh generate` that mean something only without --body, and only with it."""


def refuse_others(body: Path | None, obj: tuple[Path, ...]) -> None:
    """Refuse, by name, options that would be ignored, and a command without anything to move."""
    if body is None and not obj:
        raise click.UsageError("Missing option '--obj' or '--body'")
    if body is None:
        options.refuse(FOR_BODIES, "needs --body")
    else:
        options.refuse(FOR_OBJECTS, "has no meaning with --body")
    if body and click.get_current_context().params["refine"] == "paper":
        raise click.UsageError("--refine paper has no meaning with --body")


def make_hands(
    sentence: str,
    body: Path,
    *,
    obj: tuple[Path, ...],
    outputs: tuple[Path, ...],
    overwrite: bool,
    unit: Any,
    object_pose: Path | None,
    **chosen: Any,
) -> None:
    """Generate hands for the body in a file, write them to every output, and print a report."""
    from geneoh.files.outputs import check_outputs

    options.refuse_unit_without(obj)
    if len(obj) > 1:
        raise click.UsageError(f"--obj is of one mesh with --body, got {len(obj)}; name one")
    outputs = outputs or (body.with_name(f"{body.stem}_hands.npz"),)
    reading = {name: chosen.pop(name) for name in ("clip", "fps", "up")}
    reading["model"] = chosen.pop("skeleton")
    read = [body, *obj, object_pose, reading["model"]]
    check_outputs(outputs, endings=ENDINGS, inputs=read, overwrite=overwrite)

    from geneoh.generators.both2hands.on_body import BodyOptions, generate_on_body
    from geneoh.generators.sentences import prompt_text
    from geneoh.readers.bodies.read import object_of_body, read_body

    motion = read_body(body, **reading)
    held = object_of_body(body, motion.frames, obj=obj, object_pose=object_pose, unit=unit)
    hand_options = BodyOptions(**{n: v for n, v in chosen.items() if n not in FOR_OBJECTS})
    with progress.progress_bars() as on_progress:
        made = generate_on_body(
            prompt_text(sentence), motion, hand_options, held=held, on_progress=on_progress
        )
    for output in outputs:
        write_on_body(made, output, overwrite=overwrite)
    click.echo(made)
    for output in outputs:
        click.echo(f"wrote {output}")


def write_on_body(made: "BodyWithHands", output: Path, *, overwrite: bool) -> None:
    """Write a body with its hands in the format that the ending of the path names."""
    from geneoh.pipeline.results import save
    from geneoh.viz.look import Look
    from geneoh.viz.outputs import write
    from geneoh.viz.scene import make_scene

    if output.suffix.lower() == ".npz":
        save(made, output, overwrite=overwrite)
    else:
        scene = make_scene({output.stem: made.sequence}, body=made.body)
        write(scene, output, Look(up=scene.up))
