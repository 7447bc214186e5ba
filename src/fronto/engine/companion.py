"""Heads: small networks whose files lie beside the network's that they are for."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from fronto.engine.onnxfile import OnnxFile
from fronto.errors import InputError

__all__ = [
    "HeadKind",
    "check_companion",
    "companion_stem",
    "find_companion",
    "replace_companion",
]

#: Which heads there are: of finds (`fronto.relations`), of their masks (`fronto.maskhead`), and of
#: labels (`fronto.labels.context`).
HeadKind = Literal["relations", "masks", "context"]


def companion_stem(network: Path, kind: HeadKind = "relations") -> str:
    """Beginning of the name of a network's head, up to its digits."""
    return f"{network.stem}.{kind}"


def find_companion(network: Path, kind: HeadKind = "relations") -> Path | None:
    """The head that lies beside a network's file; None where there is none.

    The relation head of ``fronto-seg-1a2b3c4d.onnx`` is
    ``fronto-seg-1a2b3c4d.relations-5e6f7a8b.onnx``, its mask head
    ``fronto-seg-1a2b3c4d.masks-5e6f7a8b.onnx``; the context head of a reader's
    ``fronto-read-1a2b3c4d.onnx`` is ``fronto-read-1a2b3c4d.context-5e6f7a8b.onnx``.

    Raises
    ------
    InputError
        If there is more than one.
    """
    start = f"{companion_stem(network, kind)}-"
    try:
        found = [f for f in network.parent.iterdir() if f.name.startswith(start)]
    except OSError:  # the network itself tells what is wrong with the folder
        return None
    found = [f for f in found if f.suffix == ".onnx"]
    if len(found) > 1:
        names = ", ".join(sorted(f.name for f in found))
        raise InputError(
            f"weights {network}",
            f"expected one file {start}*.onnx beside it, got {names}",
            "delete the others",
        )
    return found[0] if found else None


def check_companion(file: OnnxFile, network: str) -> None:
    """Check that a head is for the network that begins so (eight digits of its SHA-256).

    Raises
    ------
    InputError
        If it is for another one.
    """
    made_for = file.metadata.get("network", "")
    if made_for != network:
        raise InputError(
            f"{file.thing}, network",
            f"expected a head for {network}, got one for {made_for or 'none'}",
            "train one for this network, or delete the file to do without",
        )


def replace_companion(path: Path, stem: str) -> None:
    """Delete the other heads of the kind of a new one, whose name begins so, beside it."""
    for old in path.parent.glob(f"{stem}-*.onnx"):
        if old != path:
            old.unlink()
