"""Search for the best putt: the function of ``players.search``, for programs that import it from here."""

from minigolf_env.players.search import search as search
