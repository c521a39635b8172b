"""Search for ways over the cells of a grid: the shortest, any-angle and greedy."""

from omnidrive.planning.search.grid_search import GridSearch, search
from omnidrive.planning.search.result import SearchResult

__all__ = ["GridSearch", "SearchResult", "search"]
