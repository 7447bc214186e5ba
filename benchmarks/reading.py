"""Does a head-on view help to read the labels? A public recogniser before and after, by tilt.

    make bench                             all benchmarks
    python benchmarks/reading.py           this one; --quick: 3 photos, writes nothing

The recogniser (RapidOCR) runs in an environment of its own, see `peers`; where that is missing,
nothing is measured.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import argparse
import json
import subprocess
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import cv2
import numpy as np

from fronto import RectifiedView, Rectifier, map_points, warp_panel
from fronto.results import PanelPose
from fronto.synth import PAPER_CAMERA
from report import SKIPPED, markdown_table, write_between, write_csv, write_json
from scenes import LOOKS, Case, FloatArray, Image, car_panel, take, turned
from ways.answer import Answer

ROOT = Path(__file__).resolve().parent.parent
WORKER = ROOT / "benchmarks" / "peers" / "read_labels.py"
PYTHON = ROOT / ".venv-peers" / "bin" / "python"
PANEL = car_panel(4, 5)
DISTANCE_M = 0.3
TILTS, PHOTOS = (0, 10, 20, 30, 40, 50, 60), 12
QUICK_TILTS, QUICK_PHOTOS = (0, 30, 60), 1
PHOTO, FRONTO, TRUTH = VIEWS = ("photo", "head-on view", "head-on view, true rotation")
#: Left out of a button's box on each side, share of the side: the button's rim.
INSET = 0.1
#: The recogniser's own height, and the widest crop that is made for it.
HEIGHT_PX, MAX_WIDTH_PX = 48, 480
#: Score from which a reading is taken as one: RapidOCR's own default.
TRUSTED = 0.5
#: What the figure shows: the photo of each tilt and the button's label.
SHOWN_PHOTO, SHOWN_LABEL = 8, "9"


def photo(tilt_deg: float, k: int) -> Case:
    """Photo k of a tilt: directions all around, each look in a third of them."""
    rng = np.random.default_rng([21, int(tilt_deg), k])
    rotation = turned(tilt_deg, 360 * k / PHOTOS, 0.0)
    return take(rng, PANEL, rotation, DISTANCE_M, look=LOOKS[k % len(LOOKS)])


def true_view(case: Case) -> RectifiedView:
    """The head-on view that nobody's error touches."""
    corners = Answer(case.camera, case.rotation).rectified(case.corners_px)
    count = len(corners)
    pose = PanelPose(
        "ok", (), "truth", case.rotation, np.zeros((3, 3)), case.camera, corners,
        np.zeros(count), np.ones(count),
    )  # fmt: skip
    return warp_panel(case.image, case.camera, pose)


def inset_box(corners_px: FloatArray, share: float = INSET) -> FloatArray:
    """The box x0, y0, x1, y1 of corners (4, 2), smaller by a share of its sides on each side."""
    low, high = corners_px.min(axis=0), corners_px.max(axis=0)
    margin = share * (high - low)
    return np.concatenate([low + margin, high - margin])


def cut(image: Image, box: FloatArray) -> Image:
    """What is in a box x0, y0, x1, y1, at the recogniser's height: (HEIGHT_PX, width, 3).

    A box that is nowhere (NaN) comes out black.
    """
    if not np.isfinite(box).all():
        return np.zeros((HEIGHT_PX, HEIGHT_PX, 3), np.uint8)
    width, height = box[2:] - box[:2]
    columns = int(np.clip(round(HEIGHT_PX * width / height), 1, MAX_WIDTH_PX))
    across, down = width / columns, height / HEIGHT_PX
    # The first pixel's centre lies half a pixel inside of the box.
    to_image = np.array([[across, 0, box[0] + across / 2], [0, down, box[1] + down / 2]])
    return np.asarray(
        cv2.warpAffine(
            np.ascontiguousarray(image[..., :3]),
            to_image,
            (columns, HEIGHT_PX),
            flags=cv2.INTER_CUBIC | cv2.WARP_INVERSE_MAP,
            borderMode=cv2.BORDER_REPLICATE,
        )
    )


def in_view(view: RectifiedView | None, case: Case, before: list[Image]) -> list[Image]:
    """Crops of a head-on view; where there is none, people are left with the photo's."""
    if view is None:
        return before
    corners = map_points(view, case.corners_px.reshape(-1, 2)).reshape(-1, 4, 2)
    return [cut(view.image, inset_box(button)) for button in corners]


def crops(tilt_deg: float, k: int) -> dict[str, Any]:
    """Crops of all buttons of a photo in each view, in the layout's order."""
    cv2.setNumThreads(1)
    case = photo(tilt_deg, k)
    panel = Rectifier(camera=case.camera)(case.image)
    before = [cut(case.image, inset_box(button)) for button in case.corners_px]
    views = {
        PHOTO: before,
        FRONTO: in_view(panel.view, case, before),
        TRUTH: in_view(true_view(case), case, before),
    }
    return {"tilt_deg": tilt_deg, "photo": k, "status": panel.status, "views": views}


def missing(python: Path) -> str:
    """Why the recogniser cannot run, "" where it can."""
    if not python.is_file():
        return f"{python} does not exist: `make bench` makes it, with access to PyPI"
    tried = subprocess.run([python, "-c", "import rapidocr"], capture_output=True, check=False)
    return f"{python} has no rapidocr" if tried.returncode else ""


def read(pictures: list[Image], python: Path) -> list[tuple[str, float]]:
    """Text and score of each picture."""
    with TemporaryDirectory() as name:
        folder, out = Path(name) / "crops", Path(name) / "read.json"
        folder.mkdir()
        names = [f"{k:06d}.png" for k in range(len(pictures))]
        for file, picture in zip(names, pictures, strict=True):
            cv2.imwrite(str(folder / file), picture[..., ::-1])
        subprocess.run([python, WORKER, folder, out], check=True)
        found = json.loads(out.read_text(encoding="utf-8"))
    return [(text.strip(), score) for text, score in (found[file] for file in names)]


def labelled(photos: list[dict[str, Any]], python: Path) -> list[dict[str, Any]]:
    """One row for each button of each view: its label, what was read, how sure."""
    rows, pictures = [], []
    for taken in photos:
        for view, images in taken["views"].items():
            kind = {key: taken[key] for key in ("tilt_deg", "photo", "status")} | {"view": view}
            rows += [kind | {"label": button.text} for button in PANEL.buttons]
            pictures += images
    readings = read(pictures, python)
    return [
        row | {"text": text, "score": score}
        for row, (text, score) in zip(rows, readings, strict=True)
    ]


def outcome(label: str, text: str, score: float, trusted: float = TRUSTED) -> str:
    """What becomes of a reading by one who trusts it from a score upwards."""
    if not text or score < trusted:
        return "declined"
    return "right" if text == label else "wrong"


def counted(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """One line for each photo and view: how many labels, how many of them read how."""
    lines: dict[tuple[float, int, str], dict[str, Any]] = {}
    for row in rows:
        key = (row["tilt_deg"], row["photo"], row["view"])
        kind = {name: row[name] for name in ("tilt_deg", "photo", "view", "status")}
        counts = {"labels": 0, "exact": 0, "right": 0, "wrong": 0, "declined": 0}
        line = lines.setdefault(key, kind | counts)
        line["labels"] += 1
        line["exact"] += row["text"] == row["label"]
        line[outcome(row["label"], row["text"], row["score"])] += 1
    return list(lines.values())


def share(lines: list[dict[str, Any]], tilt_deg: float, view: str, of: str) -> tuple[float, float]:
    """Share of the labels of a tilt, over photos: mean and standard error."""
    chosen = [r for r in lines if r["tilt_deg"] == tilt_deg and r["view"] == view]
    each = np.array([r[of] / r["labels"] for r in chosen])
    error = each.std(ddof=1) / np.sqrt(len(each)) if len(each) > 1 else float("nan")
    return float(each.mean()), float(error)


def curves(lines: list[dict[str, Any]], tilts: tuple[int, ...]) -> dict[str, dict[str, Any]]:
    """Of each view: shares by tilt."""
    return {
        view: {
            of: [share(lines, tilt, view, of)[0] for tilt in tilts]
            for of in ("exact", "right", "wrong", "declined")
        }
        for view in VIEWS
    }


def tables(lines: list[dict[str, Any]], tilts: tuple[int, ...]) -> str:
    drawn = curves(lines, tilts)
    exact, doubtful = [], []
    for view, shares in drawn.items():
        cells = zip(tilts, shares["exact"], strict=True)
        exact.append({"read right": view} | {f"{t}°": f"{100 * s:.0f} %" for t, s in cells})
        pairs = zip(tilts, shares["wrong"], shares["declined"], strict=True)
        doubtful.append(
            {"wrong / declined": view} | {f"{t}°": f"{100 * w:.0f} / {100 * d:.0f} %"
                                          for t, w, d in pairs}
        )  # fmt: skip
    return f"{markdown_table(exact)}\n\n{markdown_table(doubtful)}"


def section(lines: list[dict[str, Any]], tilts: tuple[int, ...]) -> str:
    photos = {(r["tilt_deg"], r["photo"]): r["status"] for r in lines if r["view"] == FRONTO}
    count = sum(r["labels"] for r in lines if r["view"] == PHOTO)
    without = sum(status in ("degenerate", "no_buttons") for status in photos.values())
    side = PANEL.buttons[0].width
    about = (
        "A public recogniser (RapidOCR 3.10, its network PP-OCRv6 small) reads the labels of "
        f"{len(photos)} car panels ({count} labels, floors 1 to {len(PANEL.buttons)}, buttons of "
        f"about {PAPER_CAMERA.focal_px * side / DISTANCE_M:.0f} px), tilted in directions all "
        "around. It gets the box of each button's true corners, "
        f"{100 * INSET:.0f} % smaller on each side: of the photo, of fronto's head-on view, and "
        "of one with the true rotation, the bound. Photos without a head-on view "
        f"({without} of {len(photos)}) count with what the photo shows."
    )
    shares = (
        "Share of labels read exactly right; and, where a score below "
        f"{TRUSTED:g} is declined, the shares of wrong and of declined ones:"
    )
    return "\n\n".join([about, shares, tables(lines, tilts)])


def as_drawn(text: str) -> str:
    """A reading in quotes; the figure's font has no Chinese, which the recogniser also reads."""
    if not text:
        return "nothing"
    return f"“{text}”" if text.isascii() else "Chinese"


def draw(
    photos: list[dict[str, Any]],
    rows: list[dict[str, Any]],
    tilts: tuple[int, ...],
    path: Path,
) -> None:
    """Shares by tilt above, the crops of one button below."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    lines = counted(rows)
    fig = plt.figure(figsize=(9, 6.6), layout="constrained")
    upper, lower = fig.subfigures(2, 1, height_ratios=[2, 1])
    axis = upper.subplots()
    for k, (view, style) in enumerate(zip(VIEWS, ("o-", "s-", "^--"), strict=True)):
        mean, error = (
            100 * np.array(v)
            for v in zip(*(share(lines, t, view, "exact") for t in tilts), strict=True)
        )
        axis.plot(tilts, mean, style, color=f"C{k}", label=view, lw=2 if view == FRONTO else 1.4)
        axis.fill_between(tilts, mean - error, mean + error, color=f"C{k}", alpha=0.15, lw=0)
    axis.set(
        xlabel="tilt of the panel (degrees)",
        ylabel="labels read right (%)",
        xticks=tilts,
        ylim=(None, 102),
    )
    axis.grid(alpha=0.3)
    axis.legend(loc="lower left", title="crops from (band: one standard error)")
    button = [b.text for b in PANEL.buttons].index(SHOWN_LABEL)
    read_as = {
        (r["tilt_deg"], r["view"]): r["text"]
        for r in rows
        if r["photo"] == SHOWN_PHOTO and r["label"] == SHOWN_LABEL
    }
    crops_of = {p["tilt_deg"]: p["views"] for p in photos if p["photo"] == SHOWN_PHOTO}
    axes = lower.subplots(2, len(tilts))
    for line, (view, name) in enumerate(((PHOTO, "photo"), (FRONTO, "head-on"))):
        for place, tilt in zip(axes[line], tilts, strict=True):
            place.imshow(crops_of[tilt][view][button])
            place.set(xticks=[], yticks=[])
            text = read_as[tilt, view]
            color = "tab:green" if text == SHOWN_LABEL else "tab:red"
            place.set_xlabel(as_drawn(text), color=color, parse_math=False)
            if line == 0:
                place.set_title(f"{tilt}°")
        axes[line, 0].set_ylabel(name)
    path.parent.mkdir(parents=True, exist_ok=True)
    fig.savefig(path, dpi=100)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="3 photos; writes nothing")
    parser.add_argument(
        "--peers-python", type=Path, default=PYTHON, help="the Python that has rapidocr"
    )
    arguments = parser.parse_args()
    reason = missing(arguments.peers_python)
    if reason:
        print(f"skipped: {reason}\nnothing written")
        return SKIPPED
    from remember import each

    tilts = QUICK_TILTS if arguments.quick else TILTS
    count = QUICK_PHOTOS if arguments.quick else PHOTOS
    calls = [(tilt, k) for tilt in tilts for k in range(count)]
    photos = each(crops, calls, title="photos to read")
    rows = labelled(photos, arguments.peers_python)
    lines = counted(rows)
    text = section(lines, tilts)
    print(text)
    if arguments.quick:
        print("nothing written")
        return 0
    draw(photos, rows, tilts, ROOT / "docs" / "images" / "reading.png")
    picture = "![Share of labels read before and after](images/reading.png)"
    write_between(ROOT / "docs" / "results.md", "reading", f"{text}\n\n{picture}")
    write_csv(ROOT / "benchmarks" / "results" / "reading.csv", lines)
    misread = [row for row in rows if row["text"] != row["label"]]
    write_json(
        ROOT / "benchmarks" / "results" / "reading.json",
        {"tilts_deg": tilts, "shares": curves(lines, tilts), "misread": misread},
    )
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
