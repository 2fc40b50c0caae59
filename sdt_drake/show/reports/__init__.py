"""Reports: one Markdown file and one page each."""
