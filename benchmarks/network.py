"""What the network costs: time, memory, size, and whether PyTorch agrees with ONNX Runtime."""

from __future__ import annotations

import math
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from fronto import maskhead, verification
from fronto.engine import Engine, find_companion, find_weights
from fronto.imageio import write_png
from fronto.labels.alphabet import CROP_PX, CROP_SCALE
from fronto.patches import photo_patch, region
from fronto.relations import candidates, describe
from fronto.segmentation import finds_in, segment
from fronto.synth.photo import PanelPhoto, render_photo

ROOT = Path(__file__).resolve().parent.parent
WIDTH, HEIGHT = 640, 480
#: With a third number from 1 on: training seeds its renders with two (which NumPy takes as
#: followed by 0), so that none of them comes again here.
RENDER_SEED = (2026, 3)
WARM_UP = 3
MEGABYTE = 1e6

#: A fresh process that finds the buttons of one photo; prints its peak memory in bytes.
#: `ru_maxrss` alone would count the parent's memory, which a child has before it is another
#: program.
MEMORY = """
import pathlib, sys
from fronto.engine import Engine
from fronto.segmentation import segment
segment(sys.argv[1], engine=Engine(pathlib.Path(sys.argv[2]), threads=2))
status = pathlib.Path("/proc/self/status")
if status.exists():
    lines = dict(line.split(":", 1) for line in status.read_text().splitlines())
    print(int(lines["VmHWM"].split()[0]) * 1024)
else:
    import resource
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    print(peak if sys.platform == "darwin" else peak * 1024)
"""


def renders(count: int) -> Iterator[PanelPhoto]:
    for k in range(count):
        yield render_photo(np.random.default_rng([*RENDER_SEED, k + 1]), WIDTH, HEIGHT)


def times_ms(call: Callable[[int], object], runs: int) -> tuple[float, float]:
    """Median and best of `runs` warm calls, which get their number."""
    for k in range(WARM_UP):
        call(k)
    times = []
    for k in range(runs):
        start = time.perf_counter()
        call(k)
        times.append(1e3 * (time.perf_counter() - start))
    return float(np.median(times)), min(times)


def network_ms(engine: Engine, runs: int) -> tuple[float, float]:
    """The network, its heads and the reader on one 640x480 picture: what ONNX Runtime takes."""
    image = next(renders(1)).image
    photo = image[None]
    maps = engine.run(photo)
    told = patches = seen = crops = None
    if engine.relations is not None and maps.features is not None:
        found = candidates(maps.centers[0], maps.sides[0], maps.classes[0], engine.stride)
        told = describe(found, maps.features[0], engine.stride, image.shape[:2])
    if engine.verifier is not None:
        boxes = [f.box for f in finds_in(engine, image, 0.0, second_look=False)[0]]
        seen = verification.describe(image, np.stack(boxes))
    finds = finds_in(engine, image, 0.5, second_look=False)[0]
    if engine.reader is not None:
        parts = [region(f.box, CROP_SCALE) for f in finds]
        crops = np.stack([photo_patch(image, part, CROP_PX) for part in parts])
    if engine.masks is not None:
        patches = maskhead.describe(image, finds)

    def all_of_them(_: int) -> None:
        engine.run(photo)
        if engine.relations is not None and told is not None:
            engine.relations.run(told)
        if engine.verifier is not None and seen is not None:
            engine.verifier.run(seen)
        if engine.reader is not None and crops is not None:
            engine.reader.run(crops)
        if engine.masks is not None and patches is not None:
            engine.masks.run(patches)

    return times_ms(all_of_them, runs)


def speed(weights: Path, runs: int) -> dict[str, float]:
    photos = [photo.image for photo in renders(10)]
    start = time.perf_counter()
    engine = Engine(weights, threads=2)
    result = {"load_ms": 1e3 * (time.perf_counter() - start)}
    for threads in (1, 2):
        median, best = network_ms(Engine(weights, threads=threads), runs)
        result |= {f"network_{threads}_ms": median, f"network_{threads}_best_ms": best}
        median, best = network_ms(Engine(weights, threads=threads, int8=False), runs)
        result |= {f"floats_{threads}_ms": median, f"floats_{threads}_best_ms": best}
    whole = times_ms(lambda k: segment(photos[k % len(photos)], engine=engine), runs)
    result["segment_ms"], result["segment_best_ms"] = whole
    return result


def peak_memory_mb(weights: Path) -> float:
    with TemporaryDirectory() as folder:
        photo = Path(folder) / "photo.png"
        write_png(photo, next(renders(1)).image)
        command = [sys.executable, "-c", MEMORY, str(photo), str(weights)]
        done = subprocess.run(command, check=True, capture_output=True, text=True)
    return int(done.stdout) / MEGABYTE


def companions(weights: Path) -> dict[str, Path]:
    """What lies beside a network's file, by what it is called."""
    found = {
        "in 8 bits": find_companion(weights, "int8"),
        "relation head": find_companion(weights),
        "verifier": find_companion(weights, "verifier"),
        "mask head": find_companion(weights, "masks"),
        "edge head": find_companion(weights, "edges"),
    }
    return {name: path for name, path in found.items() if path is not None}


def package_mb(weights: Path) -> float:
    """The installed package with these weights in it."""
    source = ROOT / "src" / "fronto"
    files = [f for f in source.rglob("*") if f.is_file() and f.suffix != ".pyc"]
    shipped = [f for f in files if not any(p.startswith(".") for p in f.relative_to(source).parts)]
    ours, theirs = ([path, *companions(path).values()] for path in (find_weights(), weights))
    shipped = [f for f in shipped if f not in ours] + theirs
    return sum(f.stat().st_size for f in shipped) / MEGABYTE


def parity(weights: Path) -> dict[str, float]:
    """Largest differences between PyTorch's and ONNX Runtime's maps, if PyTorch is here."""
    if find_spec("torch") is None or find_spec("onnx") is None:
        return {"probabilities": math.nan, "sides": math.nan}
    from fronto.train.export import load_onnx
    from fronto.train.validate import TorchEngine

    photos = np.stack([photo.image for photo in renders(2)])
    ours = Engine(weights, int8=False).run(photos)
    theirs = TorchEngine(load_onnx(weights)).run(photos)
    names = [name for name in vars(theirs) if getattr(theirs, name) is not None]
    pairs = {name: (getattr(ours, name), getattr(theirs, name)) for name in names}
    a, b = pairs.pop("sides")
    return {
        "probabilities": max(float(np.abs(x - y).max()) for x, y in pairs.values()),
        "sides": float((np.abs(a - b) / b).max()),
    }


def measured(weights: Path, runs: int) -> dict[str, float]:
    # First the memory, then the times: before this process has grown threads and warmth.
    figures = {"load_average": os.getloadavg()[0] if hasattr(os, "getloadavg") else math.nan}
    figures |= {"memory_mb": peak_memory_mb(weights), "package_mb": package_mb(weights)}
    figures |= speed(weights, runs)
    differs = parity(weights)
    return figures | {"parity": differs["probabilities"], "parity_sides": differs["sides"]}
