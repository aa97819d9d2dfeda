"""Which error of a rig matters: exact, sampled and local sensitivity, and Shapley effects."""
