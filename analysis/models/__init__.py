"""Mathematics of the papers that agents, world and studies share."""
