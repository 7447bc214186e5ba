"""Tiny ONNX files in the formats of fronto's networks."""

from __future__ import annotations

import hashlib

import numpy as np
from onnx import TensorProto, helper, numpy_helper

from fronto.categories import CATEGORIES
from fronto.engine import FORMAT
from fronto.engine.context import FORMAT as CONTEXT_FORMAT
from fronto.engine.edges import FORMAT as EDGE_FORMAT
from fronto.engine.masks import FORMAT as MASK_FORMAT
from fronto.engine.reader import FORMAT as READER_FORMAT
from fronto.engine.relations import FORMAT as HEAD_FORMAT
from fronto.engine.verifier import FORMAT as VERIFIER_FORMAT
from fronto.labels.alphabet import ALPHABET, KINDS, STEPS

CLASSES = ("background", "up", "plate")
METADATA = {
    "format": FORMAT,
    "classes": ",".join(CLASSES),
    "stride": "4",
    "multiple": "16",
    "channels": "3",
    "version": "0.7.1",
}


def network(
    *,
    metadata=METADATA,
    stride=4,
    image=(TensorProto.UINT8, ["n", "h", "w", 3]),
    names=None,
    channels=None,
    extra_input=False,
):
    """A file whose masks are the red and green of its input and whose cells are their means."""
    names = {"image": "image", **(names or {})}
    known = {"masks": 2, "classes": 3, "centers": 2, "sides": 4, "features": 3}
    channels = known | (channels or {})
    nodes = [
        helper.make_node("Cast", ["image"], ["bytes"], to=TensorProto.FLOAT),
        helper.make_node("Mul", ["bytes", "factor"], ["values"]),
        helper.make_node("Transpose", ["values"], ["x"], perm=[0, 3, 1, 2]),
        helper.make_node("Slice", ["x", "zero", "two", "axis"], ["masks"]),
        helper.make_node(
            "AveragePool", ["x"], ["classes"], kernel_shape=[stride] * 2, strides=[stride] * 2
        ),
        helper.make_node("Slice", ["classes", "zero", "two", "axis"], ["centers"]),
        helper.make_node("Concat", ["centers", "centers"], ["sides"], axis=1),
        helper.make_node("Identity", ["classes"], ["features"]),
    ]
    constants = [
        helper.make_tensor("factor", TensorProto.FLOAT, [], [1 / 255]),
        helper.make_tensor("zero", TensorProto.INT64, [1], [0]),
        helper.make_tensor("two", TensorProto.INT64, [1], [2]),
        helper.make_tensor("axis", TensorProto.INT64, [1], [1]),
    ]
    for node in nodes:
        for values in (node.input, node.output):
            values[:] = [names.get(value, value) for value in values]
    inputs = [helper.make_tensor_value_info(names["image"], *image)]
    if extra_input:
        inputs.append(helper.make_tensor_value_info("scale", TensorProto.FLOAT, [1]))
    outputs = [
        helper.make_tensor_value_info(
            names.get(name, name), TensorProto.FLOAT, ["n", count, f"{name}_h", f"{name}_w"]
        )
        for name, count in channels.items()
        if count != 0
    ]
    return _content(helper.make_graph(nodes, "test", inputs, outputs, constants), metadata)


def finder(features, *, side_px=16, seed=0):
    """A network that takes much for buttons: every local peak of random filters."""
    sizes = {"classes": len(CATEGORIES), "centers": 2, "sides": 4, "features": features}
    rng = np.random.default_rng(seed)
    weights = rng.normal(0, 0.5, (sum(sizes.values()), 3, 3, 3)).astype(np.float32)
    weights -= weights.mean(axis=(1, 2, 3), keepdims=True)
    constants = {
        "factor": np.float32(1 / 255),
        "weights": weights,
        "parts": np.array(list(sizes.values())),
        "two": np.array([2]),
        "zero": np.array([0]),
        "axis": np.array([1]),
        "side": np.float32(side_px),
    }
    raw = [f"raw {name}" for name in sizes]
    nodes = [
        helper.make_node("Cast", ["image"], ["bytes"], to=TensorProto.FLOAT),
        helper.make_node("Mul", ["bytes", "factor"], ["values"]),
        helper.make_node("Transpose", ["values"], ["x"], perm=[0, 3, 1, 2]),
        helper.make_node("Slice", ["x", "zero", "two", "axis"], ["masks"]),
        helper.make_node("AveragePool", ["x"], ["cells"], kernel_shape=[4, 4], strides=[4, 4]),
        helper.make_node("Conv", ["cells", "weights"], ["all"], pads=[1] * 4),
        helper.make_node("Split", ["all", "parts"], raw, axis=1),
        helper.make_node("Softmax", ["raw classes"], ["classes"], axis=1),
        helper.make_node("Sigmoid", ["raw centers"], ["centers"]),
        helper.make_node("Exp", ["raw sides"], ["scales"]),
        helper.make_node("Mul", ["scales", "side"], ["sides"]),
        helper.make_node("Identity", ["raw features"], ["features"]),
    ]
    inputs = [helper.make_tensor_value_info("image", TensorProto.UINT8, ["n", "h", "w", 3])]
    outputs = [
        helper.make_tensor_value_info(name, TensorProto.FLOAT, ["n", count, None, None])
        for name, count in {"masks": 2, **sizes}.items()
    ]
    tensors = [numpy_helper.from_array(np.asarray(v), name) for name, v in constants.items()]
    stated = {"classes": ",".join(CATEGORIES), "channels": str(features)}
    graph = helper.make_graph(nodes, "test", inputs, outputs, tensors)
    return _content(graph, METADATA | stated)


def head(for_network, *, metadata=None, channels=3, classes=3, floats=TensorProto.FLOAT, drop=()):
    """A relation head for a network with this content.

    Kinds and classes are those of the first numbers of the geometry, shifts the first four.
    """
    metadata = {"format": HEAD_FORMAT, "network": digits(for_network)} | (metadata or {})
    sizes = {
        "looks": ["n", 49, channels],
        "geometry": ["n", 24],
        "pairs": ["n", "n", 8],
        "kinds": ["n", 3],
        "classes": ["n", classes],
        "shifts": ["n", 4],
    }
    nodes = [
        helper.make_node("Cast", ["geometry"], ["told"], to=TensorProto.FLOAT),
        helper.make_node("Slice", ["told", "zero", "three", "axis"], ["first"]),
        helper.make_node("Softmax", ["first"], ["kinds"], axis=1),
        helper.make_node("Slice", ["told", "zero", "count", "axis"], ["named"]),
        helper.make_node("Softmax", ["named"], ["classes"], axis=1),
        helper.make_node("Slice", ["told", "zero", "four", "axis"], ["shifts"]),
    ]
    numbers = {"zero": 0, "three": 3, "count": classes, "four": 4, "axis": 1}
    constants = [helper.make_tensor(k, TensorProto.INT64, [1], [v]) for k, v in numbers.items()]
    inputs, outputs = (
        [helper.make_tensor_value_info(n, kind, sizes[n]) for n in names if n not in drop]
        for names, kind in (
            (("looks", "geometry", "pairs"), floats),
            (("kinds", "classes", "shifts"), TensorProto.FLOAT),
        )
    )
    return _content(helper.make_graph(nodes, "test", inputs, outputs, constants), metadata)


def mask_head(
    for_network,
    *,
    metadata=None,
    side=48,
    forms=3,
    inputs=TensorProto.UINT8,
    drop=(),
    shown="rough",
    operators=("Identity", "Softmax"),
):
    """A mask head for a network with this content.

    Its masks are the rough ones, or with `shown` "red" that channel of the photo; its forms are
    the softmax of the mean red, green and blue. All are taken as shares of 255.
    """
    metadata = {"format": MASK_FORMAT, "network": digits(for_network)} | (metadata or {})
    sizes = {
        "photo": ["n", side, side, 3],
        "rough": ["n", side, side],
        "masks": ["n", side, side],
        "forms": ["n", forms],
    }
    told = {"rough": "rough", "red": "reds"}[shown]
    nodes = [
        helper.make_node("Gather", ["photo", "zero"], ["reds"], axis=3),
        helper.make_node("Cast", [told], ["bytes"], to=TensorProto.FLOAT),
        helper.make_node("Div", ["bytes", "white"], ["shares"]),
        helper.make_node(operators[0], ["shares"], ["masks"]),
        helper.make_node("Cast", ["photo"], ["colors"], to=TensorProto.FLOAT),
        helper.make_node("Div", ["colors", "white"], ["bright"]),
        helper.make_node("ReduceMean", ["bright", "places"], ["means"], keepdims=0),
        helper.make_node("Concat", ["means", "means"], ["twice"], axis=1),
        helper.make_node("Slice", ["twice", "first", "count", "axis"], ["sliced"]),
        helper.make_node(operators[1], ["sliced"], ["forms"]),
    ]
    constants = {
        "white": np.float32(255),
        "zero": np.array(0),
        "places": np.array([1, 2]),
        "first": np.array([0]),
        "count": np.array([forms]),
        "axis": np.array([1]),
    }
    given, answers = (
        [helper.make_tensor_value_info(n, kind, sizes[n]) for n in names if n not in drop]
        for names, kind in ((("photo", "rough"), inputs), (("masks", "forms"), TensorProto.FLOAT))
    )
    tensors = [numpy_helper.from_array(np.asarray(v), name) for name, v in constants.items()]
    return _content(helper.make_graph(nodes, "test", given, answers, tensors), metadata)


def verifier(
    for_network,
    *,
    metadata=None,
    side=64,
    classes=3,
    inputs=TensorProto.UINT8,
    drop=(),
    steep=1.0,
    operator="Identity",
):
    """A verifier for a network with this content.

    Kinds are the softmax of the mean red, green and blue, as shares of 255, times `steep`; classes
    that of the same, over and over.
    """
    metadata = {"format": VERIFIER_FORMAT, "network": digits(for_network)} | (metadata or {})
    repeats = -(-classes // 3)
    nodes = [
        helper.make_node("Cast", ["patches"], ["colors"], to=TensorProto.FLOAT),
        helper.make_node("ReduceMean", ["colors", "places"], ["means"], keepdims=0),
        helper.make_node("Mul", ["means", "factor"], ["shares"]),
        helper.make_node(operator, ["shares"], ["told"]),
        helper.make_node("Softmax", ["told"], ["kinds"], axis=1),
        helper.make_node("Concat", ["told"] * repeats, ["many"], axis=1),
        helper.make_node("Slice", ["many", "first", "count", "axis"], ["named"]),
        helper.make_node("Softmax", ["named"], ["classes"], axis=1),
    ]
    constants = {
        "factor": np.float32(steep / 255),
        "places": np.array([1, 2]),
        "first": np.array([0]),
        "count": np.array([classes]),
        "axis": np.array([1]),
    }
    given = [helper.make_tensor_value_info("patches", inputs, ["n", side, side, 3])]
    answers = [
        helper.make_tensor_value_info(name, TensorProto.FLOAT, ["n", count])
        for name, count in (("kinds", 3), ("classes", classes))
        if name not in drop
    ]
    tensors = [numpy_helper.from_array(np.asarray(v), name) for name, v in constants.items()]
    return _content(helper.make_graph(nodes, "test", given, answers, tensors), metadata)


def edge_head(
    for_network,
    *,
    metadata=None,
    bins=64,
    about=3,
    inputs=TensorProto.FLOAT,
    drop=(),
    operator="Identity",
):
    """An edge head for a network with this content: edges are where the photo is most red."""
    metadata = {"format": EDGE_FORMAT, "network": digits(for_network)} | (metadata or {})
    nodes = [
        helper.make_node("Cast", ["profiles"], ["colors"], to=TensorProto.FLOAT),
        helper.make_node("Gather", ["colors", "zero"], ["reds"], axis=3),
        helper.make_node(operator, ["reds"], ["told"]),
        helper.make_node("Softmax", ["told"], ["places"], axis=2),
    ]
    given = [
        helper.make_tensor_value_info(name, inputs, shape)
        for name, shape in (("profiles", ["n", 8, bins, 4]), ("about", ["n", about]))
        if name not in drop
    ]
    answers = [helper.make_tensor_value_info("places", TensorProto.FLOAT, ["n", 8, bins])]
    tensors = [numpy_helper.from_array(np.array(0), "zero")]
    return _content(helper.make_graph(nodes, "test", given, answers, tensors), metadata)


def reader(*, version="0.7", metadata=None):
    """A reader that takes every crop for much the same, a little by its brightness."""
    rng = np.random.default_rng(0)
    sizes = {"text": STEPS * (1 + len(ALPHABET)), "kind": len(KINDS)}
    constants = {
        "channels": np.array([1, 2, 3]),
        "column": np.array([-1, 1]),
        "steps": np.array([-1, STEPS, 1 + len(ALPHABET)]),
        **{f"{k} weights": rng.normal(0, 0.01, (1, n)) for k, n in sizes.items()},
    }
    nodes = [
        helper.make_node("Cast", ["crops"], ["values"], to=TensorProto.FLOAT),
        helper.make_node("ReduceMean", ["values", "channels"], ["mean"], keepdims=0),
        helper.make_node("Reshape", ["mean", "column"], ["x"]),
        helper.make_node("MatMul", ["x", "text weights"], ["flat"]),
        helper.make_node("Reshape", ["flat", "steps"], ["raw text"]),
        helper.make_node("Softmax", ["raw text"], ["text"], axis=-1),
        helper.make_node("MatMul", ["x", "kind weights"], ["raw kind"]),
        helper.make_node("Softmax", ["raw kind"], ["kind"], axis=-1),
    ]
    inputs = [helper.make_tensor_value_info("crops", TensorProto.UINT8, ["n", 48, 48, 3])]
    outputs = [
        helper.make_tensor_value_info("text", TensorProto.FLOAT, ["n", STEPS, 1 + len(ALPHABET)]),
        helper.make_tensor_value_info("kind", TensorProto.FLOAT, ["n", len(KINDS)]),
    ]
    tensors = [
        numpy_helper.from_array(v.astype(np.float32) if v.dtype == float else v, name)
        for name, v in constants.items()
    ]
    stated = {"format": READER_FORMAT, "alphabet": ALPHABET, "kinds": ",".join(KINDS)}
    graph = helper.make_graph(nodes, "test", inputs, outputs, tensors)
    return _content(graph, stated | {"version": version} | (metadata or {}))


def context_head(
    for_reader,
    labels,
    *,
    metadata=None,
    count=None,
    geometry=31,
    pair=19,
    floats=TensorProto.FLOAT,
    drop=(),
    operator="Softmax",
):
    """A context head for a reader with this content: an operator makes of `ordered` its answer."""
    stated = {"format": CONTEXT_FORMAT, "network": digits(for_reader), "labels": ",".join(labels)}
    count = len(labels) + 2 if count is None else count
    sizes = {
        **{name: ["n", count] for name in ("own", "seen", "ordered", "labels")},
        "geometry": ["n", geometry],
        "pairs": ["n", "n", pair],
    }
    nodes = [
        helper.make_node("Cast", ["ordered"], ["told"], to=TensorProto.FLOAT),
        helper.make_node(operator, ["told"], ["labels"]),
    ]
    names = ("own", "seen", "ordered", "geometry", "pairs")
    inputs = [helper.make_tensor_value_info(n, floats, sizes[n]) for n in names if n not in drop]
    outputs = [helper.make_tensor_value_info("labels", TensorProto.FLOAT, sizes["labels"])]
    graph = helper.make_graph(nodes, "test", inputs, outputs)
    return _content(graph, stated | (metadata or {}))


def digits(content):
    return hashlib.sha256(content).hexdigest()[:8]


def _content(graph, metadata):
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=8)
    for key, value in metadata.items():
        entry = model.metadata_props.add()
        entry.key, entry.value = key, value
    return model.SerializeToString()
