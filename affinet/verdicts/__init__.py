"""What came of a run, and whether what must hold did."""
