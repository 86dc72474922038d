"""Arithmetic that gives the same bits on any CPU, for a number alone and in a batch."""
