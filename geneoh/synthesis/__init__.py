"""Interactions to learn from: analytic objects, grasps found on them, motion, shards on disk.

How near they are to a real recording (examples/taco_clean.npz, a left hand, measured as its
mirror image; 768 clips of 80 shards, seed 0), as they are made and as networks learn from them,
with the unrest of `geneoh.training.augmentation`. Numbers are 5%, median and 95%; KS is the
Kolmogorov-Smirnov distance, 0 for the same distribution and 1 for none in common. Speed in m/s,
acceleration in m/s², in the frame of world or object:

| | real | made | KS | learned from | KS |
|---|---|---|---|---|---|
| wrist speed, world | 0.04, 0.22, 0.54 | 0.00, 0.05, 0.97 | 0.46 | 0.00, 0.18, 1.03 | 0.20 |
| wrist acceleration, world | 1.3, 5.2, 16 | 0.0, 0.29, 8.0 | 0.73 | 0.0, 2.6, 14 | 0.31 |
| wrist speed, object | 0.03, 0.18, 0.52 | 0.001, 0.003, 0.29 | 0.78 | 0.00, 0.10, 0.49 | 0.25 |
| wrist acceleration, object | 1.2, 5.6, 17 | 0.004, 0.012, 1.1 | 0.93 | 0.01, 1.9, 12 | 0.39 |
| tip speed, world | 0.04, 0.27, 0.73 | 0.00, 0.08, 0.94 | 0.39 | 0.01, 0.17, 0.96 | 0.22 |
| tip acceleration, world | 1.3, 6.5, 18 | 0.01, 0.47, 7.7 | 0.70 | 0.1, 2.4, 11 | 0.39 |
| tip speed, object | 0.04, 0.19, 0.71 | 0.002, 0.006, 0.35 | 0.69 | 0.00, 0.10, 0.44 | 0.28 |
| tip acceleration, object | 1.3, 6.5, 18 | 0.007, 0.024, 1.7 | 0.87 | 0.0, 1.9, 8.9 | 0.47 |
| index base flexion, degrees | 19, 45, 56 | 4, 22, 65 | 0.54 | 4, 24, 71 | 0.50 |
| ring middle flexion, degrees | 10, 40, 72 | 5, 28, 79 | 0.24 | 5, 29, 83 | 0.22 |
| thumb end flexion, degrees | 10, 34, 64 | 3, 12, 32 | 0.61 | 4, 15, 37 | 0.55 |
| skin in contact, cm² | 31, 64, 76 | 5, 25, 70 | 0.67 | 4, 27, 87 | 0.62 |
| fingertips in contact | 2.5, 4, 5 | 1, 3, 5 | 0.30 | 0, 2, 5 | 0.54 |
| penetration depth, mm | 2.6, 4.0, 5.5 | 0.0, 2.4, 6.9 | 0.54 | 0.0, 4.9, 20 | 0.39 |

Pairs of joint angles correlate by 0.44 in the recording, 0.25 as made and 0.20 as learned from
(mean size); the pairs of made hands agree with it by 0.54 and 0.52. On one second of keypoints a
logistic regression tells the recording from made clips by where the hand is on the object with
0.99 accuracy, by the hand's shape and motion in the palm's frame with 0.79, by how fast it moves
with 1.00 (0.5 is chance); it tells single made clips from the others with 0.99, 0.98 and 0.54:
made clips are smooth and still in the object's frame where the recording jitters. As learned
from, it is 0.99, 1.00 and 0.96 for the recording, 0.99, 0.88 and 0.91 for single clips: by its
motion the recording is hardly easier to tell than a clip of ours. The price is that restless
hands lose hold with a finger and sink deeper. (14 snippets of one recording: little evidence.)

What the engine does not make: fingers that work scissors or pliers (a hand that holds both parts
keeps them still), objects that slide in the hand, palms that roll. A hand that comes or goes passes
through the object by more than 5 mm in one frame of a hundred.

Made by `geneoh synthesize` and `geneoh realism examples/taco_clean.npz --obj
examples/taco_object.obj`, with `--augmented` for what is learned from; it prints every joint angle.
Depth and contact are of the hand's skin; the checks of a grasp (3 mm) are on spheres along the
bones, which fill the palm less: at the moment of the grasp the skin is deeper than 5 mm in one
clip of seven, most often on cartons and hammers.
"""
