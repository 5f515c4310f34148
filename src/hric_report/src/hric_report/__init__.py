"""Reports of recorded runs: figures, texts, HTML pages and comparisons."""
