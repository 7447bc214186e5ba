"""What `fronto rectify` says about its results."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from fronto.cli.shared import counted

if TYPE_CHECKING:
    from fronto.panelfile import PanelFiles
    from fronto.results import Panel

__all__ = ["all_unsure", "outline_notes", "verdict"]


def all_unsure(panel: Panel, count: int) -> Panel:
    """Say why there was nothing to solve, though there are outlines."""
    subject = "the only outline is" if count == 1 else f"all {count} outlines are"
    reasons = (f"{subject} marked unsure; --include-unsure uses {'it' if count == 1 else 'them'}",)
    return replace(panel, reasons=reasons, pose=replace(panel.pose, reasons=reasons))


def outline_notes(stated: str, name: str, skipped: int, unused: int) -> tuple[str, ...]:
    """Remarks on an outlines file: another photo's name, what of it was left out."""
    notes = []
    if stated and Path(stated).name != name:
        notes.append(f"the outlines state another photo: {stated}")
    if skipped:
        notes.append(f"{counted(skipped, 'unsure outline')} left out")
    if unused:
        notes.append(f"{counted(unused, 'line')} left out: the grid search does not use them")
    return tuple(notes)


def verdict(panel: Panel, files: PanelFiles) -> str:
    """One line: the status and why, the rotation, how many buttons, where the picture is."""
    parts = [panel.status + (f" ({'; '.join(panel.reasons)})" if panel.reasons else "")]
    if panel.view is not None:
        angles = " ".join(f"{angle:.1f}" for angle in panel.pose.angles_deg)
        std = max(panel.pose.std_deg)
        parts.append(f"rotation {angles} deg" + (f" ±{std:.1f}" if std == std else ""))
    parts.append(counted(len(panel.buttons), "button"))
    parts.append(f"camera {panel.pose.camera.source}")
    shown = click.format_filename(files.rectified or files.overlay)
    return f"{panel.image}: {', '.join(parts)} -> {shown}"
