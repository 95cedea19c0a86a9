import pytest
import torch
from short_clips import example

from geneoh.metrics.contact import TOUCH
from geneoh.sequence.noise import corrupt_sequence
from tools.finger_contact import Contacts, compared, constants, row


def drawn(share: float, least: float, nearer: float) -> Contacts:
    """Fingers whose true distance differs from that of the result as the constants say."""
    generator = torch.Generator().manual_seed(0)
    found = 0.02 * torch.rand(4000, 5, generator=generator) - 0.005
    spread = 0.03 * torch.rand(4000, 5, generator=generator)
    width = ((share * spread) ** 2 + least**2).sqrt()
    true = found - nearer + width * torch.randn(4000, 5, generator=generator)
    return Contacts(found, found, true, torch.zeros(4000, 5), spread)


def test_constants_that_made_the_contacts_are_found():
    share, least, nearer = constants([drawn(0.2, 0.002, 0.001)])
    assert share == pytest.approx(0.2, abs=0.03)
    assert least == pytest.approx(0.002, abs=0.0005)
    assert nearer == pytest.approx(0.001, abs=0.0002)


def test_a_line_has_the_scores_of_input_result_and_probability():
    near, far = torch.zeros(2, 5), torch.full((2, 5), 2 * TOUCH)
    halves = torch.cat([near, far])
    every = Contacts(far[:1].expand(4, 5), halves, halves, torch.full((4, 5), 0.6), halves)
    # no contact of the input, all of the result, and all fingers of which half touch
    assert row([every]) == "0.50 | 0.00 | 1.00 | 0.67 | 0.260 | 0.250"


@pytest.mark.slow
def test_a_noisy_recording_is_compared_with_the_clean_one():
    clean = example()[60:70]
    noisy = corrupt_sequence(clean, "gauss", generator=torch.Generator().manual_seed(0))
    found = compared(clean, noisy, 0)
    assert found.given.shape == found.found.shape == found.probability.shape == (10, 5)
    assert float(found.touching.float().mean()) > 0.5
    assert not torch.equal(found.given, found.found)
