"""The score card of a round, and the best scores kept between rounds."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import NamedTuple

from minigolf_env._atomic_io import write_text
from minigolf_env._validation import quote, quote_error, quote_unless_plain

SCORES_FILE_VERSION = 1
"""Version of the file format of best scores."""

SCORE_NAMES = {-3: "Albatross", -2: "Eagle", -1: "Birdie", 0: "Par", 1: "Bogey", 2: "Double bogey", 3: "Triple bogey"}
"""Golf's name of a score, by the strokes over par."""


class HoleScore(NamedTuple):
    """The score of a player on a hole."""

    strokes: int
    """Number of strokes."""
    holed: bool
    """False if the player ran out of strokes."""
    is_practice: bool = False
    """True if strokes were undone; such a score is never a best score."""


class ScoreCard:
    """A table of scores with a row for each hole and a column for each player.

    Args:
        pars: par of each hole by its name, in the order of play.
        players: names of the players; the first is the human.
    """

    def __init__(self, pars: dict[str, int], players: list[str]) -> None:
        self.pars = pars
        self.players = players
        self._scores: dict[tuple[str, str], HoleScore] = {}

    def put(self, player: str, hole: str, score: HoleScore) -> None:
        """Set a score."""
        self._scores[player, hole] = score

    def get(self, player: str, hole: str) -> HoleScore | None:
        """Return a score, or None if there is none yet."""
        return self._scores.get((player, hole))

    def erase(self, hole: str) -> None:
        """Remove the scores of a hole."""
        for player in self.players:
            self._scores.pop((player, hole), None)

    def rows(self, best: dict[str, int]) -> list[list[str]]:
        """Return the cells of the table: a header, a row for each hole, and the totals of the holes played."""
        rows = [["Hole", "Par", *self.players, "Best"]]
        for hole, par in self.pars.items():
            cells = [_cell(self.get(player, hole)) for player in self.players]
            rows.append([hole_title(hole), str(par), *cells, str(best.get(hole, "–"))])
        # The totals are over the holes that the human has played.
        played = [hole for hole in self.pars if self.get(self.players[0], hole)]
        totals = [sum(self._strokes(player, hole) for hole in played) for player in self.players]
        best_played = [best[hole] for hole in played if hole in best]
        par_total = sum(self.pars[hole] for hole in played)
        best_total = str(sum(best_played)) if best_played else "–"
        return [*rows, ["Total", str(par_total), *map(str, totals), best_total]]

    def _strokes(self, player: str, hole: str) -> int:
        score = self.get(player, hole)
        return 0 if score is None else score.strokes


def hole_title(hole: str) -> str:
    """Return the displayed name of a hole."""
    return hole.replace("_", " ").capitalize()


def _cell(score: HoleScore | None) -> str:
    if score is None:
        return "–"
    return f"{score.strokes}{'' if score.holed else ' (out)'}{' *' if score.is_practice else ''}"


def score_message(score: HoleScore, par: int) -> str:
    """Return the announcement of a finished hole."""
    if not score.holed:
        return f"Not holed within {score.strokes} strokes"
    if score.strokes == 1:
        return "Hole in one!"
    name = SCORE_NAMES.get(score.strokes - par, "")
    return f"Holed in {score.strokes}" + (f": {name}" if name else "")


class BestScores:
    """The best score of each hole, stored in a JSON file that is replaced atomically.

    A damaged file is renamed, and a folder that cannot be written is ignored. Either prints one warning to stderr.

    Args:
        path: the file; it and its folder are created with the first score.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._warned = False
        self.strokes_by_hole = self._read()
        """Best number of strokes of each hole by its name."""

    def offer(self, hole: str, score: HoleScore) -> bool:
        """Store a score if it is the best of the hole; return whether it is."""
        if not score.holed or score.is_practice:
            return False
        stored = self._read()  # Another game may have written the file since.
        self.strokes_by_hole = {
            name: min(scores) for name, scores in _scores_by_hole(self.strokes_by_hole, stored).items()
        }
        if score.strokes >= self.strokes_by_hole.get(hole, sys.maxsize):
            return False
        self.strokes_by_hole[hole] = score.strokes
        self._write()
        return True

    def _read(self) -> dict[str, int]:
        """Return the stored scores; none if there is no file or it is damaged."""
        try:
            text = self._path.read_text(encoding="utf-8")
        except FileNotFoundError:
            return {}
        except (OSError, UnicodeDecodeError) as error:
            return self._set_aside(error)
        try:
            return _check_scores(json.loads(text))
        except (ValueError, RecursionError) as error:
            return self._set_aside(error)

    def _set_aside(self, error: Exception) -> dict[str, int]:
        """Rename a damaged file, warn, and return no scores."""
        reason = quote_error(error)
        aside = self._path.with_name(self._path.name + ".damaged")
        try:
            self._path.replace(aside)
        except OSError:
            self._warn(f"the best scores in {self._path} cannot be read ({reason}); continuing without them.")
        else:
            self._warn(f"the best scores in {self._path} are damaged ({reason}); the file was renamed to {aside.name}.")
        return {}

    def _write(self) -> None:
        try:
            write_text(self._path, json.dumps({"version": SCORES_FILE_VERSION, "best": self.strokes_by_hole}, indent=1))
        except OSError as error:
            self._warn(f"the best scores cannot be saved: {error}; make {self._path.parent} writable.")

    def _warn(self, message: str) -> None:
        """Print a warning, unless there was one before."""
        if not self._warned:
            print(f"minigolf: {message}", file=sys.stderr)
        self._warned = True


def _check_scores(data: object) -> dict[str, int]:
    """Return the scores in a file's content.

    Raises:
        ValueError: the content has another version or form.
    """
    best = data.get("best") if isinstance(data, dict) and data.get("version") == SCORES_FILE_VERSION else None
    if not isinstance(best, dict):
        raise ValueError(f"expected version {SCORES_FILE_VERSION} and best scores, received {quote(data)}")
    for hole, strokes in best.items():
        if type(strokes) is not int or strokes < 1:
            raise ValueError(f"{quote_unless_plain(hole)}: expected strokes >= 1, received {quote(strokes)}")
    return best


def _scores_by_hole(a: dict[str, int], b: dict[str, int]) -> dict[str, list[int]]:
    """Return the scores of each hole in either table."""
    return {hole: [scores[hole] for scores in (a, b) if hole in scores] for hole in {**a, **b}}
