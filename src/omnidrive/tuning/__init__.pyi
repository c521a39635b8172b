from .balanced import BalancedObjective
from .gain import Gain, HeldOut, MotionGains, held_out_gain
from .objective import Limit, Objective, parse_limit, parse_objective
from .problem import Tuning, TuningSettings, load_tuning, settings_of
from .report import lead, tuning_tables, write_tuning
from .run_sets import RunSets, default_sets
from .search import Budget, SearchResult, Trial, search
from .space import Dimension, ParameterSpace, parameter_space
from .tune import TuningResult, equal_budget, tune

__all__ = [
    "BalancedObjective",
    "Budget",
    "Dimension",
    "Gain",
    "HeldOut",
    "Limit",
    "MotionGains",
    "Objective",
    "ParameterSpace",
    "RunSets",
    "SearchResult",
    "Trial",
    "Tuning",
    "TuningResult",
    "TuningSettings",
    "default_sets",
    "equal_budget",
    "held_out_gain",
    "lead",
    "load_tuning",
    "parameter_space",
    "parse_limit",
    "parse_objective",
    "search",
    "settings_of",
    "tune",
    "tuning_tables",
    "write_tuning",
]
