"""What a recording is worth: metrics, verdicts, figures, report."""
