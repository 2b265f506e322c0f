"""How a student's answers travel to the judge: numbers, texts, lists and arrays, and nothing that could act there.

The judge sends pickles, since it is trusted.  What comes back is JSON: to unpickle it would let a student's process run
code in the judge's.  An object that is neither number nor text stays where it is, and the judge gets a number for it.
"""

from __future__ import annotations

import base64
import json
import socket
import struct
from collections.abc import Callable
from typing import Any

import numpy as np

LARGEST = 16_000_000  # bytes of one message
DEEPEST = 12  # lists in lists
CONTAINERS = {kind.__name__: kind for kind in (list, tuple, set, frozenset)}


class Thing:
    """An object in the student's process, or a member of one: ``number`` is its place there."""

    def __init__(self, number: int, member: str = "") -> None:
        self.number, self.member = number, member


class Remote(Thing):
    """One whose members are asked for by name, as a project does with ``design.predict``."""

    def __getattr__(self, name: str) -> Remote:
        if name.startswith("__"):
            raise AttributeError(name)
        return Remote(self.number, name)


def pack(value: Any, keep: Callable[[Any], int], depth: int = 0) -> Any:
    """A value as JSON can hold it.  ``keep(object)`` stores what it cannot, and returns its number."""
    if value is None or type(value) in (bool, int, float, str):
        return value
    if isinstance(value, np.ndarray) and value.dtype.kind in "biufc":
        return {"array": value.dtype.str, "shape": value.shape, "bytes": base64.b64encode(value.tobytes()).decode()}
    if isinstance(value, np.generic) and value.dtype.kind in "biufc":
        return {"scalar": pack(np.asarray(value), keep)}
    if isinstance(value, complex):
        return {"complex": [value.real, value.imag]}
    if isinstance(value, dict) and depth < DEEPEST:
        return {"dict": [[pack(key, keep, depth + 1), pack(item, keep, depth + 1)] for key, item in value.items()]}
    for kind in CONTAINERS.values():
        if isinstance(value, kind) and depth < DEEPEST:
            return {kind.__name__: [pack(item, keep, depth + 1) for item in value]}
    if isinstance(value, (int, float, str)):  # subclasses: what they are worth
        return next(kind(value) for kind in (int, float, str) if isinstance(value, kind))
    return {"object": keep(value), "type": type(value).__name__[:60]}


def unpack(packed: Any, thing: type[Thing] = Thing, depth: int = 0) -> Any:
    """The value; ``thing`` stands for an object that stayed.  Raises ValueError for what ``pack`` never writes."""
    try:
        return _unpack(packed, thing, depth)
    except (TypeError, SyntaxError, OverflowError):  # an unhashable key, no type of an array, a shape beyond all
        raise ValueError("a message that no answer looks like") from None


def _unpack(packed: Any, thing: type[Thing], depth: int) -> Any:
    if packed is None or isinstance(packed, (bool, int, float, str)):
        return packed
    if depth > DEEPEST + 1 or not isinstance(packed, dict):
        raise ValueError("a message that no answer looks like")
    match packed:
        case {"array": str(kind), "shape": list(shape), "bytes": str(data)}:
            dtype = np.dtype(kind)
            if dtype.kind not in "biufc":
                raise ValueError(f"an array of {dtype}")
            return np.frombuffer(base64.b64decode(data), dtype).reshape([int(n) for n in shape]).copy()
        case {"scalar": dict(array)}:
            return unpack(array)[()]
        case {"complex": [float(real), float(imaginary)]}:
            return complex(real, imaginary)
        case {"dict": list(items)}:
            return {unpack(key, thing, depth + 1): unpack(item, thing, depth + 1) for key, item in items}
        case {"object": int(number), "type": str(name)}:
            # Hints name the type of what came back, so the stand-in has its name.
            return type(name if name.isidentifier() else "object", (thing,), {})(number)
    for name, kind in CONTAINERS.items():
        if isinstance(items := packed.get(name), list):
            return kind(unpack(item, thing, depth + 1) for item in items)
    raise ValueError("a message that no answer looks like")


def send(link: socket.socket, message: bytes) -> None:
    """One message, its length first."""
    link.sendall(struct.pack(">Q", len(message)) + message)


def receive(link: socket.socket) -> bytes:
    """One message.  Raises EOFError when the other side is gone, ValueError when the message is too long."""
    (length,) = struct.unpack(">Q", _exactly(link, 8))
    if length > LARGEST:
        raise ValueError(f"a message of {length / 1e6:.0f} MB; at most {LARGEST / 1e6:.0f} are taken")
    return _exactly(link, length)


def _exactly(link: socket.socket, length: int) -> bytes:
    got = bytearray()
    while len(got) < length:
        piece = link.recv(min(length - len(got), 1 << 20))
        if not piece:
            raise EOFError("the other side is gone")
        got += piece
    return bytes(got)


def as_json(value: Any) -> bytes:
    """What the student's process sends."""
    return json.dumps(value).encode()


def from_json(message: bytes) -> Any:
    """What the judge reads; raises ValueError for anything but JSON (a stack that is too deep included)."""
    try:
        return json.loads(message)
    except RecursionError:
        raise ValueError("a message that no answer looks like") from None
