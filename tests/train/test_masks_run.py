"""A whole run of a mask head: rendered panels in, a file beside the network's out."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterator
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch")
for module in ("onnx", "onnxscript", "tqdm"):
    pytest.importorskip(module)

from PIL import Image

from fronto.datasets.records import LabeledImage, LabeledObject, polygon_box
from fronto.engine import Engine, find_companion
from fronto.engine.masks import AT_ONCE, MaskEngine
from fronto.errors import InputError
from fronto.maskhead import FORMS, SIDE, Patches, region
from fronto.segmentation import finds_in, segment
from fronto.train.masks.export import _tells_label, export_masks
from fronto.train.masks.fit import MaskFit
from fronto.train.masks.network import MaskNetwork, MaskOptions
from fronto.train.masks.pool import Pool
from fronto.train.masks.run import MaskTrainOptions, publish_masks, train_masks
from fronto.train.pools import read_pool
from fronto.units import _edges, _free_end
from onnxfiles import finder, head

CHANNELS = 5
HEAD = MaskOptions(widths=(4, 6, 8), blocks=(0, 1, 0), fine=3)
OPTIONS = MaskTrainOptions(
    pictures=2, fit=MaskFit(steps=2, batch=4, warmup=1, save_every=2), network=HEAD
)


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Small renders, and one thread: several only wait for each other."""
    monkeypatch.setattr("fronto.train.masks.collect.SIZES", ((160, 120), (120, 160)))
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(threads)


def engine_of(folder: Path, seed: int) -> Engine:
    path = folder / "weights" / f"network-{seed}.onnx"
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(finder(CHANNELS, seed=seed))
    return Engine(path, threads=1)


@pytest.fixture
def engine(tmp_path: Path) -> Engine:
    return engine_of(tmp_path, 0)


def wild_head(seed: int = 0) -> MaskNetwork:
    """One whose answers differ: it has seen patches, to know what to normalise by."""
    torch.manual_seed(seed)
    network = MaskNetwork(HEAD)
    with torch.no_grad():
        for _ in range(40):
            network(torch.rand(8, 3, SIDE, SIDE), torch.rand(8, SIDE, SIDE))
    return network.eval()


def patches(n: int) -> Patches:
    rng = np.random.default_rng(n)
    coarse = rng.integers(0, 256, (n, 6, 6, 4), dtype=np.uint8)
    parts = np.kron(coarse, np.ones((1, 8, 8, 1), np.uint8))
    return Patches(parts[..., :3], parts[..., 3], (region((0, 0, 30, 30)),) * n)


def noise(seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 256, (96, 128, 3), dtype=np.uint8)


def photo(folder: Path, engine: Engine, *, outlined: bool = True) -> LabeledImage:
    """Noise, and the outlines of some of what the network takes for buttons in it."""
    path = folder / "photo.png"
    Image.fromarray(noise()).save(path)
    finds, _ = finds_in(engine, noise(), 0.3)
    assert len(finds) > 5
    objects = []
    for find in finds[:6]:
        x0, y0, x1, y1 = find.box
        polygon = np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])
        category = "plate" if find.instance.plate else "up"
        kept = polygon if outlined else None
        objects.append(LabeledObject(category, polygon_box(polygon), kept, "x"))
    return LabeledImage(path, 128, 96, tuple(objects))


def columns(run: Path) -> list[dict[str, str]]:
    with (run / "metrics.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_the_file_gives_the_same_numbers_and_takes_the_place_of_an_older_one(
    engine: Engine,
) -> None:
    folder = engine.path.parent
    old = folder / f"{engine.path.stem}.masks-01234567.onnx"
    others = [
        folder / f"{engine.path.stem}.relations-own.onnx",
        folder / f"another-{engine.path.stem}.masks-01234567.onnx",
    ]
    old.write_bytes(b"an older one")
    others[0].write_bytes(head(engine.path.read_bytes(), channels=CHANNELS, classes=11))
    others[1].write_bytes(b"another network's")
    network = wild_head()
    path = export_masks([network], engine, folder, {"license": "MIT"})
    assert find_companion(engine.path, "masks") == path
    assert not old.exists()
    assert all(other.exists() for other in others)

    used = Engine(engine.path, threads=1)
    assert used.relations is not None
    assert used.masks is not None
    metadata = used.masks.metadata
    assert (metadata["license"], metadata["network"]) == ("MIT", engine.digest)
    assert metadata["forms"] == ",".join(FORMS)
    assert [MaskOptions(**one) for one in json.loads(metadata["options"])] == [HEAD]
    for n in (1, 2, AT_ONCE + 3):
        given = patches(n)
        found = used.masks.run(given)
        with torch.no_grad():
            told = network(
                torch.from_numpy(given.photo).permute(0, 3, 1, 2) / 255,
                torch.from_numpy(given.rough) / 255,
            )
        expected = told.masks.sigmoid().numpy(), told.forms.softmax(1).numpy()
        for ours, theirs in zip((found.masks, found.forms), expected, strict=True):
            assert ours.shape == theirs.shape
            assert theirs.std() > 0.01
            assert np.abs(ours - theirs).max() <= 1e-4


def test_of_several_heads_the_mean_is_taken(engine: Engine) -> None:
    heads = [wild_head(seed) for seed in (0, 1, 2)]
    singles = []
    for network in heads:
        path = export_masks([network], engine, engine.path.parent, {})
        singles.append(MaskEngine(path, network=engine.digest).run(patches(9)))
    path = export_masks(heads, engine, engine.path.parent, {})
    together = MaskEngine(path, network=engine.digest).run(patches(9))
    np.testing.assert_allclose(
        together.forms, np.mean([one.forms for one in singles], axis=0), atol=1e-4
    )
    for k, mask in enumerate(together.masks):
        drawn = [one.masks[k] for one in singles]
        believed = [m for m in drawn if _free_end(_edges(m)) is not None] or drawn
        np.testing.assert_allclose(mask, np.mean(believed, axis=0), atol=1e-4)


def test_which_masks_leave_room_for_a_label() -> None:
    """As `fronto.units` tells it of one, but where two ends are equally free."""
    rng = np.random.default_rng(8)
    masks = np.zeros((4000, SIDE, SIDE), np.float32)
    for mask in masks:
        x0, y0, x1, y1 = rng.integers(0, SIDE, 4)
        mask[min(y0, y1) : max(y0, y1) + 1, min(x0, x1) : max(x0, x1) + 1] = 1
        mask[rng.random((SIDE, SIDE)) < 0.02] = 1
    masks[0] = 0
    expected = np.array([_free_end(_edges(mask)) is not None for mask in masks])
    assert 0.05 < expected.mean() < 0.95
    found = _tells_label(torch.from_numpy(masks).reshape(-1, 4, SIDE, SIDE)).reshape(-1).numpy()
    assert (found != expected).mean() < 0.005


def test_from_renders_to_a_file(
    engine: Engine, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = tmp_path / "run"
    network = train_masks([], engine, run, OPTIONS, progress=False)
    assert not network.training
    (file,) = run.glob("patches-*")
    pool = read_pool(file, Pool)
    assert len(pool) >= OPTIONS.pictures
    assert Pool.UNKNOWN not in pool.forms
    noted = json.loads((run / "options.json").read_text(encoding="utf-8"))
    assert (noted["weights"], noted["photos"], noted["pictures"]) == (engine.digest, 0, 2)
    assert (noted["relief"], noted["network"]["fine"]) == (0.5, 3)
    assert set(asdict(OPTIONS)) < set(noted)
    # There is nothing to hold out.
    assert not {"iou", "forms_right"} & set(columns(run)[0])

    # Going on: the network is not asked again.
    with monkeypatch.context() as patched:
        patched.delattr(Engine, "run")
        longer = replace(OPTIONS, fit=replace(OPTIONS.fit, steps=4))
        train_masks([], engine, run, longer, progress=False)
    assert [row["step"] for row in columns(run)] == ["2", "4"]

    path = publish_masks([run], engine, engine.path.parent, {"license": "MIT"})
    used = Engine(engine.path, threads=1)
    assert used.masks is not None
    assert used.masks.path == path
    assert used.masks.metadata["license"] == "MIT"
    assert used.masks.metadata["version"] == noted["fronto"]
    finds = finds_in(used, noise(), 0.5)[0]
    found = segment(noise(), engine=used)
    assert 0 < len(found) <= len(finds)
    assert all(s.forms == () or sum(s.forms) == pytest.approx(1, abs=1e-4) for s in found)


def test_some_pictures_are_held_out(
    engine: Engine, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import fronto.train.masks.fit as fit

    learned = []
    plain = fit.fit_masks

    def noted(network, pool, *rest, **options):
        learned.append(pool)
        return plain(network, pool, *rest, **options)

    monkeypatch.setattr("fronto.train.masks.fit.fit_masks", noted)
    monkeypatch.setattr("fronto.train.masks.run.IN_ONE", 1)
    monkeypatch.setattr("fronto.train.masks.run.HELD_OUT", 0.5)
    run = tmp_path / "run"
    train_masks([], engine, run, replace(OPTIONS, pictures=3), progress=False)
    files = sorted(run.glob("patches-*"))
    names = [f"patches-00{k}-1.npz" for k in range(3)]
    assert [file.name for file in files] == names
    pools = [read_pool(file, Pool) for file in files]
    # The first half of each file.
    np.testing.assert_array_equal(
        learned[0].photo, np.concatenate([pool.photo[len(pool) // 2 :] for pool in pools])
    )
    figures = columns(run)[0]
    assert {"iou", "iou_tenth", "iou_rough", "forms_right"} <= set(figures)
    assert 0 <= float(figures["iou"]) <= 1
    # No two files are of the same pictures.
    assert not np.array_equal(pools[0].photo[0], pools[1].photo[0])

    # What is missing is made again, and only that.
    before = [file.read_bytes() for file in files]
    files[1].unlink()
    train_masks([], engine, run, replace(OPTIONS, pictures=3), progress=False)
    assert [file.read_bytes() for file in (files[0], files[2])] == [before[0], before[2]]
    np.testing.assert_array_equal(read_pool(files[1], Pool).masks, pools[1].masks)


def test_from_photos_with_outlines(engine: Engine, tmp_path: Path) -> None:
    run = tmp_path / "run"
    options = replace(OPTIONS, renders=0.0, pictures=3)
    images = [photo(tmp_path, engine), photo(tmp_path, engine, outlined=False)]
    train_masks(images, engine, run, options, progress=False)
    pool = read_pool(next(run.glob("patches-*")), Pool)
    assert set(pool.forms.tolist()) == {Pool.UNKNOWN}
    noted = json.loads((run / "options.json").read_text(encoding="utf-8"))
    assert noted["photos"] == 1  # a photo with boxes only does not help


def test_a_run_is_for_one_network(engine: Engine, tmp_path: Path) -> None:
    run = tmp_path / "run"
    train_masks([], engine, run, OPTIONS, progress=False)
    before = contents(run)
    another = engine_of(tmp_path, 1)
    for attempt in (
        lambda: train_masks([], another, run, OPTIONS, progress=False),
        lambda: publish_masks([run], another, tmp_path / "out", {}),
    ):
        with pytest.raises(InputError, match=f"{engine.digest}.*{another.digest}"):
            attempt()
    assert contents(run) == before
    assert not (tmp_path / "out").exists()


def test_going_on_with_other_options(engine: Engine, tmp_path: Path) -> None:
    run = tmp_path / "run"
    begun = replace(OPTIONS, pictures=1)
    train_masks([], engine, run, begun, progress=False)
    before = contents(run)
    outlined = [photo(tmp_path, engine)]
    for changed, photos in (
        (replace(begun, twins=0.9), []),
        (replace(begun, relief=0.0), []),
        (replace(begun, renders=0.5), outlined),
        (replace(begun, seed=1), []),
        (replace(begun, network=replace(HEAD, fine=4)), []),
        (begun, outlined),
    ):
        with pytest.raises(InputError, match="run"):
            train_masks(photos, engine, run, changed, progress=False)
        assert contents(run) == before
    longer = replace(begun, pictures=2, fit=replace(OPTIONS.fit, steps=3))
    train_masks([], engine, run, longer, progress=False)
    assert (run / "patches-000-2.npz").exists()
    assert [row["step"] for row in columns(run)] == ["2", "3"]


def test_a_damaged_file_of_patches_is_named(engine: Engine, tmp_path: Path) -> None:
    run = tmp_path / "run"
    run.mkdir()
    (run / "patches-000-2.npz").write_bytes(b"no patches")
    with pytest.raises(InputError, match=r"patches-000-2\.npz"):
        train_masks([], engine, run, OPTIONS, progress=False)


def test_a_network_that_finds_nothing(
    engine: Engine, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("fronto.train.shown.MOST_IN_VAIN", 3)
    monkeypatch.setattr("fronto.train.masks.collect.finds_in", lambda *_, **__: ([], 0.0))
    with pytest.raises(InputError, match=engine.path.name):
        train_masks([], engine, tmp_path / "run", OPTIONS, progress=False)
    assert not list((tmp_path / "run").glob("patches-*"))


@pytest.mark.parametrize("boxes", [False, True], ids=["no photos", "boxes only"])
def test_without_outlines_there_are_only_renders(
    engine: Engine, tmp_path: Path, boxes: bool
) -> None:
    images = [photo(tmp_path, engine, outlined=False)] if boxes else []
    for renders in (0.0, 0.9):
        with pytest.raises(InputError, match="photos"):
            train_masks(
                images,
                engine,
                tmp_path / "run",
                replace(OPTIONS, renders=renders),
                progress=False,
            )
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("content", [None, b"no checkpoint"])
def test_what_is_no_run_is_not_published(
    engine: Engine, tmp_path: Path, content: bytes | None
) -> None:
    if content is not None:
        (tmp_path / "last.pt").write_bytes(content)
    with pytest.raises(InputError, match=r"last\.pt"):
        publish_masks([tmp_path], engine, tmp_path / "out", {})
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("renders", 1.5),
        ("renders", float("nan")),
        ("twins", -0.1),
        ("relief", 2),
        ("pictures", 0),
    ],
)
def test_options_that_are_refused(name: str, value: float) -> None:
    with pytest.raises(InputError, match=name):
        replace(OPTIONS, **{name: value})
