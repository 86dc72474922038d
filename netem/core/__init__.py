"""Arrays, draws, links and channels: what the rest of the network is said in."""
