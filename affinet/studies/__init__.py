"""Many runs, claims about them, and figures."""
