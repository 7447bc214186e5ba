"""What a label means: the names that annotators give, to the categories of the network."""

from __future__ import annotations

import re
from collections.abc import Iterable

from fronto.categories import CATEGORIES
from fronto.datasets.records import UNKNOWN
from fronto.errors import InputError

__all__ = ["category_of", "check_names", "printed_text"]

#: Written as ``category: names``; the abbreviations are those that panels carry (looked up
#: in photos: DO, DC, DH are door open, close, hold; NS is non-stop; CH shows a wheelchair).
MEANING = {
    "up": "up",
    "down": "down, dn",
    "keyhole": "keyhole, key, switch, key switch, keyswitch, lock",
    "open": "open, oepn, door open, open door, open hold, do, dor",
    "close": "close, door close, close door, dc",
    "alarm": "alarm, bell, help, phone, telephone, call, intercom, emergency, emerg, emege, sos,"
    " al",
    "stop": "stop, emergency stop, emerg stop",
    "other": "other, fan, fire, hold, updown, up down, call cancel, call lift, dh, dhb, dhf, dhr,"
    " ns, ir, id, iu, ch, alt",
    "number": "number, floor, ground, lobby, plaza, street, bridge, mezz, mez, mezzanine, basement,"
    " roof",
    "plate": "plate",
    UNKNOWN: "unknown, empty, blur, button, btn, push button",
    "": "background, led, indicator, speaker, light, hat, text, display, screen, lamp",
}
CATEGORY = {name: key for key, names in MEANING.items() for name in names.split(", ")}
#: A text beginning with these has their meaning, "alarm bell" for one.
BEGINNINGS = {"alarm": "alarm", "call": "alarm", "emerg": "alarm", "emege": "alarm", "open": "open"}
PREFIX = re.compile(r"(bt|btn|button)[ _-]+(?=.)|(text)[ _-]+(?=.)")
SUFFIX = re.compile(r"[ _-]+(button|btn)$")
#: 3, -1, B1, 12A, *1, P1A, LL1R, 340m; one or two letters; a plate's range, 30-90; a bare * or -.
FLOOR = re.compile(r"[*+-]?(?:[a-z]{0,3}\d{1,3}[a-z]{0,2}|[a-z]{1,2})|\d{1,3}-\d{1,3}m?|[*-]")
#: Three letters are a floor only in capitals: a small "cat" is a word. "sGR" stands for *GR.
CAPITALS = re.compile(r"s?\*?[A-Z]{3}|s[A-Z]{1,2}")


def category_of(name: str) -> str | None:
    r"""What category a label name means.

    Upper and lower case are one, but for floors of three letters ("SPA"), which are known
    by their capitals. A prefix "text\_" says that the name is what the button carries;
    "bt\_", "button\_" and the like are left out.

    Parameters
    ----------
    name
        Any label name: a category, a floor ("12", "B1", "PH"), a function ("open").

    Returns
    -------
    A name of `fronto.categories.CATEGORIES` except "background"; "unknown" for some button;
    None for what is no button ("display"), or is not known at all.
    """
    name = name.strip()
    lower = name.lower()
    prefix = PREFIX.match(lower)
    bare = SUFFIX.sub("", lower[prefix.end() :] if prefix else lower)
    original = name[prefix.end() if prefix else 0 :][: len(bare)]
    words = " ".join(re.split(r"[\s_]+", bare))
    is_text = prefix is not None and prefix[2] is not None
    found = CATEGORY.get(words)
    if found is None and (FLOOR.fullmatch(bare) or CAPITALS.fullmatch(original)):
        found = "number"
    if is_text:
        if found is None:
            found = next((c for start, c in BEGINNINGS.items() if words.startswith(start)), None)
        return found or "other"  # whatever carries a text here is a button, "light" too
    if found is None and bare != lower:
        found = UNKNOWN
    return found or None


def printed_text(name: str) -> str:
    r"""What a button with this label carries, as far as the label says.

    Parameters
    ----------
    name
        A label name, such as "12", "text_OPEN", or "s1" (the starred floor, \*1).

    Returns
    -------
    The floor or the text; "" for a function that is usually a symbol ("up"), and for what
    is no button.
    """
    name = name.strip()
    if name.lower().startswith("text_"):
        text = name[5:]
        return "" if category_of(text) == UNKNOWN else text
    if category_of(name) != "number" or name in CATEGORIES:
        return ""
    return re.sub(r"^s(?=[A-Z0-9]|$)", "*", name)


def check_names(names: Iterable[str], thing: str) -> None:
    """Refuse a data set none of whose labels is known: it would count as empty photos.

    Raises
    ------
    InputError
        Naming `thing` and some of the labels, if there are labels and all are unknown.
    """
    distinct = sorted(set(names))
    if distinct and all(category_of(n) is None and CATEGORY.get(n.lower()) != "" for n in distinct):
        shown = ", ".join(map(repr, distinct[:5])) + (", ..." if len(distinct) > 5 else "")
        raise InputError(
            thing,
            f"expected labels of buttons such as {', '.join(CATEGORIES[1:4])}, '12' or 'button',"
            f" got {shown}",
            "rename the labels",
        )
