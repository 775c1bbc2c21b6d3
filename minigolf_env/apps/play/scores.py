"""The score card of a round, and the best scores kept between rounds."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import NamedTuple

from minigolf_env._atomic_io import write_text

VERSION = 1
"""Of the file's form."""

NAMES = {-3: "Albatross", -2: "Eagle", -1: "Birdie", 0: "Par", 1: "Bogey", 2: "Double bogey", 3: "Triple bogey"}
"""What golfers call strokes over par."""


class Score(NamedTuple):
    """What a player needed for a hole."""

    strokes: int
    holed: bool
    practice: bool = False
    """Whether strokes were taken back: such a score is never a best one."""


class Card:
    """A table of scores, one row a hole and one column a player.

    Args:
        pars: of each hole, by its name, in the order of play.
        players: their names; the first is the human.
    """

    def __init__(self, pars: dict[str, int], players: list[str]) -> None:
        self.pars, self.players = pars, players
        self._scores: dict[tuple[str, str], Score] = {}

    def put(self, player: str, hole: str, score: Score) -> None:
        """Write a score."""
        self._scores[player, hole] = score

    def get(self, player: str, hole: str) -> Score | None:
        """Return a score, or None where there is none yet."""
        return self._scores.get((player, hole))

    def erase(self, hole: str) -> None:
        """Take a hole's scores off the card."""
        for player in self.players:
            self._scores.pop((player, hole), None)

    def rows(self, best: dict[str, int]) -> list[list[str]]:
        """Return the table as text: a heading, a row for each hole, and the sums of the holes played."""
        rows = [["Hole", "Par", *self.players, "Best"]]
        for hole, par in self.pars.items():
            cells = [_cell(self.get(player, hole)) for player in self.players]
            rows.append([title(hole), str(par), *cells, str(best.get(hole, "–"))])
        played = [hole for hole in self.pars if self.get(self.players[0], hole)]
        sums = [[score.strokes for hole in played if (score := self.get(player, hole))] for player in self.players]
        par = sum(self.pars[hole] for hole in played)
        known = [best[hole] for hole in played if hole in best]
        return [*rows, ["Total", str(par), *(str(sum(column)) for column in sums), str(sum(known)) if known else "–"]]


def title(hole: str) -> str:
    """Return a hole's name as one writes it."""
    return hole.replace("_", " ").capitalize()


def _cell(score: Score | None) -> str:
    if score is None:
        return "–"
    return f"{score.strokes}{'' if score.holed else ' (out)'}{' *' if score.practice else ''}"


def praise(score: Score, par: int) -> str:
    """Return how to announce a finished hole."""
    if not score.holed:
        return f"Not holed within {score.strokes} strokes"
    if score.strokes == 1:
        return "Hole in one!"
    name = NAMES.get(score.strokes - par, "")
    return f"Holed in {score.strokes}" + (f": {name}" if name else "")


class BestScores:
    """The best score of each hole, kept in a JSON file that is replaced as a whole.

    A file that cannot be read as scores is set aside, and a folder that cannot be written is put up with; either is
    said once on stderr.

    Args:
        path: the file; it and its folder are made when there is something to keep.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._warned = False
        self.best = self._read()

    def offer(self, hole: str, score: Score) -> bool:
        """Keep a score if it is the hole's best; return whether it is."""
        if not score.holed or score.practice:
            return False
        known = self._read()  # Another game may have written meanwhile.
        self.best = {name: min(scores) for name, scores in _merged(self.best, known).items()}
        if score.strokes >= self.best.get(hole, sys.maxsize):
            return False
        self.best[hole] = score.strokes
        self._write()
        return True

    def _read(self) -> dict[str, int]:
        try:
            text = self._path.read_text(encoding="utf-8")
        except FileNotFoundError:
            return {}
        except (OSError, UnicodeDecodeError) as error:
            return self._set_aside(error)
        try:
            return _checked(json.loads(text))
        except (ValueError, RecursionError) as error:
            return self._set_aside(error)

    def _set_aside(self, error: Exception) -> dict[str, int]:
        aside = self._path.with_name(self._path.name + ".damaged")
        try:
            self._path.replace(aside)
        except OSError:
            self._warn(f"the best scores in {self._path} cannot be read ({error}); playing without them.")
        else:
            self._warn(f"the best scores in {self._path} were damaged ({error}); set aside as {aside.name}.")
        return {}

    def _write(self) -> None:
        try:
            write_text(self._path, json.dumps({"version": VERSION, "best": self.best}, indent=1))
        except OSError as error:
            self._warn(f"the best scores cannot be kept: {error}; make {self._path.parent} writable.")

    def _warn(self, message: str) -> None:
        if not self._warned:
            print(f"minigolf: {message}", file=sys.stderr)
        self._warned = True


def _checked(data: object) -> dict[str, int]:
    """Return the scores of a file's content, or raise a ValueError."""
    best = data.get("best") if isinstance(data, dict) and data.get("version") == VERSION else None
    if not isinstance(best, dict):
        raise ValueError(f"expected version {VERSION} and best scores, received {data!r:.60}")
    for hole, strokes in best.items():
        if type(strokes) is not int or strokes < 1:
            raise ValueError(f"{hole}: expected strokes >= 1, received {strokes!r:.60}")
    return best


def _merged(a: dict[str, int], b: dict[str, int]) -> dict[str, list[int]]:
    return {hole: [scores[hole] for scores in (a, b) if hole in scores] for hole in {**a, **b}}
