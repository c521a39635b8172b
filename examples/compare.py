"""Run the paper's study; equivalent to `omnidrive compare`."""

from pathlib import Path
from tempfile import mkdtemp

import omnidrive as od

if __name__ == "__main__":  # worker processes import this file
    folder = Path(mkdtemp()) / "study"
    study = od.run_study(od.paper_scenario(), folder, processes=2)
    for run in study.results.tracks:
        print(f"{run.name:<28} ME {run.metrics.me:.4f} m   MAE {run.metrics.mae:.4f} rad")
    print(f"open {folder / 'report.html'}")
