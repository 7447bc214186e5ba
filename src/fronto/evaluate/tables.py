"""The report as Markdown tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isinf, isnan
from typing import TYPE_CHECKING

from fronto.evaluate.scores import FOUND_LABELS, TRUE_LABELS, Score

if TYPE_CHECKING:
    from fronto.evaluate.labels import LabelReport, LabelScore
    from fronto.evaluate.report import SegmentationReport

__all__ = ["label_tables", "markdown_table", "report_tables"]


def markdown_table(rows: Sequence[Mapping[str, str]]) -> str:
    """A table with a column for each key of the first row; "" without rows."""
    if not rows:
        return ""
    keys = list(rows[0])
    lines = ["| " + " | ".join(keys) + " |", "|" + "---|" * len(keys)]
    lines += ["| " + " | ".join(row[key] for key in keys) + " |" for row in rows]
    return "\n".join(lines)


def report_tables(report: SegmentationReport) -> str:
    """Every figure of a report that is not about a single photo, as Markdown."""
    overlap = "boxes" if report.by == "box" else "outlines"
    quartiles = " / ".join(map(_number, report.iou_quartiles))
    figures = {
        "photos": str(len(report.images)),
        f"IoU of {overlap} found: quartile / median / quartile": quartiles,
        "named right, of the buttons found": _number(report.category_accuracy),
        "plates reported as buttons": _number(report.plates_as_buttons),
        "buttons reported as plates": _number(report.buttons_as_plates),
        "time per photo, median": f"{_number(report.time_ms, 1)} ms",
    }
    if not isnan(report.mean_iou):
        parts = ", ".join(f"{name} {_number(value)}" for name, value in report.pixel_iou.items())
        figures["mIoU of pixels"] = f"{_number(report.mean_iou)} ({parts})"
    buttons = [
        {"": name} | _score(score) | {"AP": _number(ap)}
        for name, score, ap in (
            ("buttons, as labelled", report.buttons, report.average_precision),
            (
                "buttons, missing labels known",
                report.buttons_reviewed,
                report.average_precision_reviewed,
            ),
        )
    ]
    return "\n\n".join(
        [
            markdown_table([*buttons, {"": "plates", **_score(report.plates), "AP": ""}]),
            markdown_table([{"": name, "value": value} for name, value in figures.items()]),
            markdown_table(_sizes(report)),
            markdown_table(_categories(report)),
            markdown_table(_curve(report)),
            "Labelled (rows) and reported as (columns):",
            markdown_table(_confusion(report)),
        ]
    )


def label_tables(report: LabelReport) -> str:
    """What buttons are called, as Markdown: all, by class, by size, by source."""
    all_of = {"all": report.all}
    if any(not told.legible for told in report.told):
        all_of["legible by themselves"] = report.legible
    sizes = {
        f"{low:g} or more"
        if isinf(high)
        else f"{low:g} to {high:g}"
        if low
        else f"below {high:g}": s
        for low, high, s in report.sizes
        if s.labels
    }
    figures = {
        "photos": str(len(report.photos)),
        "found without a label that could be read": str(len(report.silent)),
        "of these called something": _number(report.invented),
        "time per photo, median": f"{_number(report.time_ms, 1)} ms",
    }
    tables = [
        markdown_table(_labels("labels", all_of)),
        markdown_table([{"": name, "value": value} for name, value in figures.items()]),
        markdown_table(_labels("label", report.classes)),
        markdown_table(_labels("shorter side, px", sizes)),
        markdown_table(_labels("said by", report.sources, missed=False)),
    ]
    return "\n\n".join(filter(None, tables))


def _labels(
    title: str, scores: Mapping[str, LabelScore], *, missed: bool = True
) -> list[dict[str, str]]:
    return [
        {
            title: name,
            **({"labelled": str(score.labels)} if missed else {}),
            "found": str(score.found),
            "right": _number(score.share("right")),
            "wrong": _number(score.share("wrong")),
            "declined": _number(score.share("declined")),
        }
        for name, score in scores.items()
    ]


def _number(value: float, digits: int = 3) -> str:
    return "–" if isnan(value) else f"{value:.{digits}f}"


def _score(score: Score) -> dict[str, str]:
    return {
        "labelled": str(score.truths),
        "found": str(score.found),
        "false": str(score.detections - score.right),
        "precision": _number(score.precision),
        "recall": _number(score.recall),
        "F1": _number(score.f1),
    }


def _sizes(report: SegmentationReport) -> list[dict[str, str]]:
    rows = []
    for size in report.sizes:
        span = f"{size.low:g} to {size.high:g}"
        if isinf(size.high):
            span = f"{size.low:g} or more"
        elif not size.low:
            span = f"below {size.high:g}"
        rows.append({"shorter side, px": span, **_score(size.score)})
    return rows


def _categories(report: SegmentationReport) -> list[dict[str, str]]:
    return [
        {
            "category": c.category,
            "labelled": str(c.truths),
            "found": str(c.found),
            "named right": str(c.right),
            "recall": _number(c.recall),
            "precision": _number(c.precision),
        }
        for c in report.categories
    ]


def _curve(report: SegmentationReport) -> list[dict[str, str]]:
    return [
        {
            "confidence at least": f"{labelled.confidence:.2f}",
            "precision": _number(labelled.precision),
            "precision, missing labels known": _number(reviewed.precision),
            "recall": _number(labelled.recall),
        }
        for labelled, reviewed in zip(report.curve, report.curve_reviewed, strict=True)
    ]


def _confusion(report: SegmentationReport) -> list[dict[str, str]]:
    return [
        {"": label} | dict(zip(FOUND_LABELS, map(str, counts), strict=True))
        for label, counts in zip(TRUE_LABELS, report.confusion.tolist(), strict=True)
        if any(counts)
    ]
