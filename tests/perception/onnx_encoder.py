"""Encoder of small ONNX models: the protobuf messages that the tests of the adapter need, by field numbers.

Field numbers are those of onnx.proto3 of the ONNX project.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

FLOAT, UINT8, INT64 = 1, 2, 7
_TYPES = {np.dtype(np.float32): FLOAT, np.dtype(np.int64): INT64}


def varint(value: int) -> bytes:
    """Base-128 number, least significant group first."""
    parts = []
    while value > 0x7F:
        parts.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes([*parts, value])


def field(number: int, value: int | str | bytes) -> bytes:
    """One field: a number as a varint, a text or message with its length."""
    if isinstance(value, int):
        return varint(number << 3) + varint(value)
    data = value.encode() if isinstance(value, str) else value
    return varint(number << 3 | 2) + varint(len(data)) + data


def tensor(name: str, array: NDArray) -> bytes:
    """TensorProto: dims 1, data_type 2, name 8, raw_data 9."""
    dims = b"".join(field(1, size) for size in array.shape)
    return dims + field(2, _TYPES[array.dtype]) + field(8, name) + field(9, array.tobytes())


def value_info(name: str, kind: int, shape: Sequence[int | str]) -> bytes:
    """ValueInfoProto: name 1, type 2; a dimension has a value (1) or a name (2)."""
    dims = b"".join(field(1, field(1 if isinstance(size, int) else 2, size)) for size in shape)
    return field(1, name) + field(2, field(1, field(1, kind) + field(2, dims)))


def node(operator: str, inputs: Sequence[str], output: str, **attributes: int | Sequence[int]) -> bytes:
    """NodeProto: input 1, output 2, op_type 4, attribute 5 (a number has type 2, a list of them type 7)."""
    parts = [*(field(1, name) for name in inputs), field(2, output), field(4, operator)]
    for name, value in attributes.items():
        if isinstance(value, int):
            body = field(3, value) + field(20, 2)
        else:
            body = b"".join(field(8, number) for number in value) + field(20, 7)
        parts.append(field(5, field(1, name) + body))
    return b"".join(parts)


def model(
    nodes: Sequence[bytes],
    inputs: Sequence[bytes],
    outputs: Sequence[bytes],
    weights: Mapping[str, NDArray],
    metadata: Mapping[str, str],
) -> bytes:
    """ModelProto of opset 17: ir_version 1, graph 7, opset_import 8, metadata_props 14."""
    graph = b"".join(
        [
            *(field(1, one) for one in nodes),
            field(2, "graph"),
            *(field(5, tensor(name, array)) for name, array in weights.items()),
            *(field(11, one) for one in inputs),
            *(field(12, one) for one in outputs),
        ]
    )
    props = b"".join(field(14, field(1, key) + field(2, text)) for key, text in metadata.items())
    return field(1, 8) + field(7, graph) + field(8, field(2, 17)) + props
