"""The only room that touches ONNX Runtime: networks' files, loaded and run."""

from fronto.engine.companion import find_companion
from fronto.engine.context import ContextEngine
from fronto.engine.edges import EdgeEngine, packaged_edges
from fronto.engine.masks import DrawnMasks, MaskEngine
from fronto.engine.onnxfile import find_weights
from fronto.engine.reader import LabelScores, ReaderEngine, packaged_reader
from fronto.engine.relations import RelationEngine, Verdicts
from fronto.engine.segmentation import FORMAT, Engine, Maps
from fronto.engine.verifier import VerifierEngine

__all__ = [
    "FORMAT",
    "ContextEngine",
    "DrawnMasks",
    "EdgeEngine",
    "Engine",
    "LabelScores",
    "Maps",
    "MaskEngine",
    "ReaderEngine",
    "RelationEngine",
    "Verdicts",
    "VerifierEngine",
    "find_companion",
    "find_weights",
    "packaged_edges",
    "packaged_reader",
]
