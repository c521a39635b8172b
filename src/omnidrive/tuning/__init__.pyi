from .objective import Limit, Objective, parse_limit, parse_objective
from .search import Budget, SearchResult, Trial, search
from .space import Dimension, ParameterSpace, parameter_space

__all__ = [
    "Budget",
    "Dimension",
    "Limit",
    "Objective",
    "ParameterSpace",
    "SearchResult",
    "Trial",
    "parameter_space",
    "parse_limit",
    "parse_objective",
    "search",
]
