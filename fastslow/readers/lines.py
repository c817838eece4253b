"""Text of a file as lines whose characters keep their places, through continuations and arrays."""

from __future__ import annotations

import codecs
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from fastslow.disk import read_file
from fastslow.errors import FileError, ModelError

#: Largest file in bytes. The largest published .ode file that we know of has 120 kB.
LARGEST_FILE = 8_000_000

#: Longest array, and greatest number of lines after all arrays are expanded.
LONGEST_ARRAY, MOST_LINES = 10_000, 200_000

_ARRAY = re.compile(r"\[\s*(-?\d+)\s*\.\.+\s*(-?\d+)\s*\]")
_INDEX = re.compile(r"(?<!int)(?<!INT)\[\s*(?:([jJ])\s*(?:([-+*])\s*(\d+))?|(-?\d+))\s*\]")


@dataclass(frozen=True)
class Line:
    """A line of text with the places of its characters in a file.

    Parameters
    ----------
    text : str
    segments : tuple of (int, int, int)
        Position in the text, line and column of the first character of each segment.
    file : str
        Empty for text that is no file.
    """

    text: str
    segments: tuple[tuple[int, int, int], ...]
    file: str = ""

    def place(self, at: int = 0) -> str:
        """Return the place of a character as words, such as ``"line 3, column 7"``."""
        offset, line, column = max(
            (s for s in self.segments if s[0] <= at), default=self.segments[0]
        )
        found = f"line {line}, column {column + max(at - offset, 0)}"
        return f"{self.file}, {found}" if self.file else found

    def part(self, start: int, end: int | None = None) -> Line:
        """Return a part of the text, without blanks around it."""
        whole = self.text[start:end]
        start += len(whole) - len(whole.lstrip())
        text = whole.strip()
        inside = [s for s in self.segments if start < s[0] < start + len(text)]
        before = max((s for s in self.segments if s[0] <= start), default=self.segments[0])
        first = (0, before[1], before[2] + start - before[0])
        moved = ((offset - start, line, column) for offset, line, column in inside)
        return Line(text, (first, *moved), self.file)

    def refused(self, reason: str, at: int = 0) -> ModelError:
        """Return the error for a line, with the place of a character."""
        return ModelError(f"{self.place(at)}: {reason}")

    def replaced(self, pattern: re.Pattern[str], index: int) -> Line:
        """Return the line with every bracket of a pattern replaced for one index of an array."""
        text, segments, last = "", list[tuple[int, int, int]](), 0
        for found in pattern.finditer(self.text):
            for start, end, new in (
                (last, found.start(), self.text[last : found.start()]),
                (found.start(), found.end(), _indexed(found, index)),
            ):
                part = self.part_of_segments(start, end, len(text))
                segments += part
                text += new
            last = found.end()
        segments += self.part_of_segments(last, len(self.text) + 1, len(text))
        return Line(text + self.text[last:], tuple(segments) or self.segments, self.file)

    def part_of_segments(self, start: int, end: int, shift: int) -> list[tuple[int, int, int]]:
        """Return the segments between two positions, moved to a new position."""
        if start >= end:
            return []
        offset, line, column = max(
            (s for s in self.segments if s[0] <= start), default=self.segments[0]
        )
        inside = [s for s in self.segments if start < s[0] < end]
        first = (shift, line, column + start - offset)
        return [first, *((o - start + shift, li, c) for o, li, c in inside)]


def _indexed(found: re.Match[str], index: int) -> str:
    if found.re is _ARRAY:
        return str(index)
    name, operator, number, alone = found.groups()
    if alone is not None:
        return str(int(alone))
    if name and operator:
        other = int(number)
        return str({"+": index + other, "-": index - other, "*": index * other}[operator])
    return str(index)


def text_of_file(path: Path) -> tuple[str, list[str]]:
    """Return the text of a file, and notes on its encoding.

    Raises
    ------
    FileError
        For a file that cannot be read, is too large, or is not text.
    """
    content = read_file(path, LARGEST_FILE)
    for mark, name in (
        (codecs.BOM_UTF8, "utf-8-sig"),
        (codecs.BOM_UTF16_LE, "utf-16"),
        (codecs.BOM_UTF16_BE, "utf-16"),
    ):
        if content.startswith(mark):
            try:
                return content.decode(name), []
            except UnicodeDecodeError as error:
                raise FileError(f"{path} is not text in {name}: {error.reason}") from error
    if b"\0" in content:
        raise FileError(f"{path} is not a text file; it contains a zero byte")
    try:
        return content.decode("utf-8"), []
    except UnicodeDecodeError:
        note = f"{path.name} is not in UTF-8 and was read as Latin-1"
        return content.decode("latin-1"), [note]


def lines_of(text: str, file: str = "") -> tuple[list[Line], list[str]]:
    r"""Return the lines of a text, with those that end with a backslash joined, and notes.

    XPPAUT ignores the rest of a line after a backslash.

    Examples
    --------
    >>> (one,), _ = lines_of("x'=-x\\\n+y")
    >>> one.text, one.place(6)
    ("x'=-x+y", 'line 2, column 2')
    """
    found: list[Line] = []
    notes: list[str] = []
    joined, segments = "", list[tuple[int, int, int]]()
    for number, written in enumerate(text.splitlines(), start=1):
        segments.append((len(joined), number, 1))
        start, slash, _ = written.partition("\\")
        joined += start.replace("\t", " ")
        if slash:
            if joined.lstrip().startswith("#"):
                notes.append(
                    f"line {number}: the comment contains a backslash, by which XPPAUT continues "
                    "it on the next line"
                )
            continue
        found.append(Line(joined, tuple(segments), file))
        joined, segments = "", []
    if segments:
        found.append(Line(joined, tuple(segments), file))
    return found, notes


def expanded(lines: list[Line]) -> Iterator[Line]:
    r"""Yield lines with arrays written out: ``x[1..3]``, and blocks from ``%[1..3]`` to ``%``.

    Raises
    ------
    ModelError
        For an array that is not closed or too long.

    Examples
    --------
    >>> [line.text for line in expanded(lines_of("x[1..2]'=-x[j]+[j]")[0])]
    ["x1'=-x1+1", "x2'=-x2+2"]
    >>> [line.text for line in expanded(lines_of("%[1..2]\nx[j]'=y[j-1]\n%")[0])]
    ["x1'=y0", "x2'=y1"]
    """
    for count, line in enumerate(_expanded(lines)):
        if count >= MOST_LINES:
            raise line.refused(f"the arrays of this file have more than {MOST_LINES} elements")
        yield line


def _expanded(lines: list[Line]) -> Iterator[Line]:
    waiting = iter(lines)
    for line in waiting:
        if is_comment(line):
            yield line
            continue
        indices = _range(line)
        if indices is not None and line.text.lstrip().startswith("%"):
            block: list[Line] = []
            for inner in waiting:
                if inner.text.lstrip().startswith("%"):
                    break
                block.append(inner)
            else:
                raise line.refused("the block of this array has no end, which is a line %")
            for index in indices:
                for inner in block:
                    yield inner if is_comment(inner) else inner.replaced(_INDEX, index)
        elif indices is None:
            yield line.replaced(_INDEX, 0) if _INDEX.search(line.text) else line
        else:
            for index in indices:
                yield line.replaced(_ARRAY, index).replaced(_INDEX, index)


def _range(line: Line) -> range | None:
    """Return the indices of the array of a line, None without one."""
    found = _ARRAY.search(line.text)
    if found is None:
        unread = re.search(r"\[[^\]]*\.\.|\[\s*[jJ]", line.text)
        if unread and not line.text.lstrip().startswith(('"', "@", "%")):
            raise line.refused("expected an array such as [1..10], and [j] in it", unread.start())
        return None
    first, last = int(found.group(1)), int(found.group(2))
    if abs(last - first) >= LONGEST_ARRAY:
        reason = f"an array of {abs(last - first) + 1} elements; expected at most {LONGEST_ARRAY}"
        raise line.refused(reason, found.start())
    step = 1 if last >= first else -1
    return range(first, last + step, step)


def is_comment(line: Line) -> bool:
    """Return True for a comment, which XPPAUT does not read."""
    return line.text.lstrip().startswith("#") and not line.text.startswith("#include")
