"""Search for the best putt, under the name that other programs import."""

from minigolf_env.players.search import search as search
