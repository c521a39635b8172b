"""Grid search: A*, jump-point search, Lazy Theta* and greedy best-first search."""

from omnidrive.planning.search.grid_search import GridSearch, search
from omnidrive.planning.search.result import SearchResult

__all__ = ["GridSearch", "SearchResult", "search"]
