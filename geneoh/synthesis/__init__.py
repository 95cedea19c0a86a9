"""Interactions to learn from: analytic objects, grasps found on them, motion, shards on disk.

How near they are to a real recording (examples/taco_clean.npz, a left hand, measured as its
mirror image; 768 clips of 80 shards, seed 0). Numbers are 5%, median and 95%; KS is
the Kolmogorov-Smirnov distance, 0 for the same distribution and 1 for none in common:

| | real | made | KS |
|---|---|---|---|
| wrist speed, world, m/s | 0.04, 0.22, 0.54 | 0.00, 0.04, 0.97 | 0.47 |
| wrist acceleration, world, m/s² | 1.3, 5.2, 16 | 0.0, 0.27, 8.0 | 0.73 |
| wrist speed, object, m/s | 0.03, 0.18, 0.52 | 0.001, 0.003, 0.28 | 0.80 |
| wrist acceleration, object, m/s² | 1.2, 5.6, 17 | 0.004, 0.012, 1.0 | 0.94 |
| fingertip speed, world, m/s | 0.04, 0.27, 0.73 | 0.00, 0.08, 0.95 | 0.40 |
| fingertip acceleration, world, m/s² | 1.3, 6.5, 18 | 0.01, 0.44, 7.7 | 0.70 |
| fingertip speed, object, m/s | 0.04, 0.19, 0.71 | 0.002, 0.006, 0.34 | 0.71 |
| fingertip acceleration, object, m/s² | 1.3, 6.5, 18 | 0.006, 0.022, 1.6 | 0.88 |
| index base flexion, degrees | 19, 45, 56 | 4, 20, 55 | 0.58 |
| ring middle flexion, degrees | 10, 40, 72 | 5, 24, 69 | 0.33 |
| thumb end flexion, degrees | 10, 34, 64 | 3, 13, 34 | 0.58 |
| skin in contact, cm² | 31, 64, 76 | 6, 23, 65 | 0.72 |
| fingertips in contact | 2.5, 4, 5 | 1, 4, 5 | 0.12 |
| penetration depth, mm | 2.6, 4.0, 5.5 | 0.0, 2.1, 7.0 | 0.58 |

Pairs of joint angles correlate by 0.44 in the recording and 0.25 here (mean size); the two sets of
pairs agree by 0.65. On one second of keypoints a logistic regression tells the recording from these
clips by where the hand is on the object with 0.99 accuracy, by the hand's shape and motion in the
palm's frame with 0.71, by how fast it moves with 1.00 (0.5 is chance); it tells single clips of
ours from the others with 0.99, 0.95 and 0.50. So a second of a hand is harder to tell than one of
our own clips, but its motion is not: ours are smooth and still in the object's frame where the
recording jitters (14 snippets of one recording: little evidence). Training makes hands livelier
(`geneoh.training.variety`) and adds the noise itself.

Made by `geneoh synthesize` and `geneoh realism examples/taco_clean.npz --obj
examples/taco_object.obj`, which prints every joint angle. Depth and contact are of the hand's skin;
the checks of a grasp (3 mm) are on spheres along the bones, which fill the palm less: at the moment
of the grasp the skin is deeper than 5 mm in one clip of seven, most often on cartons and hammers.
"""
