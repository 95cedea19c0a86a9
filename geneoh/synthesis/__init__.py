"""Interactions to learn from: analytic objects, grasps found on them, motion, shards on disk.

How near they are to a real recording (examples/taco_clean.npz, a left hand, measured as its
mirror image; 768 clips of 80 shards, seed 0). Numbers are 5%, median and 95%; KS is
the Kolmogorov-Smirnov distance, 0 for the same distribution and 1 for none in common:

| | real | made | KS |
|---|---|---|---|
| wrist speed, world, m/s | 0.04, 0.22, 0.54 | 0.00, 0.05, 0.97 | 0.46 |
| wrist acceleration, world, m/s² | 1.3, 5.2, 16 | 0.0, 0.29, 8.0 | 0.73 |
| wrist speed, object, m/s | 0.03, 0.18, 0.52 | 0.001, 0.003, 0.29 | 0.78 |
| wrist acceleration, object, m/s² | 1.2, 5.6, 17 | 0.004, 0.012, 1.1 | 0.93 |
| fingertip speed, world, m/s | 0.04, 0.27, 0.73 | 0.00, 0.08, 0.94 | 0.39 |
| fingertip acceleration, world, m/s² | 1.3, 6.5, 18 | 0.01, 0.47, 7.7 | 0.70 |
| fingertip speed, object, m/s | 0.04, 0.19, 0.71 | 0.002, 0.006, 0.35 | 0.69 |
| fingertip acceleration, object, m/s² | 1.3, 6.5, 18 | 0.007, 0.024, 1.7 | 0.87 |
| index base flexion, degrees | 19, 45, 56 | 4, 22, 65 | 0.54 |
| ring middle flexion, degrees | 10, 40, 72 | 5, 28, 79 | 0.24 |
| thumb end flexion, degrees | 10, 34, 64 | 3, 12, 32 | 0.61 |
| skin in contact, cm² | 31, 64, 76 | 5, 25, 70 | 0.67 |
| fingertips in contact | 2.5, 4, 5 | 1, 3, 5 | 0.30 |
| penetration depth, mm | 2.6, 4.0, 5.5 | 0.0, 2.4, 6.9 | 0.54 |

Pairs of joint angles correlate by 0.44 in the recording and 0.25 here (mean size); the two sets of
pairs agree by 0.54. On one second of keypoints a logistic regression tells the recording from these
clips by where the hand is on the object with 0.99 accuracy, by the hand's shape and motion in the
palm's frame with 0.79, by how fast it moves with 1.00 (0.5 is chance); it tells single clips of
ours from the others with 0.99, 0.98 and 0.54. So a second of a hand is harder to tell than one of
our own clips, but its motion is not: ours are smooth and still in the object's frame where the
recording jitters (14 snippets of one recording: little evidence). Training makes hands livelier
(`geneoh.training.variety`) and adds the noise itself.

What the engine does not make: fingers that work scissors or pliers (a hand that holds both parts
keeps them still), objects that slide in the hand, palms that roll. A hand that comes or goes passes
through the object by more than 5 mm in one frame of a hundred.

Made by `geneoh synthesize` and `geneoh realism examples/taco_clean.npz --obj
examples/taco_object.obj`, which prints every joint angle. Depth and contact are of the hand's skin;
the checks of a grasp (3 mm) are on spheres along the bones, which fill the palm less: at the moment
of the grasp the skin is deeper than 5 mm in one clip of seven, most often on cartons and hammers.
"""
