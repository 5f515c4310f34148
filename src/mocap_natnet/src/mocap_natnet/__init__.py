"""Motion capture over NatNet: codec, client, and an emulated Motive."""
