"""Scenarios, studies and profiles that come with affinet."""
