"""How good a result is: the metrics behind the tables of the documentation."""

from fronto.evaluate.contact import finding_sheets, photo_sheet
from fronto.evaluate.matching import Detection, Finding, judge_image, match_greedy, photo_id
from fronto.evaluate.missing import (
    Missing,
    panels_illegible,
    panels_missing,
    read_missing,
    write_missing,
)
from fronto.evaluate.rectification import (
    aspect_errors,
    axis_angles_deg,
    edge_angles_deg,
    rotation_error_deg,
)
from fronto.evaluate.report import ImageResult, SegmentationReport
from fronto.evaluate.scores import CategoryScore, CurvePoint, Score, SizeScore
from fronto.evaluate.segmentation import evaluate_segmentation

__all__ = [
    "CategoryScore",
    "CurvePoint",
    "Detection",
    "Finding",
    "ImageResult",
    "Missing",
    "Score",
    "SegmentationReport",
    "SizeScore",
    "aspect_errors",
    "axis_angles_deg",
    "edge_angles_deg",
    "evaluate_segmentation",
    "finding_sheets",
    "judge_image",
    "match_greedy",
    "panels_illegible",
    "panels_missing",
    "photo_id",
    "photo_sheet",
    "read_missing",
    "rotation_error_deg",
    "write_missing",
]
