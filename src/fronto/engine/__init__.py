"""The only room that touches ONNX Runtime: networks' files, loaded and run."""

from fronto.engine.companion import find_companion
from fronto.engine.context import ContextEngine
from fronto.engine.onnxfile import find_weights
from fronto.engine.reader import LabelScores, ReaderEngine
from fronto.engine.relations import RelationEngine, Verdicts
from fronto.engine.segmentation import FORMAT, Engine, Maps

__all__ = [
    "FORMAT",
    "ContextEngine",
    "Engine",
    "LabelScores",
    "Maps",
    "ReaderEngine",
    "RelationEngine",
    "Verdicts",
    "find_companion",
    "find_weights",
]
