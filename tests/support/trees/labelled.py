"""A recording of H2O with labels of actions, in which a hand touches the object."""

from dataclasses import replace
from pathlib import Path

from trees import scene
from trees.videos import h2o

GRAB_MILK, POUR_MILK = 5, 23
"""Labels of H2O."""


def labelled_h2o(root: Path, *numbers: int) -> None:
    """Write one recording, with an action of 30 frames for each number of a label."""
    s = scene(frames=30 * len(numbers))
    move = s.rotation @ [0.03, 0.0, 0.0] + s.shift - s.joints["right"][:, 8]
    s = replace(s, wrist={**s.wrist, "right": s.wrist["right"] + move})
    s = replace(s, joints={**s.joints, "right": s.joints["right"] + move[:, None]})
    h2o(root, s, False)
    labels = root / "subject1/h1/0/cam4/action_label"
    labels.mkdir()
    for frame in range(30 * len(numbers)):
        (labels / f"{frame:06d}.txt").write_text(str(numbers[frame // 30]))
