"""Independent calculations: see README.md."""
