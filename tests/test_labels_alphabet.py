"""Labels in normal form."""

from __future__ import annotations

import subprocess
import sys

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fronto.labels.alphabet import ALPHABET, KINDS, normal_text


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("12", "12"),
        (" 12 a\n", "12A"),
        ("ph", "PH"),
        ("s1", "*1"),  # the panels set's way to write a star
        ("sG", "*G"),
        ("s", "*"),
        ("S1", "S1"),
        ("stop", "STOP"),
        ("su", "SU"),
        ("−2", "-2"),
        ("–2", "-2"),
        ("—2", "-2"),
        ("★1", "*1"),
        ("☆L", "*L"),
        ("１２", "12"),
        ("－１", "-1"),
        ("É", "E"),
        ("②", "2"),
        ("5½", "5"),  # not 512
        ("B/1", "B1"),
        ("", ""),
        ("開", ""),
    ],
)
def test_normal_form(text: str, expected: str) -> None:
    assert normal_text(text) == expected


@given(st.text(max_size=8))
@settings(derandomize=True, deadline=None)
def test_normal_form_of_a_normal_form(text: str) -> None:
    normal = normal_text(text)
    assert set(normal) <= set(ALPHABET)
    assert normal_text(normal) == normal


@given(st.text(alphabet=ALPHABET, max_size=8))
@settings(derandomize=True, deadline=None)
def test_what_is_normal_stays(text: str) -> None:
    assert normal_text(text) == text


def test_classes() -> None:
    assert len(ALPHABET) == len(set(ALPHABET)) == 39
    assert len(KINDS) == len(set(KINDS)) == 11


def test_nothing_heavy_is_imported() -> None:
    code = "import sys, fronto.labels.alphabet; print('numpy' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"
