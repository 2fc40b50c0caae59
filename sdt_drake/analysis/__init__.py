"""Numbers of runs and loops: tracking, comparisons, steps, margins, budgets."""
