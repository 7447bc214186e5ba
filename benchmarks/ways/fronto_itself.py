"""fronto, as it is and with the lines of the photo and the second look left out."""

from __future__ import annotations

from fronto import Rectifier, RectifierOptions
from fronto.results import PanelPose
from scenes import Case
from ways.answer import Answer

_ALONE = RectifierOptions(lines=False, rectified_look=False)


def fronto_pose(case: Case, options: RectifierOptions | None = None) -> PanelPose:
    return Rectifier(options, camera=case.camera)(case.image).pose


def fronto(case: Case) -> Answer:
    """`fronto rectify` with the camera given."""
    return Answer.of(fronto_pose(case))


def fronto_buttons(case: Case) -> Answer:
    """The same from the outlines of the buttons alone, in one look."""
    return Answer.of(fronto_pose(case, _ALONE))
