"""A model as bytes that a database keeps: its dataclasses as JSON, its arrays beside it, in one
npz.

Not pickles: a worker of a later version may read it.
"""

import io
import json
import types
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from typing import Any, Union, get_args, get_origin, get_type_hints

import numpy as np

from modalbase.formats.models.matrices import MatrixModel
from modalbase.formats.models.model import FiniteElementModel
from service.compute.models.matrices import matrices_of

_ARRAY = "array"


def kept(model: FiniteElementModel) -> bytes:
    """The model as an npz that numpy reads without pickles."""
    arrays: dict[str, Any] = {}
    text = json.dumps(_packed(model, arrays))
    buffer = io.BytesIO()
    np.savez_compressed(buffer, model=np.frombuffer(text.encode(), dtype=np.uint8), **arrays)
    return buffer.getvalue()


def model_of(data: bytes) -> FiniteElementModel | MatrixModel:
    """The model of `kept` or of `kept_matrices`."""
    with np.load(io.BytesIO(data), allow_pickle=False) as arrays:
        if "model" not in arrays.files:
            return matrices_of({name: arrays[name] for name in arrays.files})
        packed = json.loads(arrays["model"].tobytes())
        model = _unpacked(FiniteElementModel, packed, {name: arrays[name] for name in arrays.files})
    assert isinstance(model, FiniteElementModel)
    return model


def _packed(value: Any, arrays: dict[str, Any]) -> Any:
    if isinstance(value, np.ndarray):
        name = f"a{len(arrays)}"
        arrays[name] = value
        return {_ARRAY: name}
    if is_dataclass(value):
        return {field.name: _packed(getattr(value, field.name), arrays) for field in fields(value)}
    if isinstance(value, Mapping):
        return [[key, _packed(inner, arrays)] for key, inner in value.items()]
    if isinstance(value, tuple | list):
        return [_packed(inner, arrays) for inner in value]
    return value.item() if isinstance(value, np.generic) else value


def _unpacked(kind: Any, value: Any, arrays: Mapping[str, Any]) -> Any:
    """A value of an annotated type."""
    if isinstance(value, dict) and value.keys() == {_ARRAY}:
        return arrays[value[_ARRAY]]
    origin, inner = get_origin(kind), get_args(kind)
    if origin in (Union, types.UnionType):
        return None if value is None else _unpacked(_chosen(inner, value), value, arrays)
    if isinstance(kind, type) and is_dataclass(kind):
        return kind(
            **{
                name: _unpacked(hint, value[name], arrays)
                for name, hint in _hints(kind).items()
                if name in value
            }
        )
    if origin is tuple:
        kinds = inner[:1] * len(value) if inner[-1] is Ellipsis else inner
        return tuple(_unpacked(each, one, arrays) for each, one in zip(kinds, value, strict=True))
    if isinstance(origin, type) and issubclass(origin, Mapping):
        return {key: _unpacked(inner[1], one, arrays) for key, one in value}
    return value


def _chosen(kinds: tuple[Any, ...], value: Any) -> Any:
    """Which of several types a packed value is of: a dataclass by its members."""
    candidates = [kind for kind in kinds if kind is not type(None)]
    if len(candidates) > 1:
        return next(
            kind for kind in candidates if {field.name for field in fields(kind)} >= set(value)
        )
    return candidates[0]


@cache
def _hints(kind: type) -> dict[str, Any]:
    return get_type_hints(kind)
