"""(a) The paper: the network's masks, closing and Hough lines, the search over a grid.

Ma, Liu and Zhu, "Autonomous Removal of Perspective Distortion of Elevator Button Images based
on Corner Detection". The network is fronto's, as for all ways.
"""

from __future__ import annotations

from typing import Any

from fronto import estimate_pose
from fronto.results import PanelPose
from scenes import Case
from ways.answer import Answer


def paper_pose(case: Case, **reading: Any) -> PanelPose:
    """The grid's pose of the Hough corners; `reading`: of the paper's formulas."""
    quads = [o for o in case.hough.buttons if o.corners_px is not None]
    return estimate_pose(quads, case.camera, solver="grid", **reading)


def paper(case: Case) -> Answer:
    """With 1/k_v and the plain sum of the criteria: the reading with the least error."""
    return Answer.of(paper_pose(case), ok=True)


def paper_printed(case: Case) -> Answer:
    """With 1/‖K_V‖ and min-max normalisation, as Eqs. 11 and 14-17 are printed."""
    return Answer.of(paper_pose(case, criterion="paper", combine="minmax"), ok=True)
