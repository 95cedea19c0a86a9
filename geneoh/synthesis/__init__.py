"""Synthetic interactions to learn from: analytic objects, grasps on them, motion, shards on disk.

docs/training.md tells how close they are to a real recording. They have no fingers that work
scissors or pliers (a hand that holds both parts keeps them still), no objects that slide in the
hand and no palms that roll. The checks of a grasp are on spheres along the bones, which fill the
palm less than the skin does: at the moment of the grasp the skin is deeper than 5 mm in one clip of
seven, most often on cartons and hammers; a hand that comes or goes passes through the object by
more than that in one frame of a hundred.
"""
