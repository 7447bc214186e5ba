"""Every way to a head-on view that people use today, behind one signature.

A way is a function of a `Case` and answers with an `Answer`; `judge` compares that with the
truth.
"""

from collections.abc import Callable

from scenes import Case
from ways.answer import Answer, judge
from ways.document import document
from ways.fronto_itself import fronto, fronto_buttons
from ways.grid_em import grid_em
from ways.layout_known import layout_known
from ways.paper import paper, paper_printed
from ways.vanishing import vanishing, vanishing_rotation

__all__ = [
    "WAYS",
    "Answer",
    "document",
    "fronto",
    "fronto_buttons",
    "grid_em",
    "judge",
    "layout_known",
    "paper",
    "paper_printed",
    "vanishing",
    "vanishing_rotation",
]

#: By the names that the tables show.
WAYS: dict[str, Callable[[Case], Answer]] = {
    "fronto": fronto,
    "fronto, buttons alone": fronto_buttons,
    "paper": paper,
    "paper, as printed": paper_printed,
    "grid-EM style": grid_em,
    "vanishing points": vanishing,
    "panel quadrilateral": document,
    "layout known (bound)": layout_known,
}
