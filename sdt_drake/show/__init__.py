"""Figures, reports, pages, block diagrams and 3D scenes."""
