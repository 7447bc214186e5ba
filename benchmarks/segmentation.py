"""How well and how fast the packaged network finds buttons.

    make bench            all of it (a few minutes)
    python benchmarks/segmentation.py --quick      40 photos of each kind; writes nothing

`--data` holds `panels` (boxes, split valid) and `annotated` (outlines); where they are
missing, renders, speed and memory are measured, and nothing is written.
"""

from __future__ import annotations

import argparse
import hashlib
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from fronto.datasets.annotated import read_annotated
from fronto.datasets.panels import read_panels
from fronto.datasets.records import LabeledImage
from fronto.datasets.renders import labeled_render
from fronto.engine import Engine, find_weights
from fronto.evaluate import SegmentationReport, evaluate_segmentation, panels_missing
from fronto.files import json_bytes
from fronto.segmentation import segment
from fronto.segments import Segments
from network import MEGABYTE, companions, measured, renders
from pixels import costs_table
from report import SKIPPED, Target, describe_machine, markdown_table, rounded, write_between

ROOT = Path(__file__).resolve().parent.parent
DATA = ROOT.parent / "shared" / "data"
RENDERS, QUICK = 300, 40
RUNS, QUICK_RUNS = 40, 10


def evaluated(
    images: list[LabeledImage], engine: Engine, **options: Any
) -> tuple[SegmentationReport, SegmentationReport]:
    """As photos are segmented by default, and with everything that the network suspects."""

    def predict(image: LabeledImage) -> Segments:
        return segment(image.path, engine=engine)

    def suspect(image: LabeledImage) -> Segments:
        return segment(image.path, engine=engine, min_confidence=0)

    return (
        evaluate_segmentation(images, predict, **options),
        evaluate_segmentation(images, suspect, **options),
    )


def evaluated_renders(count: int, engine: Engine) -> tuple[SegmentationReport, str]:
    """Their report, and what each kind of error costs."""
    shown: dict[Path, np.ndarray] = {}

    def labeled() -> Iterator[LabeledImage]:
        for k, photo in enumerate(renders(count)):
            image = labeled_render(photo, Path(f"render/{k}"))
            shown.clear()
            shown[image.path] = photo.image
            yield image

    def predict(image: LabeledImage) -> Segments:
        return segment(shown[image.path], engine=engine)

    return evaluate_segmentation(labeled(), predict, by="mask"), costs_table(labeled(), predict)


def identity(weights: Path) -> dict[str, str]:
    content = weights.read_bytes()
    metadata = Engine(weights).metadata
    beside = {}
    for name, head in companions(weights).items():
        beside |= {
            name: head.name,
            f"{name}: sha256": hashlib.sha256(head.read_bytes()).hexdigest(),
            f"{name}: size": f"{head.stat().st_size / MEGABYTE:.1f} MB",
        }
    return {
        "file": weights.name,
        "sha256": hashlib.sha256(content).hexdigest(),
        "size": f"{len(content) / MEGABYTE:.1f} MB",
        "version": metadata.get("version", ""),
        "network": metadata.get("network", ""),
        **beside,
    }


def targets(
    panels: SegmentationReport | None,
    annotated: SegmentationReport | None,
    rendered: SegmentationReport,
    figures: dict[str, float],
) -> list[Target]:
    nan = math.nan
    on_panels, on_annotated = "panel photos, boxes: ", "annotated photos, outlines: "
    p, a = panels, annotated
    return [
        Target(on_panels + "recall", p.buttons.recall if p else nan, 0.93),
        Target(on_panels + "precision, as labelled", p.buttons.precision if p else nan, 0.90),
        Target(
            on_panels + "precision, missing labels known",
            p.buttons_reviewed.precision if p else nan,
            0.95,
        ),
        Target(
            on_panels + "plates reported as buttons",
            100 * p.plates_as_buttons if p else nan,
            2,
            True,
            ".1f",
            " %",
        ),
        Target(on_annotated + "F1", a.buttons.f1 if a else nan, 0.93),
        Target(on_annotated + "median IoU of those found", a.iou_quartiles[1] if a else nan, 0.88),
        Target("rendered panels: mIoU of pixels", rendered.mean_iou, 0.93),
        Target(
            "640x480, two threads: network and heads",
            figures["network_2_ms"],
            60,
            True,
            ".0f",
            " ms",
        ),
        Target("PyTorch and ONNX Runtime differ by", figures["parity"], 1e-4, True, ".1e"),
        Target("peak memory of one photo", figures["memory_mb"], 500, True, ".0f", " MB"),
        Target("package, unpacked", figures["package_mb"], 30, True, ".1f", " MB"),
    ]


def tables(report: SegmentationReport) -> dict[str, str]:
    """The parts of a report's Markdown by name."""
    names = ("scores", "figures", "sizes", "categories", "curve", "title", "confusion")
    return dict(zip(names, report.to_markdown().split("\n\n"), strict=True))


def main_tables(report: SegmentationReport, *names: str) -> str:
    parts = tables(report)
    return "\n\n".join(parts[name] for name in names)


def panels_text(report: SegmentationReport, suspected: SegmentationReport) -> str:
    listed = sum(map(len, panels_missing().values()))
    as_labelled, reviewed = suspected.average_precision, suspected.average_precision_reviewed
    average = (
        f"Average precision over every detection: {as_labelled:.3f} as labelled, {reviewed:.3f} "
        "with the missing labels known. Precision and recall by the least confidence (0.5 is "
        "the default):"
    )
    return "\n\n".join(
        [
            f"{len(report.images)} photos; {listed} buttons are on the list of missing labels.",
            main_tables(report, "scores", "figures", "sizes", "categories", "title", "confusion"),
            average,
            tables(suspected)["curve"],
        ]
    )


def outlines_text(report: SegmentationReport) -> str:
    text = main_tables(report, "scores", "figures", "sizes")
    if report.plates.truths == 0:
        text += (
            "\n\nNo plates are labelled in these photos: whether one was taken for a button shows "
            "in the precision only."
        )
    return text


def speed_text(figures: dict[str, float]) -> str:
    rows = [
        {
            "640x480 on the processor": name,
            "median ms": f"{figures[f'{key}_ms']:.1f}",
            "best ms": f"{figures[f'{key}_best_ms']:.1f}",
        }
        for name, key in (
            ("network and heads, 1 thread", "network_1"),
            ("the same with floats", "floats_1"),
            ("network and heads, 2 threads", "network_2"),
            ("the same with floats", "floats_2"),
            ("whole `segment()`, 2 threads", "segment"),
        )
    ]
    return (
        f"{markdown_table(rows)}\n\nLoading the network takes {figures['load_ms']:.0f} ms, once. "
        f"Peak memory of a fresh process: {figures['memory_mb']:.0f} MB. Probabilities of PyTorch "
        f"and ONNX Runtime differ by {figures['parity']:.1e} at most, sides by "
        f"{figures['parity_sides']:.1e} of themselves. Load average of the machine when this was "
        f"measured: {figures['load_average']:.1f}."
    )


def int8_text(ours: dict[str, SegmentationReport], floats: dict[str, SegmentationReport]) -> str:
    """What the network in 8 bits loses against itself with floats."""
    rows = []
    for name, reports in (("in 8 bits", ours), ("with floats", floats)):
        panels, annotated = reports["panels"], reports["annotated"]
        rows.append(
            {
                "network": name,
                "panels: recall": f"{panels.buttons.recall:.3f}",
                "precision": f"{panels.buttons.precision:.3f}",
                "missing labels known": f"{panels.buttons_reviewed.precision:.3f}",
                "plates as buttons": f"{100 * panels.plates_as_buttons:.1f} %",
                "annotated: F1": f"{annotated.buttons.f1:.3f}",
                "median IoU": f"{annotated.iou_quartiles[1]:.3f}",
            }
        )
    return markdown_table(rows)


def write(root: Path, record: dict[str, Any], texts: dict[str, str]) -> None:
    out = root / "benchmarks" / "results" / "segmentation.json"
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_bytes(json_bytes(rounded(record)))
    page = root / "docs" / "segmentation.md"
    for name in ("targets", "panels", "annotated", "renders", "pixels", "int8", "speed"):
        write_between(page, name, texts[name])
    write_between(root / "README.md", "bench:segmentation", texts["targets"])
    card = root / "src" / "fronto" / "weights" / "MODEL_CARD.md"
    write_between(card, "figures", texts["targets"])
    write_between(card, "identity", texts["identity"])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, default=DATA)
    parser.add_argument("--weights", type=Path, help="another network than the package's")
    parser.add_argument("--photos", type=int, help="only so many of each kind; writes nothing")
    parser.add_argument("--quick", action="store_true", help=f"the same as --photos {QUICK}")
    arguments = parser.parse_args()
    most = arguments.photos or (QUICK if arguments.quick else None)
    weights = arguments.weights or find_weights()
    engine = Engine(weights)
    figures = measured(weights, QUICK_RUNS if most else RUNS)
    rendered, costs = evaluated_renders(min(most or RENDERS, RENDERS), engine)
    texts = {"speed": speed_text(figures), "renders": outlines_text(rendered), "pixels": costs}
    panels = annotated = None
    if (arguments.data / "panels").is_dir():
        images = read_panels(arguments.data / "panels", "valid")[:most]
        panels, suspected = evaluated(images, engine, by="box", missing=panels_missing())
        texts["panels"] = panels_text(panels, suspected)
    if (arguments.data / "annotated").is_dir():
        images = read_annotated(arguments.data / "annotated")[:most]
        annotated, _ = evaluated(images, engine, by="mask")
        texts["annotated"] = outlines_text(annotated)
    if panels is not None and annotated is not None:
        floats = Engine(weights, int8=False)
        kinds = {
            "panels": {"by": "box", "missing": panels_missing()},
            "annotated": {"by": "mask"},
        }
        photos = {
            "panels": read_panels(arguments.data / "panels", "valid")[:most],
            "annotated": read_annotated(arguments.data / "annotated")[:most],
        }
        others = {
            name: evaluate_segmentation(
                photos[name], lambda image: segment(image.path, engine=floats), **kinds[name]
            )
            for name in kinds
        }
        texts["int8"] = int8_text({"panels": panels, "annotated": annotated}, others)
    reached = targets(panels, annotated, rendered, figures)
    machine = describe_machine()
    table = markdown_table([target.row() for target in reached])
    texts["targets"] = f"{table}\n\nMachine: {machine}."
    weights_are = identity(weights)
    texts["identity"] = markdown_table([{"": k, "value": f"`{v}`"} for k, v in weights_are.items()])
    for name, text in texts.items():
        print(f"\n## {name}\n\n{text}", flush=True)
    if panels is None or annotated is None or most is not None:
        print("\nNot all was measured: nothing written.")
        raise SystemExit(SKIPPED if most is None else 0)
    reports = {"panels": panels, "annotated": annotated, "renders": rendered}
    record = {
        "machine": machine,
        "weights": weights_are,
        "targets": [target.row() for target in reached],
        "figures": figures,
        **{name: report.to_dict() for name, report in reports.items()},
    }
    write(ROOT, record, texts)


if __name__ == "__main__":
    main()
