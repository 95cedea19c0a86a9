"""The pretended device refuses what CUDA refuses: without that, tests on it would prove nothing."""

import pytest
import torch
from pretended_device import DEVICE, PretendedDevice

HERE = torch.ones(3)


@pytest.fixture(autouse=True)
def there():
    with PretendedDevice():
        yield torch.ones(3, device=DEVICE)


def test_tensors_are_where_they_are_made_or_moved(there):
    assert HERE.device.type == "cpu"
    made = (there, HERE.to(DEVICE), HERE.to(there), there.new_zeros(2), torch.zeros_like(there))
    assert all(tensor.device == DEVICE for tensor in made)
    derived = (there + 1, there[:2], there.double(), there.max(0).values, torch.stack([there] * 2))
    assert all(tensor.device == DEVICE for tensor in derived)
    assert torch.zeros(3).device.type == "cpu"
    assert there.cpu().device.type == there.to("cpu").device.type == "cpu"
    assert there.to(HERE).device.type == "cpu"


def test_a_move_copies(there):
    back = there.cpu()
    back += 1
    assert there.tolist() == [1, 1, 1]


@pytest.mark.parametrize(
    "mixture",
    [
        lambda there: there + HERE,
        lambda there: HERE * there,
        lambda there: torch.cat([there, HERE]),
        lambda there: torch.stack([there[0], HERE[0]]),
        lambda there: torch.where(HERE > 0, there, 0.0),
        lambda there: there @ HERE,
        lambda there: torch.nn.functional.linear(there, torch.ones(2, 3)),
        lambda there: HERE[there.long()],
        lambda there: there.index_select(0, torch.tensor([0])),
        lambda there: there.__setitem__(slice(2), HERE[:2]),
    ],
)
def test_operations_do_not_mix_devices(there, mixture):
    with pytest.raises(RuntimeError, match="Expected all tensors to be on the same device"):
        mixture(there)


def test_a_number_of_the_cpu_and_its_indices_may_be_used(there):
    assert (there * torch.tensor(2.0)).tolist() == [2, 2, 2]
    assert there[torch.tensor([0, 1])].device == DEVICE
    assert there[HERE > 0].device == DEVICE


def test_numbers_do_not_leave_the_device_as_numpy(there):
    with pytest.raises(TypeError, match=r"Use Tensor\.cpu"):
        there.numpy()
    assert float(there.sum()) == 3


def test_a_generator_of_the_cpu_draws_on_the_cpu_only(there):
    generator = torch.Generator().manual_seed(0)
    with pytest.raises(RuntimeError, match="for generator"):
        torch.randn(3, generator=generator, device=DEVICE)
    with pytest.raises(RuntimeError, match="for generator"):
        there.normal_(generator=generator)
    assert torch.randn(3, generator=generator).to(DEVICE).device == DEVICE


def test_modules_move_and_learn(there):
    layer = torch.nn.Linear(3, 2).to(DEVICE)
    assert layer.weight.device == DEVICE
    assert isinstance(layer.weight, torch.nn.Parameter)
    layer(there).sum().backward()
    assert layer.weight.grad.device == DEVICE
    before = layer.weight.detach().clone()
    torch.optim.AdamW(layer.parameters()).step()
    assert not torch.equal(layer.weight, before)
    assert layer.to("cpu").weight.device.type == "cpu"
