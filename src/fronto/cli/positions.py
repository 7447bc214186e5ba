"""Options that tell a length on or to the panel, and so where its buttons are in metres."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from fronto.cli.shared import FILE, POSITIVE
from fronto.errors import InputError

if TYPE_CHECKING:
    from fronto.metric import KnownLength
    from fronto.pose import Template
    from fronto.results import Panel

__all__ = ["LengthSource", "length_source", "position_options", "template_option"]

Command = TypeVar("Command", bound=Callable[..., Any])

DEPTH_SUFFIXES = (".npy", ".png", ".tif", ".tiff")


#: Which option says which field of `KnownLength`.
FLAGS = {
    "button_size_m": "--button-size",
    "pitch_m": "--pitch",
    "depth": "--depth-at",
    "distance_m": "--distance",
    "std_m": "--length-std",
}


Callback = Callable[[click.Context, click.Parameter, str | None], Any]


def _numbers(
    counts: tuple[int, ...], example: str, *, gaps: bool = False, names: bool = False
) -> Callback:
    """What parses "45", "45,52" or "320,240,0.52" to a tuple of numbers.

    Parameters
    ----------
    counts
        How many there may be.
    example
        For the message.
    gaps
        One may be left out (",52"), which gives None.
    names
        Anything but numbers is a name, which stays as it is.
    """

    def parse(ctx: click.Context, param: click.Parameter, value: str | None) -> Any:
        if value is None or (names and not re.fullmatch(r"[\s\d.,x×]*", value)):
            return value
        parts = [part.strip() for part in re.split(r"[,x×]", value)]
        try:
            parsed = tuple(None if gaps and not part else float(part) for part in parts)
        except ValueError:
            parsed = ()
        if len(parsed) not in counts or all(number is None for number in parsed):
            raise click.BadParameter(f"expected numbers such as {example}, got {value!r}")
        return parsed

    return parse


def position_options(command: Command) -> Command:
    """Options that state a length; `length_source` takes what they give out of the arguments."""
    for option in (
        click.option(
            "--length-std",
            type=POSITIVE,
            metavar="MM",
            help="Standard deviation of that length.  [default: 5 % of a size, 1 % of a depth or "
            "distance]",
        ),
        click.option(
            "--distance",
            callback=_numbers((1, 3), "0.5 or 320,240,0.52"),
            metavar="[X,Y,]METRES",
            help="Distance of the panel's plane from the camera; with X,Y along that pixel's ray.",
        ),
        click.option(
            "--depth",
            type=FILE,
            metavar="FILE|DIR",
            help="Depth image registered to the photo: .npy, PNG or TIFF; floats are metres, "
            "uint16 millimetres. A folder with <stem>.npy, .png or .tiff for each of several.",
        ),
        click.option(
            "--depth-at",
            callback=_numbers((3,), "320,240,0.52"),
            metavar="X,Y,METRES",
            help="Depth along the optical axis at a pixel of the photo, on the panel.",
        ),
        click.option(
            "--pitch",
            callback=_numbers((1, 2), "45, 45,52 or ,52", gaps=True),
            metavar="MM[,MM]",
            help="From one button's centre to the next: to the right, down; one number where "
            "they are the same.",
        ),
        click.option(
            "--button-size",
            callback=_numbers((1, 2), "30 or 30,40", names=True),
            metavar="MM[,MM]|NAME",
            help="Width and height of most buttons; one number where they are square or round.",
        ),
    ):
        command = option(command)
    return command


#: ``--template``, which states lengths, and names the buttons.
template_option = click.option(
    "--template",
    "template_file",
    type=FILE,
    metavar="FILE",
    help="The panel's layout in millimetres, where it is known; buttons that are found get its "
    "labels.",
)


@dataclass(frozen=True)
class LengthSource:
    """What the options say, the same for all photos; can be sent to other processes.

    Parameters
    ----------
    fields
        Of :class:`fronto.metric.KnownLength`, in metres.
    depth
        A depth image, or a folder with one for each photo.
    """

    fields: tuple[tuple[str, Any], ...] = ()
    depth: Path | None = None

    def __bool__(self) -> bool:
        """Whether a length is stated."""
        return self.depth is not None or any(name != "std_m" for name, _ in self.fields)

    def check(self) -> None:
        """Say once, before any work, what is wrong with what all photos share.

        Raises
        ------
        InputError
            Naming the option or the file.
        """
        if self.depth is None or not self.depth.is_dir():
            self.known(Path())

    def depth_file(self, photo: Path) -> Path | None:
        """The depth image of one photo; None where none are stated.

        Raises
        ------
        InputError
            If the folder has none for it.
        """
        if self.depth is None or not self.depth.is_dir():
            return self.depth
        for suffix in DEPTH_SUFFIXES:
            if (path := self.depth / f"{photo.stem}{suffix}").is_file():
                return path
        raise InputError(
            f"--depth {self.depth}",
            f"expected a depth image {photo.stem}.npy, .png or .tiff in it, there is none",
            "add it, or leave the photo out",
        )

    def known(self, photo: Path, template: Template | None = None) -> KnownLength:
        """What is known of one photo's panel; nothing where nothing is stated.

        Parameters
        ----------
        photo
            Its file.
        template
            The panel's layout, where it is known; only if no option states a length.

        Raises
        ------
        InputError
            If a length or a depth image cannot be used.
        """
        from fronto.metric import KnownLength
        from fronto.metric.depthimage import read_depth

        fields = dict(self.fields)
        path = self.depth_file(photo)
        if path is not None:
            fields["depth"] = read_depth(path)
        return KnownLength(**fields, template=template)

    def fill(self, panel: Panel, photo: Path, template: Template | None = None) -> Panel:
        """A result with its buttons' positions, as of :func:`fronto.positions.with_positions`.

        Parameters
        ----------
        panel
            The photo's result.
        photo, template
            As of `known`. A template that the pose was solved with need not be given again.

        Raises
        ------
        InputError
            As of `known`.
        """
        from fronto.positions import with_positions

        return with_positions(panel, self.known(photo, template))


def length_source(options: dict[str, Any], template_file: Path | None = None) -> LengthSource:
    """Take what `position_options` add out of a command's arguments.

    Parameters
    ----------
    options
        The command's arguments; those of `position_options` are removed.
    template_file
        That of ``--template``, which states a length as well.

    Raises
    ------
    click.UsageError
        If several lengths are stated, or a deviation of none.
    InputError
        If a number is no such length, or a name no known size.
    """
    names = ("button_size", "pitch", "depth_at", "depth", "distance", "length_std")
    given = {name: value for name in names if (value := options.pop(name)) is not None}
    std = given.pop("length_std", None)
    flags = ["--" + name.replace("_", "-") for name in given]
    if template_file is not None:
        flags.append("--template")
    if len(flags) > 1:
        raise click.UsageError(f"give one of {' and '.join(flags)}")
    if std is not None and not flags:
        raise click.UsageError("--length-std needs a length, such as --pitch")
    fields: dict[str, Any] = {}
    if "button_size" in given:
        size = given["button_size"]
        fields |= _named(size) if isinstance(size, str) else {"button_size_m": _metres(size)}
    if "pitch" in given:
        fields["pitch_m"] = _metres(given["pitch"])
    if "depth_at" in given:
        fields["depth"] = given["depth_at"]
    if "distance" in given:
        numbers = given["distance"]
        fields["distance_m"] = numbers[0] if len(numbers) == 1 else numbers
    if std is not None:
        fields["std_m"] = 1e-3 * std
    _check(fields)
    return LengthSource(tuple(fields.items()), given.get("depth"))


def _check(fields: dict[str, Any]) -> None:
    from fronto.metric import KnownLength

    try:
        KnownLength(**fields)
    except InputError as error:
        flag = FLAGS.get(error.thing, error.thing)
        raise InputError(flag, error.expected, "check the number and its unit") from None


def _metres(millimetres: tuple[float | None, ...]) -> Any:
    metres = tuple(None if value is None else 1e-3 * value for value in millimetres)
    return metres[0] if len(metres) == 1 else metres


def _named(name: str) -> dict[str, Any]:
    """Fields of a size that the library knows."""
    from fronto.sizes import known_size

    size = known_size(name.strip().lower())
    return {"button_size_m": size.size_m, "std_m": size.std_m}
