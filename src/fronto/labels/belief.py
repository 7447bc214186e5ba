"""What a label may be: labels with probabilities, and what is left for all others."""

from __future__ import annotations

from collections.abc import Mapping

__all__ = ["Belief", "best", "combined", "ranked", "rest"]

#: Probability of each label; what they leave to 1 is for labels that nobody named, and for none.
Belief = Mapping[str, float]

#: Labels that the remainder of a belief is spread over.
OTHERS = 50
#: Less probable labels are not worth keeping.
LEAST = 1e-6


def rest(belief: Belief) -> float:
    """Probability of what a belief does not name."""
    return max(0.0, 1.0 - sum(belief.values()))


def ranked(belief: Belief) -> tuple[tuple[str, float], ...]:
    """Labels with their probabilities, likeliest first; equals by their names."""
    return tuple(sorted(belief.items(), key=lambda item: (-item[1], item[0])))


def best(belief: Belief) -> tuple[str, float]:
    """The likeliest label and its probability; "" and 0 if none is named."""
    return min(belief.items(), key=lambda item: (-item[1], item[0]), default=("", 0.0))


def combined(first: Belief, second: Belief) -> dict[str, float]:
    """What two independent sources say together (Bayes, all labels alike beforehand).

    Each says of a label that it does not name what its remainder, spread over `OTHERS`, leaves
    for it; so one that knows nothing changes nothing. Where each is certain of another label,
    both are as likely.
    """
    if not second or not first:
        return dict(first or second)
    left, right = rest(first) / OTHERS, rest(second) / OTHERS
    labels = [*first, *(label for label in second if label not in first)]
    joint = {
        label: (first.get(label, 0.0) + left) * (second.get(label, 0.0) + right) for label in labels
    }
    total = sum(joint.values()) + max(0, OTHERS - len(labels)) * left * right
    if total <= 0:
        return {best(belief)[0]: 0.5 for belief in (first, second)}
    return {label: value / total for label, value in joint.items() if value >= LEAST * total}
