"""Reports, each a Markdown file and a page."""
