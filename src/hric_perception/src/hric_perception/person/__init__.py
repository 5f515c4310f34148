"""A real person before the cameras of a motion capture system: from the labelled markers on topics to his joints, and
with the force on his hand to what his muscles do. The cores are `hric_human.tracking` and
`hric_human.muscles.live_load`."""
