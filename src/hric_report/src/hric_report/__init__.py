"""Reports of a run: figures, texts, pages and comparisons."""
