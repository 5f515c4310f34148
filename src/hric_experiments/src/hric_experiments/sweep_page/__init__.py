"""What the page of a sweep shows, each part in a module of its own; `sweep.page` writes it."""
