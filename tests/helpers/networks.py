"""Small image networks in ONNX files, made by the package `onnx`."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

WEIGHTS = np.random.default_rng(3).normal(size=(3, 5)).astype(np.float32)


def write_network(
    path: Path,
    nodes: Sequence[tuple[Any, ...]],
    *,
    shape: Sequence[int | str] = ("N", 3, 16, 24),
    outputs: Sequence[str] = ("out",),
    weights: dict[str, NDArray[Any]] | None = None,
    kind: str = "FLOAT",
    more_inputs: Sequence[str] = (),
) -> Path:
    """A network with the input `image` and these nodes: (operation, inputs, outputs, attributes)."""
    from onnx import TensorProto, helper, numpy_helper, save

    element = getattr(TensorProto, kind)
    made = [
        helper.make_node(operation, list(inputs), list(outs), name=f"{operation}_{outs[0]}", **dict(*attributes))
        for operation, inputs, outs, *attributes in nodes
    ]
    graph = helper.make_graph(
        made,
        "a test",
        [helper.make_tensor_value_info(name, element, shape) for name in ("image", *more_inputs)],
        [helper.make_tensor_value_info(name, element, None) for name in outputs],
        [numpy_helper.from_array(values, name) for name, values in (weights or {}).items()],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 13)], ir_version=8)
    path.parent.mkdir(parents=True, exist_ok=True)
    save(model, str(path))
    return path


MEAN = ("GlobalAveragePool", ["image"], ["pooled"])
FLAT = ("Flatten", ["pooled"], ["flat"])
PRODUCT = ("MatMul", ["flat", "W"], ["out"])


def mean_network(path: Path, **options: Any) -> Path:
    """The mean of each channel by WEIGHTS: five numbers, called out."""
    return write_network(path, [MEAN, FLAT, PRODUCT], weights={"W": WEIGHTS}, **options)


def looking_network(path: Path, size: int = 32) -> Path:
    """Twelve random filters, how strongly each one answers in the corners of the picture: 48 numbers, called seen."""
    filters = np.random.default_rng(5).normal(size=(12, 3, 5, 5)).astype(np.float32)
    nodes: list[tuple[Any, ...]] = [
        ("Conv", ["image", "F"], ["answers"], {"kernel_shape": [5, 5], "strides": [2, 2], "pads": [2, 2, 2, 2]}),
        ("Relu", ["answers"], ["strong"]),
        ("AveragePool", ["strong"], ["corners"], {"kernel_shape": [size // 4] * 2, "strides": [size // 4] * 2}),
        ("Flatten", ["corners"], ["seen"]),
        ("MatMul", ["seen", "W"], ["logits"]),
    ]
    rest = np.random.default_rng(6).normal(size=(48, 3)).astype(np.float32)
    shape = ("N", 3, size, size)
    return write_network(path, nodes, shape=shape, outputs=["logits"], weights={"F": filters, "W": rest})
