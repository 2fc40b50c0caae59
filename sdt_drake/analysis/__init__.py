"""Numbers of runs and loops: tracking, margins, budgets, perception, the paper's claims."""
