"""Search for ways over the cells of a grid: the shortest, any-angle and greedy."""

from omnidrive.planning.search.grid_search import GridSearch, MethodName, search
from omnidrive.planning.search.lengths import HeuristicName
from omnidrive.planning.search.result import SearchResult

__all__ = ["GridSearch", "HeuristicName", "MethodName", "SearchResult", "search"]
