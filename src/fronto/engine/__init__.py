"""The only room that touches ONNX Runtime: networks' files, loaded and run."""

from fronto.engine.onnxfile import find_weights
from fronto.engine.reader import LabelScores, ReaderEngine
from fronto.engine.relations import RelationEngine, Verdicts, find_companion
from fronto.engine.segmentation import FORMAT, Engine, Maps

__all__ = [
    "FORMAT",
    "Engine",
    "LabelScores",
    "Maps",
    "ReaderEngine",
    "RelationEngine",
    "Verdicts",
    "find_companion",
    "find_weights",
]
