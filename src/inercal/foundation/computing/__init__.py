"""Many runs: workers, checkpoints, clusters."""
