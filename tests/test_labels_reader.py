from __future__ import annotations

import hashlib
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from onnx import TensorProto, helper

from fronto import InputError
from fronto.engine import Engine, LabelScores, ReaderEngine, find_weights
from fronto.labels.alphabet import ALPHABET, KINDS
from fronto.labels.reader import LabelReader, Reading

FORMAT = "fronto.labels/1"
METADATA = {"format": FORMAT, "alphabet": ALPHABET, "kinds": ",".join(KINDS), "version": "0.7"}


def network(
    *,
    metadata=METADATA,
    crops=(TensorProto.UINT8, ["n", 48, 48, 3]),
    text=("n", 24, 40),
    kind=("n", 11),
    softmax=True,
    only=None,
):
    """A network that says what is drawn in the crop: its red rows are steps, then the kinds."""
    nodes = [
        helper.make_node("Cast", ["crops"], ["values"], to=TensorProto.FLOAT),
        helper.make_node("Slice", ["values", "from", "to", "rows and channels"], ["red"]),
        helper.make_node("Squeeze", ["red", "last"], ["plane"]),
        helper.make_node("Slice", ["plane", "zero", "steps", "rows and columns"], ["rows"]),
        helper.make_node("Slice", ["plane", "row", "kinds", "rows and columns"], ["below"]),
        helper.make_node("Squeeze", ["below", "first"], ["line"]),
    ]
    for name, source in (("text", "rows"), ("kind", "line")):
        nodes.append(helper.make_node("ReduceSum", [source, "end"], [f"{name} sum"]))
        result = name if softmax else f"{name} of sum 1"
        nodes.append(helper.make_node("Div", [source, f"{name} sum"], [result]))
        if not softmax:
            nodes.append(helper.make_node("Add", [result, "two"], [name]))
    values = {
        "from": [0, 0],
        "to": [99, 1],
        "rows and channels": [1, 3],
        "rows and columns": [1, 2],
        "last": [3],
        "first": [1],
        "end": [-1],
        "zero": [0, 0],
        "steps": [24, text[2]],
        "row": [24, 0],
        "kinds": [25, len(KINDS)],
    }
    constants = [
        helper.make_tensor(name, TensorProto.INT64, [len(value)], value)
        for name, value in values.items()
    ]
    constants.append(helper.make_tensor("two", TensorProto.FLOAT, [], [2.0]))
    outputs = [
        helper.make_tensor_value_info(name, TensorProto.FLOAT, shape)
        for name, shape in (("text", text), ("kind", kind))
        if only in (None, name)
    ]
    inputs = [helper.make_tensor_value_info("crops", *crops)]
    graph = helper.make_graph(nodes, "test", inputs, outputs, constants)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=8)
    for key, value in metadata.items():
        entry = model.metadata_props.add()
        entry.key, entry.value = key, value
    return model.SerializeToString()


def showing(kinds, *steps):
    """A crop with the given probabilities of kinds, and of characters at some steps ("": blank)."""
    crop = np.zeros((48, 48, 3), np.uint8)
    for name, probability in kinds.items():
        crop[24, KINDS.index(name), 0] = round(200 * probability)
    crop[:24, 0, 0] = 200
    for row, step in zip(crop[2:24, :, 0], steps, strict=False):
        row[:40] = 0
        for character, probability in step.items():
            row[ALPHABET.index(character) + 1 if character else 0] = round(200 * probability)
    return crop


def sure(text):
    return [
        {character: 1.0} for pair in zip(text, [""] * len(text), strict=True) for character in pair
    ]


TWELVE = showing({"text": 1.0}, *sure("12"))


@pytest.fixture
def write(tmp_path):
    def write_file(content=None, name="mine.onnx", **options):
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(network(**options) if content is None else content)
        return path

    return write_file


@pytest.fixture
def read(write):
    reader = LabelReader(ReaderEngine(write(), threads=1), views=[1.0])
    return lambda *crops: reader.read(np.array(crops))


def refusal(call):
    with pytest.raises(InputError) as caught:
        call()
    message = str(caught.value)
    assert "\n" not in message
    return message


class TestReadings:
    @pytest.mark.parametrize(
        "text", ["1", "12", "B1", "-2", "*1", "12A", "PH", "11", "FAN", "HOLD"]
    )
    def test_texts(self, read, text):
        (reading,) = read(showing({"text": 1.0}, *sure(text)))
        assert (reading.text, reading.kind) == (text, "text")
        assert reading.confidence == pytest.approx(1)
        assert reading.alternatives == ((text, reading.confidence),)

    @pytest.mark.parametrize("kind", ["up", "down", "open", "close", "alarm", "stop", "keyhole"])
    def test_functions(self, read, kind):
        (reading,) = read(showing({kind: 0.9, "blank": 0.1}))
        assert (reading.text, reading.kind) == (kind, kind)
        assert reading.confidence == pytest.approx(0.9)

    @pytest.mark.parametrize("kind", ["other", "blank", "unreadable"])
    def test_no_label(self, read, kind):
        (reading,) = read(showing({kind: 0.8, "text": 0.2}, *sure("7")))
        assert (reading.text, reading.kind) == ("", kind)
        assert reading.confidence == pytest.approx(0.8)
        assert reading.alternatives == (("7", pytest.approx(0.2)),)

    @pytest.mark.parametrize(
        ("word", "function"),
        [("OPEN", "open"), ("CLOSE", "close"), ("DN", "down"), ("BELL", "alarm"), ("STOP", "stop")],
    )
    def test_words_and_symbols_of_one_meaning_are_one(self, read, word, function):
        (reading,) = read(showing({"text": 0.5, function: 0.4, "blank": 0.1}, *sure(word)))
        assert (reading.text, reading.kind) == (function, function)
        assert reading.confidence == pytest.approx(0.9)
        assert reading.alternatives == ((function, reading.confidence),)

    def test_confidence_is_of_kind_and_text(self, read):
        steps = [{"1": 1.0}, {"2": 0.7, "7": 0.3}]
        (reading,) = read(showing({"text": 0.9, "up": 0.1}, *steps))
        expected = {"12": 0.63, "17": 0.27, "up": 0.1}
        assert (reading.text, reading.confidence) == ("12", pytest.approx(0.63))
        assert dict(reading.alternatives) == pytest.approx(expected)
        assert [label for label, _ in reading.alternatives] == ["12", "17", "up"]

    def test_a_weak_reading_keeps_its_text(self, read):
        """Less likely than "unreadable", but that there is a text is likelier than that."""
        steps = [{"1": 0.5, "7": 0.5}, {"2": 0.55, "3": 0.45}]
        (reading,) = read(showing({"text": 0.6, "unreadable": 0.4}, *steps))
        assert reading.kind == "text"
        assert reading.text in ("12", "72")
        assert reading.confidence == pytest.approx(0.6 * 0.5 * 0.55, abs=0.01)
        assert len(reading.alternatives) == 4

    def test_a_text_without_characters_is_unreadable(self, read):
        (reading,) = read(showing({"text": 0.8, "up": 0.2}))
        assert (reading.text, reading.kind) == ("", "unreadable")
        assert reading.confidence == pytest.approx(0.8)
        endless = [{character: 1.0} for character in ALPHABET[:20]]
        (reading,) = read(showing({"text": 0.8, "up": 0.2}, *endless))
        assert (reading.text, reading.kind) == ("", "unreadable")

    def test_any_noise_gives_probabilities(self, read):
        crops = np.random.default_rng(0).integers(0, 256, (100, 48, 48, 3), dtype=np.uint8)
        crops[..., 0] //= np.random.default_rng(1).integers(1, 200, (100, 48, 48), dtype=np.uint8)
        crops[:, :, 0, 0] |= 1  # each step has a sum
        together = read(*crops)
        assert len(together) == 100
        for crop, reading in zip(crops[::9], together[::9], strict=True):
            assert read(crop) == (reading,)
        for reading in together:
            values = [p for _, p in reading.alternatives]
            assert values == sorted(values, reverse=True)
            assert sum(values) <= 1 + 1e-6
            assert len(dict(reading.alternatives)) == len(values)
            assert (reading.text == "") == (reading.kind in ("other", "blank", "unreadable"))
            if reading.text:
                assert reading.alternatives[0] == (reading.text, reading.confidence)

    def test_nothing_to_read(self, write):
        assert LabelReader(ReaderEngine(write())).read(np.zeros((0, 48, 48, 3), np.uint8)) == ()

    def test_threads_share_one(self, write):
        reader = LabelReader(ReaderEngine(write(), threads=1), views=[1.0])
        batches = [np.array([showing({"text": 1.0}, *sure(str(n)))]) for n in range(24)]
        with ThreadPoolExecutor(4) as pool:
            found = [r.text for (r,) in pool.map(reader.read, batches)]
        assert found == [str(n) for n in range(24)]

    @pytest.mark.parametrize(
        "crops",
        [
            TWELVE,
            TWELVE[None].astype(np.float32),
            TWELVE[None, :32],
            TWELVE[None, ..., :1],
            [[0]],
            np.zeros((0, 32, 32, 3), np.uint8),
        ],
        ids=["no batch", "floats", "32 rows", "1 channel", "list", "none of them"],
    )
    def test_wrong_crops_are_named(self, write, crops):
        reader = LabelReader(ReaderEngine(write()), views=[1.0])
        assert refusal(lambda: reader.read(crops)).startswith("crops: ")

    @pytest.mark.parametrize("wrong", [{"kind": "floor"}, {"confidence": 1.5}, {"confidence": -1}])
    def test_readings_are_checked(self, wrong):
        values = {"text": "12", "kind": "text", "confidence": 0.5} | wrong
        assert refusal(lambda: Reading(**values)).startswith(next(iter(wrong)))
        with pytest.raises(InputError):
            Reading("12", "text", 0.5, (("12", float("nan")),))


class TestEngine:
    def test_gives_what_the_network_says(self, write):
        engine = ReaderEngine(write(), threads=1)
        scores = engine.run(np.stack([TWELVE, showing({"up": 0.25, "down": 0.75})]))
        assert (scores.text.shape, scores.kind.shape) == ((2, 24, 40), (2, 11))
        assert scores.text[0, 2, 1 + ALPHABET.index("1")] == pytest.approx(1)
        assert scores.kind[1, KINDS.index("down")] == pytest.approx(0.75)

    def test_tells_what_is_in_the_file(self, write):
        engine = ReaderEngine(write(), threads=3)
        assert (engine.alphabet, engine.kinds) == (ALPHABET, KINDS)
        assert (engine.threads, engine.path.name) == (3, "mine.onnx")
        assert engine.metadata["version"] == "0.7"

    def test_the_order_of_its_kinds_is_the_files(self, write):
        kinds = KINDS[::-1]
        path = write(metadata=METADATA | {"kinds": ",".join(kinds)})
        (reading,) = LabelReader(ReaderEngine(path), views=[1.0]).read(showing({"up": 1.0})[None])
        assert reading.kind == kinds[KINDS.index("up")]

    @pytest.mark.parametrize(
        ("change", "word"),
        [
            ({"format": "fronto.labels/2"}, "newer fronto"),
            ({"format": "fronto.segmentation/2"}, FORMAT),
            ({"alphabet": ""}, "alphabet"),
            ({"alphabet": "AA" + ALPHABET[2:]}, "alphabet"),
            ({"alphabet": ALPHABET[1:]}, "text"),
            ({"kinds": ""}, "kinds"),
            ({"kinds": ",".join(KINDS[1:])}, "kinds"),
            ({"kinds": ",".join([*KINDS[1:], "floor"])}, "kinds"),
        ],
        ids=str,
    )
    def test_wrong_metadata(self, write, change, word):
        message = refusal(lambda: ReaderEngine(write(metadata=METADATA | change)))
        assert "mine.onnx" in message
        assert word in message

    @pytest.mark.parametrize(
        ("options", "word"),
        [
            ({"crops": (TensorProto.UINT8, ["n", 32, 32, 3])}, "crops"),
            ({"crops": (TensorProto.FLOAT, ["n", 48, 48, 3])}, "crops"),
            ({"text": ("n", 24, 30)}, "text"),
            ({"only": "text"}, "kind"),
        ],
        ids=str,
    )
    def test_wrong_inputs_and_outputs(self, write, options, word):
        message = refusal(lambda: ReaderEngine(write(**options)))
        assert "mine.onnx" in message
        assert word in message

    def test_what_is_no_probability_is_no_reading(self, write):
        engine = ReaderEngine(write(softmax=False))
        assert "mine.onnx" in refusal(lambda: engine.run(TWELVE[None]))
        engine = ReaderEngine(write())
        nothing = np.zeros_like(TWELVE[None])  # 0 / 0
        assert "mine.onnx" in refusal(lambda: engine.run(nothing))

    def test_one_network_is_not_taken_for_the_other(self, write):
        message = refusal(lambda: Engine(write()))
        assert "fronto.segmentation/2" in message
        assert FORMAT in message

    def test_damaged_copy(self, write):
        content = network()
        digits = hashlib.sha256(content).hexdigest()[:8]
        assert ReaderEngine(write(content, f"fronto-read-{digits}.onnx")).kinds == KINDS
        bad = write(content[:-1], f"fronto-read-{digits}.onnx")
        assert digits in refusal(lambda: ReaderEngine(bad))


class TestViews:
    def test_views_are_averaged(self):
        class Brightness:
            """Takes the bright share of a crop for how sure it shows "up"."""

            alphabet, kinds = ALPHABET, KINDS

            def run(self, crops):
                kind = np.zeros((len(crops), len(KINDS)), np.float32)
                up, blank = KINDS.index("up"), KINDS.index("blank")
                kind[:, up] = crops.mean(axis=(1, 2, 3)) / 255
                kind[:, blank] = 1 - kind[:, up]
                text = np.zeros((len(crops), 24, 1 + len(ALPHABET)), np.float32)
                text[..., 0] = 1
                return LabelScores(text, kind)

        crop = np.zeros((1, 48, 48, 3), np.uint8)
        crop[:, 8:40, 8:40] = 255

        def up(*views):
            (reading,) = LabelReader(Brightness(), views=views).read(crop)
            return dict(reading.alternatives)["up"]

        assert up(1.2) == pytest.approx(1.2**2 * up(1.0), rel=0.03)
        assert up(1.2, 0.8) == pytest.approx((up(1.2) + up(0.8)) / 2)

    def test_views_alike_change_nothing(self, write):
        engine = ReaderEngine(write(), threads=1)
        crop = showing({"up": 1.0})
        (once,) = LabelReader(engine, views=[1.0]).read(crop[None])
        (twice,) = LabelReader(engine, views=[1.0, 1.0]).read(crop[None])
        assert once == twice


class TestInThePackage:
    @pytest.fixture(autouse=True)
    def package(self, tmp_path, monkeypatch):
        monkeypatch.setattr("fronto.engine.onnxfile.files", lambda _: tmp_path)
        monkeypatch.setattr("fronto.labels.reader.VIEWS", (1.0,))

    def test_without_an_engine_it_is_the_packaged_one(self, write):
        content = network()
        digits = hashlib.sha256(content).hexdigest()[:8]
        write(content, f"weights/fronto-read-{digits}.onnx")
        write(b"another network", "weights/fronto-seg-01234567.onnx")
        reader = LabelReader()
        assert reader.read(TWELVE[None])[0].text == "12"
        assert reader.engine.path.name.startswith("fronto-read-")

    def test_without_weights_it_says_so_each_time(self, write):
        write(b"another network", "weights/fronto-seg-01234567.onnx")
        for _ in range(2):
            assert "fronto-read-" in refusal(LabelReader)
        write(None, "weights/fronto-read-mine.onnx")
        assert LabelReader().engine.kinds == KINDS

    def test_each_network_is_found_beside_the_other(self, write, tmp_path):
        names = {"fronto-seg": "fronto-seg-1.onnx", "fronto-read": "fronto-read-2.onnx"}
        for name in names.values():
            write(b"", name)
        for stem, name in names.items():
            assert find_weights(tmp_path, stem=stem).name == name
        write(b"", "fronto-read-3.onnx")
        message = refusal(lambda: find_weights(tmp_path, stem="fronto-read"))
        assert "fronto-read-2.onnx" in message
        assert "fronto-read-3.onnx" in message
        assert "fronto-seg" not in message


def test_imports_are_light():
    code = (
        "import sys, fronto.labels.reader, fronto.labels.crops;"
        "sys.exit(any(name in sys.modules for name in ('onnxruntime', 'cv2', 'torch')))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
