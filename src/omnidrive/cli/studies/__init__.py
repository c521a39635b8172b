"""Commands that simulate: runs, comparisons, studies and tuning."""
