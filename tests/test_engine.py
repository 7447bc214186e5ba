from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from importlib.resources import files

import numpy as np
import pytest
from onnx import TensorProto

import fronto
from fronto import InputError
from fronto.categories import CATEGORIES
from fronto.cores import usable_cores
from fronto.engine import FORMAT, Engine, find_weights
from onnxfiles import CLASSES, METADATA, network


@pytest.fixture
def write(tmp_path):
    def write_file(content=None, name="mine.onnx", **options):
        path = tmp_path / name
        path.write_bytes(network(**options) if content is None else content)
        return path

    return write_file


@pytest.fixture
def engine(write):
    return Engine(write(), threads=1)


def pictures(n=2, height=32, width=48, seed=0):
    return np.random.default_rng(seed).integers(0, 256, (n, height, width, 3), dtype=np.uint8)


def refusal(call):
    with pytest.raises(InputError) as caught:
        call()
    message = str(caught.value)
    assert "\n" not in message
    return message


def test_runs_a_batch(engine):
    images = pictures()
    maps = engine.run(images)
    values = images.transpose(0, 3, 1, 2) / 255
    cells = values.reshape(2, 3, 8, 4, 12, 4).mean(axis=(3, 5))
    for found, expected in (
        (maps.masks, values[:, :2]),
        (maps.classes, cells),
        (maps.centers, cells[:, :2]),
        (maps.sides, cells[:, [0, 1, 0, 1]]),
    ):
        assert found.dtype == np.float32
        np.testing.assert_allclose(found, expected, atol=1e-6)


def test_takes_any_size_and_any_memory_layout(engine):
    big = pictures(1, 64, 160)
    big.setflags(write=False)
    crops = big[:, ::-1, 16:144:2]
    assert engine.run(crops).masks.shape == (1, 2, 64, 64)
    np.testing.assert_allclose(engine.run(crops).masks, engine.run(np.array(crops)).masks, atol=0)


def test_tells_what_is_in_the_file(engine, write):
    assert engine.classes == CLASSES
    assert (engine.stride, engine.multiple, engine.channels) == (4, 16, 3)
    assert engine.metadata["version"] == "0.7.1"
    assert engine.path.name == "mine.onnx"
    with pytest.raises(TypeError):
        engine.metadata["version"] = "2"


def test_threads_share_one_engine(engine):
    batches = [pictures(seed=seed) for seed in range(24)]
    alone = [engine.run(batch).classes for batch in batches]
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(lambda batch: engine.run(batch).classes, batches))
    for a, b in zip(alone, together, strict=True):
        np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize(
    "images",
    [
        pictures()[0],
        pictures().astype(np.float32),
        pictures()[..., :2],
        pictures()[:0],
        pictures(height=40),
        pictures(width=56),
        pictures().tolist(),
    ],
    ids=["no batch", "floats", "2 channels", "empty", "height", "width", "list"],
)
def test_refuses_pictures(engine, images):
    assert refusal(lambda: engine.run(images)).startswith("images: ")


class TestHash:
    def test_name_that_fits(self, write):
        content = network()
        digits = hashlib.sha256(content).hexdigest()[:8]
        assert Engine(write(content, f"fronto-seg-{digits}.onnx")).classes == CLASSES

    @pytest.mark.parametrize("damage", ["flip", "cut"])
    def test_damaged_copy(self, write, damage):
        content = network()
        digits = hashlib.sha256(content).hexdigest()[:8]
        bad = content[:-1] if damage == "cut" else content[:-1] + bytes([content[-1] ^ 1])
        found = hashlib.sha256(bad).hexdigest()[:8]
        message = refusal(lambda: Engine(write(bad, f"fronto-seg-{digits}.onnx")))
        assert digits in message
        assert found in message

    def test_is_checked_first(self, write):
        """ONNX Runtime never sees bytes that are not what the name says."""
        content = b"no network at all"
        assert hashlib.sha256(content).hexdigest()[:8] in refusal(
            lambda: Engine(write(content, "x-01234567.onnx"))
        )

    @pytest.mark.parametrize("name", ["0123456.onnx", "a-0123456.onnx", "a-0123456g.onnx", "b"])
    def test_own_names_have_none(self, write, name):
        assert Engine(write(name=name)).classes == CLASSES


class TestBadFiles:
    def test_missing(self, tmp_path):
        assert "gone.onnx" in refusal(lambda: Engine(tmp_path / "gone.onnx"))

    def test_folder(self, tmp_path):
        assert tmp_path.name in refusal(lambda: Engine(tmp_path))

    @pytest.mark.parametrize(
        "content", [b"", b"GIF89a" * 9, network()[: len(network()) // 2]], ids=["0", "gif", "cut"]
    )
    def test_no_whole_onnx(self, write, content, capfd):
        assert "mine.onnx" in refusal(lambda: Engine(write(content)))
        assert capfd.readouterr() == ("", "")

    def test_onnx_of_something_else(self, write):
        assert FORMAT in refusal(lambda: Engine(write(metadata={"author": "me"})))

    @pytest.mark.parametrize(("version", "word"), [("3", "newer"), ("1", "older"), ("12", "newer")])
    def test_other_format_says_which_fronto(self, write, version, word):
        metadata = METADATA | {"format": f"fronto.segmentation/{version}"}
        message = refusal(lambda: Engine(write(metadata=metadata)))
        assert metadata["format"] in message
        assert f"{word} fronto" in message
        assert fronto.__version__ in message
        assert METADATA["version"] in message

    @pytest.mark.parametrize(
        "change",
        [
            {"stride": "four"},
            {"stride": "0"},
            {"multiple": "-16"},
            {"multiple": ""},
            {"multiple": "18"},
            {"classes": ""},
            {"classes": "background,up"},
            {"channels": "many"},
            {"channels": "4"},
        ],
        ids=str,
    )
    def test_wrong_metadata(self, write, change):
        assert "mine.onnx" in refusal(lambda: Engine(write(metadata=METADATA | change)))

    @pytest.mark.parametrize(
        ("name", "options"),
        [
            ("image", {"names": {"image": "input"}}),
            ("image", {"extra_input": True}),
            ("image", {"image": (TensorProto.FLOAT, ["n", "h", "w", 3])}),
            ("image", {"image": (TensorProto.UINT8, ["n", 3, "h", "w"])}),
            ("image", {"image": (TensorProto.UINT8, ["n", "h", "w", 4])}),
            ("masks", {"names": {"masks": "probabilities"}}),
            ("sides", {"channels": {"sides": 0}}),
            ("features", {"channels": {"features": 0}}),
        ],
    )
    def test_wrong_inputs_and_outputs(self, write, name, options):
        message = refusal(lambda: Engine(write(**options)))
        assert "mine.onnx" in message
        assert name in message

    def test_outputs_of_another_stride(self, write):
        engine = Engine(write(stride=8))
        assert "classes" in refusal(lambda: engine.run(pictures()))

    def test_fixed_sizes(self, write):
        """ONNX Runtime's refusal of other pictures comes as one line, too."""
        engine = Engine(write(image=(TensorProto.UINT8, ["n", 32, 32, 3])))
        engine.run(pictures(height=32, width=32))
        assert "mine.onnx" in refusal(lambda: engine.run(pictures(height=64)))


class TestProviders:
    def test_processor(self, write):
        images = pictures()
        plain, named = (
            Engine(write(), providers=providers) for providers in (None, ["CPUExecutionProvider"])
        )
        np.testing.assert_array_equal(plain.run(images).sides, named.run(images).sides)

    @pytest.mark.parametrize("providers", [["Abacus"], [], "Abacus", ["CPUExecutionProvider", "x"]])
    def test_unknown_ones_list_what_there_is(self, write, providers):
        message = refusal(lambda: Engine(write(), providers=providers))
        assert "CPUExecutionProvider" in message


class TestThreads:
    def test_as_many_as_usable(self, write):
        assert Engine(write()).threads == usable_cores()
        assert Engine(write(), threads=3).threads == 3

    @pytest.mark.parametrize("threads", [0, -1, 1.5, True, "2"])
    def test_refused(self, write, threads):
        assert "threads" in refusal(lambda: Engine(write(), threads=threads))


class TestUsableCores:
    @pytest.fixture
    def root(self, tmp_path, monkeypatch):
        monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(8)), raising=False)

        def make(group, files):
            for name, text in {"proc/self/cgroup": group, **files}.items():
                (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
                (tmp_path / name).write_text(text)
            return tmp_path

        return make

    @pytest.mark.parametrize(
        ("quota", "cores"),
        [
            ("max 100000", 8),
            ("200000 100000", 2),
            ("150000 100000", 2),
            ("10000 100000", 1),
            ("1600000 100000", 8),
            ("garbage", 8),
            ("100000 0", 8),
        ],
    )
    def test_container(self, root, quota, cores):
        assert usable_cores(root("0::/\n", {"sys/fs/cgroup/cpu.max": quota + "\n"})) == cores

    def test_outer_groups_count(self, root):
        files = {
            "sys/fs/cgroup/a/cpu.max": "300000 100000",
            "sys/fs/cgroup/a/b/cpu.max": "max 100000",
        }
        assert usable_cores(root("0::/a/b\n", files)) == 3

    def test_first_version(self, root):
        files = {
            "sys/fs/cgroup/cpu/x/cpu.cfs_quota_us": "400000",
            "sys/fs/cgroup/cpu/x/cpu.cfs_period_us": "100000",
            "sys/fs/cgroup/cpu/cpu.cfs_quota_us": "-1",
            "sys/fs/cgroup/cpu/cpu.cfs_period_us": "100000",
        }
        group = "5:cpuset:/x\n4:cpu,cpuacct:/x\n1:name=systemd:/y\n"
        assert usable_cores(root(group, files)) == 4

    def test_without_control_groups(self, root, tmp_path):
        root("0::/a\n", {})
        assert usable_cores(tmp_path) == 8
        assert usable_cores(tmp_path / "elsewhere") == 8

    def test_elsewhere_than_on_linux(self, monkeypatch, tmp_path):
        monkeypatch.delattr(os, "sched_getaffinity", raising=False)
        monkeypatch.setattr(os, "cpu_count", lambda: 6)
        assert usable_cores(tmp_path) == 6


class TestFindWeights:
    def test_one(self, tmp_path):
        (tmp_path / "fronto-seg-01234567.onnx").touch()
        (tmp_path / "fronto-seg.md").touch()
        assert find_weights(tmp_path) == tmp_path / "fronto-seg-01234567.onnx"

    def test_none(self, tmp_path):
        for folder in (tmp_path, tmp_path / "gone"):
            assert str(folder) in refusal(lambda folder=folder: find_weights(folder))

    def test_two(self, tmp_path):
        for name in ("a.onnx", "b.onnx"):
            (tmp_path / name).touch()
        message = refusal(lambda: find_weights(tmp_path))
        assert "a.onnx" in message
        assert "b.onnx" in message


def test_network_of_the_package():
    if not (files("fronto") / "weights").is_dir():
        pytest.skip("the trained network is not in this tree")
    engine = Engine(threads=1)
    assert engine.classes == CATEGORIES
    digits = hashlib.sha256(engine.path.read_bytes()).hexdigest()[:8]
    assert engine.path.name.endswith(f"-{digits}.onnx")
    maps = engine.run(pictures(1, 2 * engine.multiple, 3 * engine.multiple))
    np.testing.assert_allclose(maps.classes.sum(axis=1), 1, atol=1e-4)


def test_imports_are_light():
    code = "import sys, fronto, fronto.engine; sys.exit('onnxruntime' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
