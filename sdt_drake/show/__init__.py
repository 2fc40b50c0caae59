"""Everything that is seen: figures, reports, pages, block diagrams, 3D."""
