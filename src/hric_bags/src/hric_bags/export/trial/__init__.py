"""Trials as files: markers, force plates and EMG on one time grid, as c3d, BIDS and XDF."""
