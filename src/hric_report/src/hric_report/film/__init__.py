"""Films of a run: pictures of the replay, drawn by headless Chromium, as MP4 or WebM."""
