"""One agent: what it estimates of its neighbours from what reached it, and how it steers.

Everything works on arrays `(..., n, D)`: n neighbours (padded, with a mask), D axes, and any leading axes. A process calls it
with none, the in-process runtime with (agents,), a Monte-Carlo study with (runs, agents). Nothing here knows the world.
"""
