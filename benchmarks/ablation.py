"""What the parts of the training are worth: short runs of equal length, side by side.

    python benchmarks/ablation.py                  four runs (about five minutes each on two cores)
    python benchmarks/ablation.py --steps 2400     longer ones; those of other lengths stay listed
    python benchmarks/ablation.py --arms refined   the same after self-training
    python benchmarks/ablation.py --variants       speed of networks of other widths, untrained

Needs the extra "train" and the photos in `--data` (`panels`, `annotated`, and the starting
weights `init/mobilenet_v2.npz`). Each arm is a run folder: what is stopped goes on there, and
what is finished is not trained again. Short runs rank the parts; they do not reach the figures of
the packaged network.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, cast

import torch

from fronto.datasets.annotated import read_annotated
from fronto.datasets.forms import with_forms
from fronto.datasets.panels import incomplete_photos, read_panels
from fronto.datasets.records import LabeledImage
from fronto.datasets.refine import refine
from fronto.engine import Engine
from fronto.evaluate import evaluate_segmentation
from fronto.segmentation import segment
from fronto.segments import Segments
from fronto.train.data import Photos, Renders, Source
from fronto.train.export import export_onnx
from fronto.train.fit import FitOptions, fit, load_checkpoint
from fronto.train.network import Network, NetworkOptions
from fronto.train.options import TrainOptions
from fronto.train.start import load_backbone
from fronto.train.validate import TorchEngine
from network import MEGABYTE, network_ms
from report import describe_machine, markdown_table, write_between

ROOT = Path(__file__).resolve().parent.parent
DATA = ROOT.parent / "shared" / "data"
RESULTS = ROOT / "benchmarks" / "results" / "ablation.json"
PAGE = ROOT / "docs" / "training.md"
#: Photos of panels/valid that every arm is evaluated on, evenly spread over them.
PANELS = 100
SEED = 1


@dataclass(frozen=True)
class Arm:
    """One way to train: what from, and on what."""

    name: str
    renders: float
    backbone: bool = True
    refined: bool = False
    network: NetworkOptions = field(default_factory=NetworkOptions)


SHARE = TrainOptions().renders
ARMS = {
    "renders": Arm("renders only", 1.0),
    "boxes": Arm("boxes only", 0.0),
    "both": Arm("both", SHARE),
    "random": Arm("both, random start", SHARE, backbone=False),
    "refined": Arm("both, outlines refined by the run “both”", SHARE, refined=True),
    "plain": Arm("both, plain 3x3 convolutions", SHARE, network=NetworkOptions(separable=False)),
    "fine": Arm("both, output stride 8", SHARE, network=NetworkOptions(output_stride=8)),
}
DEFAULT_ARMS = ("renders", "boxes", "both", "random")
VARIANTS = {
    "the package's": NetworkOptions(),
    "decoder 128": NetworkOptions(decoder=128),
    "decoder 64": NetworkOptions(decoder=64),
    "256, decoder 256": NetworkOptions(channels=256, decoder=256),
    "plain": NetworkOptions(separable=False),
    "plain, decoder 128": NetworkOptions(decoder=128, separable=False),
    "plain, 256, decoder 256": NetworkOptions(channels=256, decoder=256, separable=False),
    "output stride 8": NetworkOptions(output_stride=8),
}


def fit_options(steps: int, size: int, batch: int, workers: int) -> FitOptions:
    """For short runs: the average would still remember the start at the default's 0.998."""
    return FitOptions(
        steps=steps,
        size=size,
        batch=batch,
        seed=SEED,
        workers=workers,
        warmup=min(FitOptions.warmup, steps // 10),
        average=min(FitOptions.average, max(0.0, 1 - 20 / steps)),
        save_every=min(FitOptions.save_every, max(steps // 5, 1)),
    )


def predictor(network: Network) -> Callable[[LabeledImage], Segments]:
    engine = cast(Engine, TorchEngine(network.eval()))
    return lambda image: segment(image.path, engine=engine)


def train_photos(data: Path) -> list[LabeledImage]:
    """Without those on which many buttons have no box: they would count as background."""
    left_out = incomplete_photos("train")
    photos = [i for i in read_panels(data / "panels", "train") if i.path.stem not in left_out]
    return with_forms(photos)


def sources(arm: Arm, photos: Sequence[LabeledImage]) -> list[tuple[Source, float]]:
    result: list[tuple[Source, float]] = []
    if arm.renders > 0:
        result.append((Renders(), arm.renders))
    if arm.renders < 1:
        result.append((Photos(photos), 1 - arm.renders))
    return result


def refined(photos: Iterable[LabeledImage], teacher: Path) -> list[LabeledImage]:
    if not (teacher / "figures.json").is_file():
        raise SystemExit(f"{teacher.name}: expected a finished run; train the arm “both” first")
    return refine(photos, predictor(load_checkpoint(teacher / "last.pt")))


def trained(arm: Arm, run: Path, teacher: Path, data: Path, options: FitOptions) -> Network:
    photos = train_photos(data) if arm.renders < 1 else []
    if arm.refined:
        photos = refined(photos, teacher)
    torch.manual_seed(SEED)
    network = Network(arm.network)
    if arm.backbone:
        load_backbone(network, data / "init" / "mobilenet_v2.npz")
    return fit(network, sources(arm, photos), run, options)


def figures_of(network: Network, data: Path, most: int) -> dict[str, float]:
    valid = read_panels(data / "panels", "valid")
    most = min(most, len(valid))
    chosen = [valid[k * len(valid) // most] for k in range(most)]
    annotated = read_annotated(data / "annotated")[:most]
    predict = predictor(network.cpu())
    panels = evaluate_segmentation(chosen, predict, by="box")
    outlines = evaluate_segmentation(annotated, predict, by="mask")
    return {
        "panels_f1": panels.buttons.f1,
        "panels_precision": panels.buttons.precision,
        "panels_recall": panels.buttons.recall,
        "panels_plates_as_buttons": panels.plates_as_buttons,
        "panels_named_right": panels.category_accuracy,
        "annotated_f1": outlines.buttons.f1,
        "annotated_median_iou": outlines.iou_quartiles[1],
        "annotated_miou": outlines.mean_iou,
    }


HEADINGS = {
    "panels_f1": "panels: F1",
    "panels_precision": "precision",
    "panels_recall": "recall",
    "panels_plates_as_buttons": "plates as buttons",
    "panels_named_right": "named right",
    "annotated_f1": "annotated: F1",
    "annotated_median_iou": "median IoU",
    "annotated_miou": "mIoU",
}


def arms_table(arms: dict[str, Any]) -> str:
    first = next(iter(arms.values()))
    rows = [
        {"training": ARMS[arm["arm"]].name, "steps": str(arm["steps"])}
        | {
            heading: "–" if arm["figures"][name] is None else f"{arm['figures'][name]:.3f}"
            for name, heading in HEADINGS.items()
        }
        for arm in sorted(arms.values(), key=lambda arm: -arm["steps"])
    ]
    return (
        f"{first['photos']} photos of panels/valid and {first['annotated']} annotated ones; "
        f"{first['batch']} pictures of {first['size']}x{first['size']} pixels a step.\n\n"
        + markdown_table(rows)
    )


def variant(options: NetworkOptions, threads: int, runs: int) -> dict[str, Any]:
    torch.manual_seed(SEED)
    network = Network(options).eval()
    with TemporaryDirectory() as folder:
        path = export_onnx(network, Path(folder), "variant", {})
        size = path.stat().st_size / MEGABYTE
        median, best = network_ms(Engine(path, threads=threads), runs)
    return {
        "channels": options.channels,
        "decoder": options.decoder,
        "separable": options.separable,
        "output_stride": options.output_stride,
        "parameters": sum(p.numel() for p in network.parameters()),
        "mb": round(size, 2),
        "median_ms": round(median, 1),
        "best_ms": round(best, 1),
    }


def variants_table(variants: dict[str, Any], threads: int) -> str:
    rows = [
        {
            "network": name,
            "pyramid": str(v["channels"]),
            "decoder": str(v["decoder"]),
            "3x3 convolutions": "separable" if v["separable"] else "plain",
            "output stride": str(v["output_stride"]),
            "parameters": f"{v['parameters'] / 1e6:.2f} M",
            "MB": f"{v['mb']:.1f}",
            "median ms": f"{v['median_ms']:.0f}",
            "best ms": f"{v['best_ms']:.0f}",
        }
        for name, v in variants.items()
    ]
    return f"640x480, {threads} threads.\n\n{markdown_table(rows)}"


def record(key: str, values: Any) -> None:
    """Put one part of the results into their file; the others stay."""
    content = json.loads(RESULTS.read_text(encoding="utf-8")) if RESULTS.is_file() else {}
    content[key] = values
    content["machine"] = describe_machine()
    RESULTS.parent.mkdir(parents=True, exist_ok=True)
    RESULTS.write_text(
        json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n", encoding="utf-8"
    )


def run_arms(arguments: argparse.Namespace) -> dict[str, Any]:
    options = fit_options(arguments.steps, arguments.size, arguments.batch, arguments.workers)
    setting = f"{options.steps}x{options.batch}-{options.size}"
    folder = arguments.runs / setting
    for key in arguments.arms:
        arm, run = ARMS[key], folder / key
        if (run / "figures.json").is_file():
            print(f"{arm.name}: finished before", flush=True)
            continue
        print(f"{arm.name}: {options.steps} steps", flush=True)
        network = trained(arm, run, folder / "both", arguments.data, options)
        figures = figures_of(network, arguments.data, arguments.photos)
        valued = {name: None if v != v else round(v, 4) for name, v in figures.items()}
        (run / "figures.json").write_text(json.dumps(valued), encoding="utf-8")
    annotated = len(list((arguments.data / "annotated" / "labels").glob("*.json")))
    about = {
        "steps": options.steps,
        "batch": options.batch,
        "size": options.size,
        "photos": arguments.photos,
        "annotated": min(annotated, arguments.photos),
    }
    finished = {key: folder / key / "figures.json" for key in ARMS}
    return {
        f"{key}-{setting}": {"arm": key, **about}
        | {"figures": json.loads(path.read_text(encoding="utf-8"))}
        for key, path in finished.items()
        if path.is_file()
    }


def measured_before(arms: dict[str, Any]) -> dict[str, Any]:
    """Runs of other lengths, of pictures and photos like these."""
    alike = ("batch", "size", "photos", "annotated")
    first = next(iter(arms.values()))
    content = json.loads(RESULTS.read_text(encoding="utf-8")) if RESULTS.is_file() else {}
    return {
        key: arm
        for key, arm in content.get("arms", {}).items()
        if arm["steps"] != first["steps"] and all(arm[name] == first[name] for name in alike)
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, default=DATA)
    parser.add_argument("--runs", type=Path, default=ROOT / "out" / "ablation")
    parser.add_argument("--arms", nargs="+", choices=ARMS, default=DEFAULT_ARMS)
    parser.add_argument("--steps", type=int, default=400)
    parser.add_argument("--size", type=int, default=288)
    parser.add_argument("--batch", type=int, default=8)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--photos", type=int, default=PANELS, help="to evaluate on")
    parser.add_argument("--variants", action="store_true", help="only time untrained networks")
    parser.add_argument("--threads", type=int, default=2, help="of --variants")
    parser.add_argument("--calls", type=int, default=40, help="of --variants, each network")
    parser.add_argument("--dry", action="store_true", help="print the tables, write no document")
    arguments = parser.parse_args()
    if arguments.variants:
        key, values = "variants", {}
        for name, options in VARIANTS.items():
            values[name] = variant(options, arguments.threads, arguments.calls)
            print(f"{name}: {values[name]['median_ms']} ms", flush=True)
        text = variants_table(values, arguments.threads)
    else:
        if not (arguments.data / "panels").is_dir():
            raise SystemExit(f"{arguments.data}: expected the folder panels, there is none")
        key, values = "arms", run_arms(arguments)
        values |= measured_before(values)
        text = arms_table(values)
    print(text)
    if not arguments.dry:
        record(key, values)
        name = "variants" if key == "variants" else "ablation"
        write_between(PAGE, name, text)


if __name__ == "__main__":
    main()
