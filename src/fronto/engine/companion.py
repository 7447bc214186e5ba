"""Files beside a network's: heads, which are small networks for it, and it itself in 8 bits."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from fronto.engine.onnxfile import OnnxFile, file_digest, on_processor
from fronto.errors import InputError

__all__ = [
    "QUANTIZED_OF",
    "CompanionKind",
    "check_companion",
    "companion_stem",
    "find_companion",
    "open_network",
    "replace_companion",
]

#: What there is: heads of finds (`fronto.relations`), of their masks (`fronto.maskhead`) and these
#: masks' edges (`fronto.outlines.edgeprofiles`), a second opinion on finds (`fronto.verification`),
#: heads of labels (`fronto.labels.context`), and the network itself with whole numbers
#: (`fronto.train.quantize`).
CompanionKind = Literal["relations", "verifier", "masks", "edges", "context", "int8"]


#: Metadata key of a network in 8 bits: the file that it was made from ("network" is its options).
QUANTIZED_OF = "quantized_of"


def companion_stem(network: Path, kind: CompanionKind = "relations") -> str:
    """Beginning of the name of a file beside a network's, up to its digits."""
    return f"{network.stem}.{kind}"


def find_companion(network: Path, kind: CompanionKind = "relations") -> Path | None:
    """The file of a kind that lies beside a network's; None where there is none.

    The relation head of ``fronto-seg-1a2b3c4d.onnx`` is
    ``fronto-seg-1a2b3c4d.relations-5e6f7a8b.onnx``, its verifier
    ``fronto-seg-1a2b3c4d.verifier-5e6f7a8b.onnx``, its mask head
    ``fronto-seg-1a2b3c4d.masks-5e6f7a8b.onnx``, its edge head
    ``fronto-seg-1a2b3c4d.edges-5e6f7a8b.onnx``; the context head of a reader's
    ``fronto-read-1a2b3c4d.onnx`` is ``fronto-read-1a2b3c4d.context-5e6f7a8b.onnx``; the network in
    8 bits is ``fronto-seg-1a2b3c4d.int8-5e6f7a8b.onnx``.

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


def check_companion(file: OnnxFile, network: str, key: str = "network") -> None:
    """Check that a file is for the network that begins so (eight digits of its SHA-256).

    It says so in its metadata, under this key.

    Raises
    ------
    InputError
        If it is for another one.
    """
    made_for = file.metadata.get(key, "")
    if made_for != network:
        raise InputError(
            f"{file.thing}, {key}",
            f"expected one for {network}, got one for {made_for or 'none'}",
            "make one for this network, or delete the file to do without",
        )


def open_network(
    path: Path,
    format_: str,
    threads: int | None,
    providers: Sequence[str] | None,
    int8: bool | None,
) -> tuple[OnnxFile, str, bool]:
    """A network's file, or the one in 8 bits beside it.

    Parameters
    ----------
    path
        The network's file.
    format_
        What its metadata must say.
    threads, providers
        As of `OnnxFile`.
    int8
        Whether 8 bits are wanted, where there is such a file; None: on the processor.

    Returns
    -------
    The file that is to run, the first eight hexadecimal digits of the SHA-256 of the network's own,
    and whether the one that is to run is in 8 bits.

    Raises
    ------
    InputError
        If a file is missing, damaged or of another format, or the one in 8 bits is of another
        network.
    """
    quantized = None
    if int8 or (int8 is None and on_processor(providers)):
        quantized = find_companion(path, "int8")
    file = OnnxFile(quantized or path, format_, threads, providers)
    if quantized is None:
        return file, file.digest, False
    digest = file_digest(path)
    check_companion(file, digest, QUANTIZED_OF)
    return file, digest, True


def replace_companion(path: Path, stem: str) -> None:
    """Delete the other files of the kind of a new one, whose name begins so, beside it."""
    for old in path.parent.glob(f"{stem}-*.onnx"):
        if old != path:
            old.unlink()
