"""A second device for machines without one: data of the CPU that count as being elsewhere.

Inside `with PretendedDevice() as device:` a factory that is given `device=device`, and
`tensor.to(device)`, make tensors of that device. They keep their numbers on the CPU and obey the
rules of CUDA: operations that mix them with CPU tensors fail, as do `numpy()` and draws with a
generator of the CPU. As on CUDA, CPU tensors without an axis may be operands and CPU tensors may
index. Every other tensor, also one made without `device=`, is of the CPU.
"""

from collections.abc import Callable, Iterable
from typing import Any

import torch
from torch import Tensor
from torch.overrides import TorchFunctionMode
from torch.utils._pytree import tree_map_only

DEVICE = torch.device("privateuseone:0")
"""A device type that torch keeps free for others; nothing is registered for it here."""
INTO_NUMPY = ("numpy", "__array__", "__dlpack__")
ACROSS_DEVICES = ("copy_", "_has_compatible_shallow_copy_type")
"""Functions that may be given tensors of both devices."""
NO_SCALARS = ("cat", "stack", "concat", "matmul", "__matmul__", "bmm", "einsum")
"""Operations in which even a CPU tensor without an axis must not meet the device's."""


class OnDevice(Tensor):
    """A tensor that counts as being on `DEVICE`."""

    @property
    def device(self) -> torch.device:
        return DEVICE

    @classmethod
    def __torch_function__(cls, func, types, args=(), kwargs=None):
        return checked_call(func, args, kwargs or {})


class PretendedDevice(TorchFunctionMode):
    """Makes `DEVICE` usable inside a `with` statement, in this thread."""

    def __torch_function__(self, func, types, args=(), kwargs=None):
        return checked_call(func, args, kwargs or {})

    def __enter__(self) -> torch.device:
        # a module that moves takes new parameters, as their class says which device they are on
        self._kept = torch.__future__.get_overwrite_module_params_on_conversion()
        torch.__future__.set_overwrite_module_params_on_conversion(True)
        super().__enter__()
        return DEVICE

    def __exit__(self, *error: object) -> None:
        super().__exit__(*error)
        torch.__future__.set_overwrite_module_params_on_conversion(self._kept)


def checked_call(func: Callable, args: tuple, kwargs: dict[str, Any]) -> Any:
    """The result of a function of torch, on the device that its arguments ask for."""
    name = getattr(func, "__name__", "")
    tensors = _tensors_in([*args, *kwargs.values()])
    there = [tensor for tensor in tensors if isinstance(tensor, OnDevice)]
    if name in ("to", "cpu", "cuda", "type_as") and tensors:
        return _moved(name, *args, **kwargs)
    if there and name in INTO_NUMPY:
        raise TypeError(
            f"can't convert {DEVICE} device type tensor to numpy. Use Tensor.cpu() first"
        )
    if there:
        _refuse_mixture(name, args, tensors)
    asked = kwargs.get("device")
    on_device = bool(there) if asked is None else torch.device(asked).type == DEVICE.type
    if asked is not None:
        kwargs = {**kwargs, "device": "cpu"}
    generator = kwargs.get("generator")
    if on_device and generator is not None:
        raise RuntimeError(
            f"Expected a '{DEVICE.type}' device type for generator but found '{generator.device}'"
        )
    with torch._C.DisableTorchFunctionSubclass():
        found = func(*args, **kwargs)
        if isinstance(found, Tensor):
            return _placed(found, on_device)
        if isinstance(found, (list, tuple)):
            return tree_map_only(Tensor, lambda tensor: _placed(tensor, on_device), found)
        return found


def _tensors_in(values: Iterable[Any]) -> list[Tensor]:
    """All tensors among arguments and in lists of them; pytree does the same more slowly."""
    found = []
    for value in values:
        if isinstance(value, Tensor):
            found.append(value)
        elif isinstance(value, (list, tuple)):
            found += _tensors_in(value)
    return found


def _placed(tensor: Tensor, on_device: bool) -> Tensor:
    """The same tensor, differentiable, as one of the device or of the CPU."""
    if isinstance(tensor, OnDevice) == on_device:
        return tensor
    return tensor.as_subclass(OnDevice if on_device else Tensor)


def _moved(name: str, tensor: Tensor, *args: Any, **kwargs: Any) -> Tensor:
    """`Tensor.to` and its like; a move between devices copies, as on CUDA."""
    dtype = tensor.dtype
    if name == "cpu":
        target = torch.device("cpu")
    elif name == "cuda":
        raise AssertionError("Torch not compiled with CUDA enabled")
    elif args and isinstance(args[0], Tensor):
        target, dtype = args[0].device, args[0].dtype
    else:
        asked, asked_dtype, _, _ = torch._C._nn._parse_to(
            *args, **{key: value for key, value in kwargs.items() if key != "copy"}
        )
        target, dtype = asked or tensor.device, asked_dtype or dtype
    on_device = target.type == DEVICE.type
    with torch._C.DisableTorchFunctionSubclass():
        changes = isinstance(tensor, OnDevice) != on_device
        found = Tensor.to(tensor, dtype, copy=changes or kwargs.get("copy", False))
        return _placed(found, on_device)


def _refuse_mixture(name: str, args: tuple, tensors: list[Tensor]) -> None:
    """Raise what CUDA raises where tensors of two devices meet."""
    if name in ("__getitem__", "__setitem__"):
        indexed, value = args[0], args[2] if len(args) > 2 else None
        fits = isinstance(indexed, OnDevice)
        if fits and isinstance(value, Tensor):
            fits = isinstance(value, OnDevice) or value.ndim == 0
    elif name in ACROSS_DEVICES:
        return
    else:
        strict = name in NO_SCALARS
        fits = all(isinstance(t, OnDevice) or (t.ndim == 0 and not strict) for t in tensors)
    if not fits:
        raise RuntimeError(
            f"Expected all tensors to be on the same device, but found at least two devices, "
            f"{DEVICE} and cpu, in {name}"
        )
