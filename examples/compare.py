"""Compare three controllers on the paper's path; `od.paper_scenario()` is the whole study."""

from pathlib import Path
from tempfile import mkdtemp

import omnidrive as od

if __name__ == "__main__":  # worker processes import this file
    folder = Path(mkdtemp()) / "study"
    scenario = od.paper_scenario().with_values(
        controllers={
            "fuzzy": "fuzzy_t2",
            "nmpc": "holonomic-nmpc",
            "soft": {"type": "holonomic-nmpc", "weights": {"position_weight": 20.0}},
        },
        tasks={"track": {"durations": [20.0]}},
    )
    study = od.run_study(scenario, folder, processes=2)
    for run in study.records:
        me, mae = run.metrics["me"], run.metrics["mae"]
        print(f"{run.name:<28} ME {me:.4f} m   MAE {mae:.4f} rad")
    print(f"open {folder / 'report.html'}")
