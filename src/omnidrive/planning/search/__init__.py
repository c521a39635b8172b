"""Grid search: A*, jump-point search, Lazy Theta* and greedy best-first search."""

from omnidrive.planning.search.grid_search import GridSearch, MethodName, search
from omnidrive.planning.search.heuristics import HeuristicName
from omnidrive.planning.search.result import SearchResult

__all__ = ["GridSearch", "HeuristicName", "MethodName", "SearchResult", "search"]
