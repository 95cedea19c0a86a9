"""The type of matrix products, in training and while tracks are cleaned."""

import pytest
import torch
from draws import seeded

from geneoh.nn.blocks import FrameTransformer
from geneoh.nn.precision import cleaning_precision, multiply_in, quick_precision


def test_less_precise_products_change_little_and_leave_the_type():
    model = FrameTransformer(16, 2, heads=2)
    x = torch.randn(2, 5, 16, generator=seeded(1))
    level = torch.tensor([0.1, -0.3])
    with torch.no_grad():
        plain = model(x, level)
        multiply_in(model, torch.bfloat16)
        less = model(x, level)
    assert less.dtype == torch.float32
    assert not torch.equal(less, plain)
    torch.testing.assert_close(less, plain, atol=0.05, rtol=0)


@pytest.mark.parametrize(
    ("units", "found"),
    [
        ({"amx_bf16": True}, torch.bfloat16),
        ({"amx_bf16": False, "avx512_bf16": True}, torch.bfloat16),
        ({"amx_bf16": False, "avx2": True}, torch.float32),
    ],
)
def test_products_are_quick_where_the_processor_has_units_for_them(monkeypatch, units, found):
    monkeypatch.setattr(torch.cpu, "get_capabilities", lambda: units, raising=False)
    assert quick_precision(torch.device("cpu")) == found


def test_a_torch_that_cannot_tell_multiplies_in_full(monkeypatch):
    monkeypatch.delattr(torch.cpu, "get_capabilities", raising=False)
    assert quick_precision(torch.device("cpu")) == torch.float32
    assert quick_precision(torch.device("meta")) == torch.float32


def test_a_track_is_cleaned_in_full_on_a_processor_that_has_units_for_less(monkeypatch):
    monkeypatch.setattr(torch.cpu, "get_capabilities", lambda: {"amx_bf16": True}, raising=False)
    assert cleaning_precision(torch.device("cpu")) == torch.float32


@pytest.mark.parametrize(("native", "found"), [(True, torch.bfloat16), (False, torch.float32)])
def test_a_track_is_cleaned_quickly_on_a_gpu_that_has_units_for_it(monkeypatch, native, found):
    monkeypatch.setattr(torch.cuda, "is_bf16_supported", lambda **asked: native)
    assert cleaning_precision(torch.device("cuda")) == found
