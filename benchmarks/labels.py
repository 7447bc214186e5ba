"""How well labels are told: real photos from end to end, the reader alone, labels not there.

    make bench                             all benchmarks
    python benchmarks/labels.py            this one; --quick: every 20th photo, writes nothing

Needs the panels set and the annotated photos (docs/training.md); without them nothing is
measured. RapidOCR, for comparison, runs in an environment of its own (`peers`), if it is there.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import argparse
import hashlib
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from fronto.engine import ReaderEngine, find_companion
from fronto.evaluate.labels import LabelReport, LabelScore, true_label
from fronto.evaluate.tables import label_tables
from fronto.labels.reader import LabelReader
from fronto.labels.series import FUNCTIONS, is_floor, label_key, normal_label
from labelled import DATA, alone, named, photos, shining
from reading import PYTHON, missing, read
from report import SKIPPED, Target, describe_machine, markdown_table, write_between, write_json

ROOT = Path(__file__).resolve().parent.parent
#: Confidence from which a reading alone counts as told: the same share is wrong then as RapidOCR's
#: at its own threshold, or fewer.
TRUSTED = 0.5
#: Rendered photos in which lit buttons are told.
RENDERS, QUICK_RENDERS = 250, 20


def outcome(label: str, text: str, score: float) -> str:
    told = normal_label(text)
    if not told or score < TRUSTED:
        return "declined"
    return "right" if label_key(told) == label_key(label) else "wrong"


def compared(rows: list[dict[str, Any]], python: Path) -> str:
    """Both readers on the same boxes, by what is in them."""
    reason = missing(python)
    public = [("", 0.0)] * len(rows) if reason else read([row["crop"] for row in rows], python)
    table = []
    kinds = (
        ("floors, legible", lambda r: r["legible"] and is_floor(r["label"])),
        ("symbols and words, legible", lambda r: r["legible"] and r["label"] in FUNCTIONS),
        ("floors, illegible", lambda r: not r["legible"] and is_floor(r["label"])),
    )
    for title, belongs in kinds:
        chosen = [k for k, row in enumerate(rows) if belongs(row)]
        for reader, said in (
            ("fronto", [(rows[k]["text"], rows[k]["score"]) for k in chosen]),
            ("RapidOCR", [public[k] for k in chosen]),
        ):
            if reader == "RapidOCR" and reason:
                continue
            outcomes = [
                outcome(rows[k]["label"], *one) for k, one in zip(chosen, said, strict=True)
            ]
            shares = {
                name: f"{100 * outcomes.count(name) / max(1, len(outcomes)):.1f} %"
                for name in ("right", "wrong", "declined")
            }
            table.append({"boxes": title, "": reader, "number": str(len(chosen))} | shares)
    return markdown_table(table) + (f"\n\nRapidOCR: {reason}." if reason else "")


def speed() -> float:
    """Milliseconds a button, in a batch of 64 on two threads; the least of several."""
    reader = LabelReader(ReaderEngine(threads=2))
    crop = np.random.default_rng(0).integers(0, 255, (64, 48, 48, 3), dtype=np.uint8)
    times = []
    for _ in range(12):
        begin = perf_counter()
        reader.read(crop)
        times.append(perf_counter() - begin)
    return 1e3 * min(times) / len(crop)


def identity() -> str:
    """Which files they are, for their card."""
    engine = ReaderEngine(threads=1)
    head = engine.context
    files = [("reader", engine.path, engine.metadata)]
    quantized = find_companion(engine.path, "int8")
    if quantized is not None:
        files.append(("reader in 8 bits", quantized, engine.metadata))
    if head is not None:
        files.append(("context head", head.path, head.metadata))
    rows = []
    for name, path, metadata in files:
        content = path.read_bytes()
        rows += [
            {"": name, "value": f"`{path.name}`"},
            {"": "its sha256", "value": f"`{hashlib.sha256(content).hexdigest()}`"},
            {"": "its size", "value": f"{len(content) / 1e6:.1f} MB"},
            {"": "its version", "value": metadata.get("version", "")},
        ]
    return markdown_table(rows)


def lit_table(photos: list[tuple[list[float], list[bool]]]) -> str:
    """How well `lit` tells lit buttons of rendered panels of which fewer than half are."""
    scores = np.array([score for found, _ in photos for score in found])
    truth = np.array([lit for _, states in photos for lit in states])
    some = np.array([any(states) for _, states in photos for _ in states])
    lit, dark = scores[truth], scores[some & ~truth]
    rows = []
    for limit in (0.1, 0.2, 0.3, 0.5):
        told = scores > limit
        rows.append(
            {
                "`lit` above": f"{limit:g}",
                "of the lit ones": f"{100 * told[truth].mean():.0f} %",
                "of the others": f"{100 * told[~truth].mean():.1f} %",
                "of these are lit": f"{100 * truth[told].mean():.0f} %",
            }
        )
    above = float((lit[:, None] > dark).mean())
    about = (
        f"{len(truth)} buttons of {len(photos)} rendered panels, {truth.sum()} of them lit. Of a "
        f"lit and an unlit button of panels with both, the lit one has the higher score in "
        f"{100 * above:.0f} %."
    )
    return f"{about}\n\n{markdown_table(rows)}"


def share(outcomes: list[str], name: str) -> float:
    return 100 * outcomes.count(name) / len(outcomes) if outcomes else float("nan")


def percent(score: LabelScore, name: Any) -> float:
    return 100 * score.share(name)


def targets(
    reports: dict[str, LabelReport], looked: dict[str, dict[str, list[str]]]
) -> list[Target]:
    valid, annotated = reports["valid"].legible, reports["annotated"].all
    absent = [s for one in looked.values() for s in one["absent"]]
    figures = (
        ("panel photos, buttons found, legible: right", percent(valid, "right"), 90, False),
        ("panel photos, buttons found, legible: wrong", percent(valid, "wrong"), 3, True),
        ("annotated photos, buttons found: right", percent(annotated, "right"), 85, False),
        ("annotated photos, buttons found: wrong", percent(annotated, "wrong"), 3, True),
        ("`find`, label not on the panel: some button", share(absent, "found"), 1, True),
    )
    shares = [Target(*figure, form=".1f", unit=" %") for figure in figures]
    return [*shares, Target("a button in a batch, two threads", speed(), 1.5, True, ".2f", " ms")]


def finding_table(looked: dict[str, dict[str, list[str]]]) -> str:
    rows = []
    for title, outcomes in looked.items():
        there, absent = outcomes["present"], outcomes["absent"]
        rows.append(
            {
                "photos": title,
                "on the panel": str(len(there)),
                "right": f"{share(there, 'right'):.1f} %",
                "wrong": f"{share(there, 'wrong'):.2f} %",
                "not sure": f"{share(there, 'not_sure'):.1f} %",
                "not there": f"{share(there, 'not_there'):.1f} %",
                "not on the panel": str(len(absent)),
                "some button": f"{share(absent, 'found'):.2f} %",
            }
        )
    return markdown_table(rows)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="every 20th photo; writes nothing")
    parser.add_argument(
        "--peers-python", type=Path, default=PYTHON, help="the Python that has rapidocr"
    )
    arguments = parser.parse_args()
    if not (DATA / "panels").is_dir() or not (DATA / "annotated").is_dir():
        print("skipped: no panels set and no annotated photos here\nnothing written")
        return SKIPPED
    from remember import each

    step = 20 if arguments.quick else 1
    counts = {name: range(0, len(photos(name)), step) for name in ("valid", "annotated")}
    truths = [true_label(o) for image in photos("valid") for o in image.objects]
    pool = tuple(label for label in truths if label)
    reports, looked = {}, {}
    for name, numbers in counts.items():
        done = each(named, [(name, k, pool) for k in numbers], title=f"{name} photos")
        reports[name] = LabelReport(tuple(one["labels"] for one in done))
        looked[name] = {
            key: [status for one in done for status in one[key]] for key in ("present", "absent")
        }
    renders = range(QUICK_RENDERS if arguments.quick else RENDERS)
    lit = [one for one in each(shining, [(k,) for k in renders], title="renders") if one[0]]
    boxes = each(alone, [("valid", k) for k in counts["valid"]], title="boxes to read")
    comparison = compared([row for rows in boxes for row in rows], arguments.peers_python)
    goals = targets(reports, looked)
    table = markdown_table([goal.row() for goal in goals])
    parts = {
        "label-targets": f"{table}\n\nMachine: {describe_machine()}.",
        "label-find": finding_table(looked),
        "label-readers": comparison,
        "label-lit": lit_table(lit),
        "label-valid": label_tables(reports["valid"]),
        "label-annotated": label_tables(reports["annotated"]),
    }
    for text in parts.values():
        print(f"{text}\n")
    if arguments.quick:
        print("nothing written")
        return 0
    for name, text in parts.items():
        write_between(ROOT / "docs" / "labels.md", name, text)
    write_between(ROOT / "README.md", "bench:labels", parts["label-targets"])
    card = ROOT / "src" / "fronto" / "weights" / "READER_CARD.md"
    write_between(card, "label-figures", parts["label-targets"])
    write_between(card, "reader-identity", identity())
    write_json(
        ROOT / "benchmarks" / "results" / "labels.json",
        {
            "targets": [vars(goal) for goal in goals],
            **{name: report.to_dict() for name, report in reports.items()},
        },
    )
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
