"""What an ONNX file says of a network, read without running any of it: input, outputs, layers.

The file is a protobuf message (onnx/onnx.proto of the ONNX specification). The few fields that are needed are picked
from its bytes, and `cut` writes them anew with a layer as the only output: releases of OpenCV name layers differently,
and some give wrong numbers for one that is no output.
"""

import hashlib
import os
import stat
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from placerec.errors import VisionError

# A file is in memory about three times while it is opened: its bytes, those that are handed on, and the weights.
_TIMES = 3
# Numbers of fields: of ModelProto, GraphProto, NodeProto, AttributeProto, TensorProto, ValueInfoProto and below.
_GRAPH = 7
_NODE, _INITIALIZER, _INPUT, _OUTPUT, _VALUE_INFO = 1, 5, 11, 12, 13
_NODE_INPUT, _NODE_OUTPUT, _NODE_NAME, _NODE_ATTRIBUTE = 1, 2, 3, 5
_ATTRIBUTE_GRAPHS = (6, 11)
_TENSOR_NAME, _TENSOR_LOCATION = 8, 14
_VALUE_NAME, _VALUE_TYPE, _TENSOR_TYPE, _ELEMENT, _SHAPE, _DIMENSION, _LENGTH = 1, 2, 1, 1, 2, 1, 1
_EXTERNAL, _FLOAT = 1, 1
_PICKLED = (b"PK\x03\x04", *(b"\x80" + bytes([protocol]) for protocol in range(2, 6)))
_REMEDY = "export the network as ONNX (docs/extend.md)"
_SHOWN = 30  # layers in a message


class _Field(NamedTuple):
    """A field of a message: its number, its value, and all its bytes."""

    number: int
    value: int | memoryview
    raw: memoryview

    @property
    def content(self) -> memoryview:
        """The value, which must be bytes; ValueError if it is a number."""
        if isinstance(self.value, int):
            raise ValueError(f"field {self.number} is a number")
        return self.value


@dataclass(frozen=True, eq=False)
class Layer:
    """A node of the graph: its name, the tensors that it needs, those that it makes, and its bytes."""

    name: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    raw: memoryview


@dataclass(frozen=True, eq=False)
class NetworkFile:
    """An ONNX file: its SHA-256, its layers in the order of computing, and the one input that is an image.

    `shape`: of the input, None where the file leaves a length open. `outputs`: the names of the network's outputs.
    `weights`: the bytes of the stored tensors, by name; `graph`, `model`: those of all else.
    """

    digest: str
    layers: tuple[Layer, ...]
    image: str
    shape: tuple[int | None, ...]
    outputs: tuple[str, ...]
    weights: dict[str, memoryview]
    graph: tuple[memoryview, ...]
    model: tuple[memoryview, ...]

    def tensor(self, name: str) -> str:
        """The tensor of this name, or the first one of the layer of this name; the first output for "".

        Raises VisionError that lists the layers if there is none.
        """
        if not name:
            return self.outputs[0]
        made = {output: output for layer in self.layers for output in layer.outputs}
        named = {layer.name: layer.outputs[0] for layer in self.layers if layer.outputs}
        if not (found := made.get(name) or named.get(name)):
            raise VisionError(f"has no layer {name!r}; {self.listed()}")
        return found

    def listed(self) -> str:
        """The layers as a message lists them: the last ones, which are nearest to the output."""
        names = [output for layer in self.layers if layer.inputs for output in layer.outputs if output]
        more = f", and {len(names) - _SHOWN} before these" if len(names) > _SHOWN else ""
        return f"its layers are {', '.join(names[-_SHOWN:])}{more}"


def memory_limit() -> int:
    """The bytes that this process may have: those of the machine, or fewer if the system says so."""
    limits = [1 << 40]
    if hasattr(os, "sysconf"):
        limits.append(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    group = Path("/sys/fs/cgroup/memory.max")
    if group.is_file() and (text := group.read_text().strip()).isdecimal():
        limits.append(int(text))
    try:
        import resource
    except ImportError:  # on Windows
        return min(limits)
    soft, _ = resource.getrlimit(resource.RLIMIT_AS)
    return min([*limits, soft] if soft != resource.RLIM_INFINITY else limits)


def read_network(path: Path) -> NetworkFile:
    """What an ONNX file holds; nothing in it is run.

    Raises VisionError that begins with the path: for a file that is missing, no ONNX, too large for the memory, made
    of pickled weights, without its weights, or of a network that takes anything but one image.
    """
    try:
        return _parsed(_bytes_of(path))
    except VisionError as error:
        raise VisionError(f"{path}: {error}") from error


def cut(file: NetworkFile, tensor: str, shape: tuple[int, ...]) -> bytes:
    """The ONNX file of a network that takes an image of `shape` and gives `tensor` alone, without what it needs not."""
    needed, kept = {tensor}, []
    for layer in reversed(file.layers):
        if needed.intersection(layer.outputs):
            needed.update(layer.inputs)
            kept.append(layer.raw)
    weights = [raw for name, raw in file.weights.items() if name in needed]
    ends = _packed(_INPUT, _value(file.image, shape)) + _packed(_OUTPUT, _value(tensor, ()))
    graph = b"".join([*file.graph, *reversed(kept), *weights, ends])
    return b"".join([*file.model, _packed(_GRAPH, graph)])


def _bytes_of(path: Path) -> bytes:
    try:
        found = path.stat()
        if not stat.S_ISREG(found.st_mode):
            raise VisionError(f"is no file; {_REMEDY}")
        if found.st_size * _TIMES > (limit := memory_limit()):
            sizes = (
                f"has {found.st_size >> 20} MiB, and {_TIMES} times as much is needed of {limit >> 20} MiB of memory"
            )
            raise VisionError(f"{sizes}; take a smaller network")
        return path.read_bytes()
    except FileNotFoundError as error:
        raise VisionError("no such file") from error
    except OSError as error:
        raise VisionError(f"cannot be read: {error.strerror}") from error
    except MemoryError as error:
        raise VisionError("is too large for the memory; take a smaller network") from error


def _parsed(data: bytes) -> NetworkFile:
    if data.startswith(_PICKLED):
        raise VisionError(f"holds pickled weights, which are never loaded, for that runs what they hold; {_REMEDY}")
    try:
        model = list(_fields(memoryview(data)))
        graph = [field for one in model if one.number == _GRAPH for field in _fields(one.content)]
        layers = tuple(_layer(field) for field in graph if field.number == _NODE)
        stored = [field for field in graph if field.number == _INITIALIZER]
        weights = {_text(field.content, _TENSOR_NAME): field.raw for field in stored}
        inputs = {_text(field.content, _VALUE_NAME): field for field in graph if field.number == _INPUT}
        outputs = tuple(_text(field.content, _VALUE_NAME) for field in graph if field.number == _OUTPUT)
        external = any(_found(field.content, _TENSOR_LOCATION) == [_EXTERNAL] for field in stored)
        images = {name: _shape(field.content) for name, field in inputs.items() if name not in weights}
    except (ValueError, IndexError) as error:
        raise VisionError(f"is no ONNX file, or it is damaged; {_REMEDY}") from error
    if not layers or not outputs:
        raise VisionError(f"is no ONNX file of a network; {_REMEDY}")
    if external:
        raise VisionError("has its weights in another file; export it with external_data=False")
    if len(images) != 1:
        raise VisionError(f"takes {len(images)} inputs ({', '.join(images)}); a network that takes one image is wanted")
    ((image, shape),) = images.items()
    if shape is None:
        raise VisionError(f"its input {image} is not of 32-bit floating point; export it in that precision")
    others = (_NODE, _INITIALIZER, _INPUT, _OUTPUT, _VALUE_INFO)
    return NetworkFile(
        hashlib.sha256(data).hexdigest(),
        layers,
        image,
        shape,
        outputs,
        weights,
        tuple(field.raw for field in graph if field.number not in others),
        tuple(field.raw for field in model if field.number != _GRAPH),
    )


def _layer(node: _Field) -> Layer:
    inputs = _texts(node.content, _NODE_INPUT)
    # What the branches of a condition or the body of a loop need from outside.
    waiting = [node.content]
    while waiting:
        for attribute in _found(waiting.pop(), _NODE_ATTRIBUTE):
            for graph in (one for number in _ATTRIBUTE_GRAPHS for one in _found(_bytes(attribute), number)):
                for inner in map(_bytes, _found(_bytes(graph), _NODE)):
                    inputs += _texts(inner, _NODE_INPUT)
                    waiting.append(inner)
    return Layer(_text(node.content, _NODE_NAME), inputs, _texts(node.content, _NODE_OUTPUT), node.raw)


def _shape(value: memoryview) -> tuple[int | None, ...] | None:
    """The lengths of an input, None for one that is left open; None if it is not of floating point."""
    for kind in map(_bytes, _found(value, _VALUE_TYPE)):
        for tensor in map(_bytes, _found(kind, _TENSOR_TYPE)):
            if _found(tensor, _ELEMENT) != [_FLOAT]:
                return None
            lengths = [_found(_bytes(one), _LENGTH) for shape in _found(tensor, _SHAPE) for one in _dimensions(shape)]
            return tuple(
                one[0] if one and isinstance(one[0], int) and 0 < one[0] < 1 << 31 else None for one in lengths
            )
    return None


def _dimensions(shape: int | memoryview) -> list[int | memoryview]:
    return _found(_bytes(shape), _DIMENSION)


def _value(name: str, shape: tuple[int, ...]) -> bytes:
    """A ValueInfoProto of a tensor of floating point."""
    lengths = b"".join(_packed(_DIMENSION, _varint(_LENGTH << 3) + _varint(length)) for length in shape)
    kind = _varint(_ELEMENT << 3) + _varint(_FLOAT) + _packed(_SHAPE, lengths)
    return _packed(_VALUE_NAME, name.encode()) + _packed(_VALUE_TYPE, _packed(_TENSOR_TYPE, kind))


def _fields(message: memoryview) -> Iterator[_Field]:
    """The fields of a protobuf message in their order; ValueError or IndexError for what is none."""
    place = 0
    while place < len(message):
        start = place
        key, place = _read_varint(message, place)
        number, wire = key >> 3, key & 7
        value: int | memoryview
        if wire == 0:
            value, place = _read_varint(message, place)
        elif wire == 2 or wire in (1, 5):
            length, place = _read_varint(message, place) if wire == 2 else (8 if wire == 1 else 4, place)
            value, place = message[place : place + length], place + length
        else:
            raise ValueError(f"wire type {wire}")
        if place > len(message) or not number:
            raise ValueError("a field is longer than its message")
        yield _Field(number, value, message[start:place])


def _read_varint(message: memoryview, place: int) -> tuple[int, int]:
    value = shift = 0
    while True:
        byte = message[place]
        value, place = value | (byte & 0x7F) << shift, place + 1
        if byte < 0x80:
            return value, place
        if (shift := shift + 7) > 63:
            raise ValueError("a number of more than 64 bits")


def _varint(value: int) -> bytes:
    found = bytearray()
    while value > 0x7F:
        found.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes([*found, value])


def _packed(number: int, content: bytes) -> bytes:
    return _varint(number << 3 | 2) + _varint(len(content)) + content


def _found(message: memoryview, number: int) -> list[int | memoryview]:
    return [field.value for field in _fields(message) if field.number == number]


def _bytes(value: int | memoryview) -> memoryview:
    if isinstance(value, int):
        raise ValueError("a number where a message belongs")
    return value


def _texts(message: memoryview, number: int) -> tuple[str, ...]:
    return tuple(bytes(_bytes(value)).decode() for value in _found(message, number))


def _text(message: memoryview, number: int) -> str:
    return (*_texts(message, number), "")[0]
