import torch
from draws import seeded
from made_bodies import tiny_networks
from made_gestures import made_gestures

from geneoh.evaluation.gestures.encoder import Seen
from geneoh.evaluation.gestures.runner import made_by_networks, mean_pose, nearest_body, shuffled
from geneoh.generators.both2hands.sampling import Both2HandsSampling


def test_every_row_keeps_the_bodies_of_the_real_clips():
    real, training = made_gestures(4), made_gestures(6, seed=1)
    rows = (
        shuffled(real, generator=seeded()),
        mean_pose(real, training),
        nearest_body(real, training, (Seen.of(real), Seen.of(training))),
        made_by_networks(
            tiny_networks(),
            real,
            ["wave"] * 4,
            config=Both2HandsSampling(steps=1, branch="blended"),
            generator=seeded(),
        ),
    )
    for made in rows:
        assert torch.equal(made.root, real.root)
        torch.testing.assert_close(made.rotations[:, :, :22], real.motion.rotations[:, :, :22])
        assert made.rotations.shape == real.motion.rotations.shape


def test_shuffled_hands_are_all_of_another_clip():
    real = made_gestures(5)
    hands = real.motion.rotations[:, :, 22:]
    made = shuffled(real, generator=seeded(3)).rotations[:, :, 22:]
    apart = (made[:, None] - hands[None]).abs().amax((2, 3, 4, 5))
    assert sorted(apart.argmin(1).tolist()) == [0, 1, 2, 3, 4]
    assert (apart.argmin(1) != torch.arange(5)).all()


def test_the_mean_pose_never_moves_and_is_that_of_training():
    real, training = made_gestures(2), made_gestures(6, seed=1)
    made = mean_pose(real, training).rotations[:, :, 22:]
    assert (made - made[:1, :1]).abs().max() < 1e-6
    training.pose[1, 15:] += 1.0  # behind the end of the second clip
    torch.testing.assert_close(mean_pose(real, training).rotations[:, :, 22:], made)


def test_the_nearest_body_of_a_training_clip_is_its_own():
    training = made_gestures(6)
    real = training.take(torch.tensor([4, 1]), "B")
    found = nearest_body(real, training, (Seen.of(real), Seen.of(training)))
    torch.testing.assert_close(found.rotations, real.motion.rotations)
